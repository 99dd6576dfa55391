"""Makes the files of `data/fixtures`: small odd pictures, and beside each the values that it must decode to.

Run in a scratch environment with: pip install numpy OpenEXR OpenImageIO pillow tifffile
The values are NumPy's own (what was given to the writer), or what libjpeg decodes, never what our reader says.
An expectation is `FILE.npy`, or `FILE@LAYER.npy` for a layer of an EXR; always float32, h x w x c.
"""

import io
import pathlib
import struct
import zlib

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import tifffile
from PIL import Image

OUT = pathlib.Path(__file__).parent / "data" / "fixtures"
OUT.mkdir(parents=True, exist_ok=True)
rng = np.random.default_rng(7)
H, W = 9, 13


def expect(name, values):
    values = np.asarray(values, dtype=np.float32)
    np.save(OUT / f"{name}.npy", values if values.ndim == 3 else values[..., None])


def half(*shape):
    return rng.normal(0.5, 1.0, shape).astype(np.float16)


def box(x, y, w, h):
    return (np.array([x, y], np.int32), np.array([x + w - 1, y + h - 1], np.int32))


def exr(name, channels, **header):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(header, channels).write(str(OUT / name))


# --- EXR ------------------------------------------------------------------------------------------------------------

# Data window overlapping the display window's lower right corner, and larger than it.
for name, data, display in [
    ("windows_overlap.exr", (7, 3, W, H), (2, 1, 12, 8)),
    ("windows_inside.exr", (-3, -2, W, H), (-6, -5, 20, 15)),
    ("windows_cropped.exr", (0, 0, W, H), (4, 2, 5, 4)),
    ("windows_apart.exr", (100, 100, W, H), (0, 0, 4, 3)),
]:
    rgb = half(H, W, 3)
    exr(name, {"RGB": rgb}, dataWindow=box(*data), displayWindow=box(*display))
    full = np.zeros((display[3], display[2], 3), np.float32)
    for y in range(display[3]):
        for x in range(display[2]):
            sy, sx = y + display[1] - data[1], x + display[0] - data[0]
            if 0 <= sy < H and 0 <= sx < W:
                full[y, x] = rgb[sy, sx]
    expect(name, full)

# Several layers in one part, of several types.
rgba, diffuse = half(H, W, 4), half(H, W, 3)
z = rng.uniform(1, 100, (H, W)).astype(np.float32)
ids = rng.integers(0, 1 << 24, (H, W)).astype(np.uint32)
uv = half(H, W, 2)
exr("layers.exr", {
    "R": rgba[..., 0].copy(), "G": rgba[..., 1].copy(), "B": rgba[..., 2].copy(), "A": rgba[..., 3].copy(),
    "Z": z, "diffuse.R": diffuse[..., 0].copy(), "diffuse.G": diffuse[..., 1].copy(),
    "diffuse.B": diffuse[..., 2].copy(), "ids.id": ids, "motion.u": uv[..., 0].copy(), "motion.v": uv[..., 1].copy(),
}, owner="somebody", custom="kept", xDensity=72.0)
expect("layers.exr", rgba)
expect("layers.exr@diffuse", diffuse)
expect("layers.exr@Z", z)
expect("layers.exr@ids", ids.astype(np.float32))
expect("layers.exr@motion", np.dstack([uv, np.zeros((H, W), np.float16)]))
expect("layers.exr@diffuse.G", diffuse[..., 1])

# Several parts; the first is no colour.
depth, beauty = rng.uniform(1, 9, (H, W)).astype(np.float32), half(H, W, 3)
OpenEXR.File([
    OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"Z": depth}, "depth"),
    OpenEXR.Part({"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}, {"RGB": beauty}, "beauty"),
]).write(str(OUT / "parts.exr"))
expect("parts.exr", beauty)
expect("parts.exr@depth", depth)

# Tiles with mip levels; level 0 is wanted.
big = half(20, 25, 3)
spec = oiio.ImageSpec(25, 20, 3, oiio.HALF)
spec.tile_width = spec.tile_height = 8
spec.attribute("compression", "zip")
spec.attribute("openexr:roundingmode", 0)
out = oiio.ImageOutput.create(str(OUT / "mip.exr"))
level, mode = big.astype(np.float32), "Create"
while True:
    spec.width, spec.height = level.shape[1], level.shape[0]
    spec.full_width, spec.full_height = spec.width, spec.height
    out.open(str(OUT / "mip.exr"), spec, mode)
    out.write_image(level)
    mode = "AppendMIPLevel"
    if level.shape[:2] == (1, 1):
        break
    level = level[: max(1, level.shape[0] // 2), : max(1, level.shape[1] // 2)].copy()
out.close()
expect("mip.exr", big)

# Luminance and subsampled chroma, reconstructed by the filter of OpenEXR's ImfRgbaYca.cpp, written out in f64.
TAPS = {1: 0.627123, 3: -0.186077, 5: 0.087929, 7: -0.043159, 9: 0.019597, 11: -0.007540, 13: 0.002128}


def double(line):
    n = len(line)
    result = np.zeros(2 * n)
    result[::2] = line
    for i in range(n):
        at = 2 * i + 1
        for distance, weight in TAPS.items():
            left, right = (at - distance) // 2, (at + distance) // 2
            result[at] += weight * (line[max(left, 0)] + line[min(right, n - 1)])
    return result


luminance = rng.uniform(0.1, 2, (20, 24)).astype(np.float16)
ry = rng.normal(0, 0.2, (10, 12)).astype(np.float16)
by = rng.normal(0, 0.2, (10, 12)).astype(np.float16)
full = [np.apply_along_axis(double, 0, np.apply_along_axis(double, 1, c.astype(np.float64))) for c in (ry, by)]
y64 = luminance.astype(np.float64)
# Weights of Rec.709 luminance from its chromaticities.
xyz = np.array([[x, y, 1 - x - y] for x, y in [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06)]]).T
weights = (xyz * np.linalg.solve(xyz, np.array([0.3127, 0.3290, 0.3583]) / 0.3290))[1]
r, b = (full[0] + 1) * y64, (full[1] + 1) * y64
g = (y64 - r * weights[0] - b * weights[2]) / weights[1]


def yc_exr(name, method, lines):
    """OpenEXR's Python module does not write subsampled channels, so the file is put together here."""

    def attribute(key, kind, value):
        return key + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value

    def channel(key, sampling):
        return key + b"\0" + struct.pack("<iB3xii", 1, 0, sampling, sampling)

    def compress(raw):
        if method == 0:
            return raw
        data = np.frombuffer(raw, np.uint8).astype(np.int32)
        data = np.concatenate([data[::2], data[1::2]])
        data[1:] = (data[1:] - data[:-1] + 128) % 256
        packed = zlib.compress(data.astype(np.uint8).tobytes())
        return packed if len(packed) < len(raw) else raw

    h, w = luminance.shape
    window = struct.pack("<4i", 0, 0, w - 1, h - 1)
    head = struct.pack("<ii", 20000630, 2) + b"".join([
        attribute(b"channels", b"chlist", channel(b"BY", 2) + channel(b"RY", 2) + channel(b"Y", 1) + b"\0"),
        attribute(b"compression", b"compression", bytes([method])),
        attribute(b"dataWindow", b"box2i", window),
        attribute(b"displayWindow", b"box2i", window),
        attribute(b"lineOrder", b"lineOrder", b"\0"),
        attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
        attribute(b"screenWindowCenter", b"v2f", struct.pack("<ff", 0, 0)),
        attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)),
        b"\0",
    ])
    blocks = []
    for top in range(0, h, lines):
        raw = b""
        for y in range(top, min(top + lines, h)):
            if y % 2 == 0:
                raw += by[y // 2].tobytes() + ry[y // 2].tobytes()
            raw += luminance[y].tobytes()
        packed = compress(raw)
        blocks.append(struct.pack("<ii", top, len(packed)) + packed)
    at, table = len(head) + 8 * len(blocks), b""
    for block in blocks:
        table += struct.pack("<Q", at)
        at += len(block)
    (OUT / name).write_bytes(head + table + b"".join(blocks))
    expect(name, np.dstack([r, g, b]))


yc_exr("yc_none.exr", 0, 1)
yc_exr("yc_zips.exr", 2, 1)
yc_exr("yc_zip.exr", 3, 16)

# Every lossless compression, half and float.
for name, compression in [("none", OpenEXR.NO_COMPRESSION), ("rle", OpenEXR.RLE_COMPRESSION),
                          ("zips", OpenEXR.ZIPS_COMPRESSION), ("piz", OpenEXR.PIZ_COMPRESSION)]:
    values = half(H, W, 3) if name in ("rle", "piz") else half(H, W, 3).astype(np.float32) / 3
    exr(f"{name}.exr", {"RGB": values}, compression=compression)
    expect(f"{name}.exr", values)


# --- PNG ------------------------------------------------------------------------------------------------------------


def png(name, width, height, depth, kind, rows, extra=b"", interlace=0):
    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))

    head = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, interlace)
    body = chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows)))
    (OUT / name).write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + extra + body + chunk(b"IEND", b""))


def chunk(tag, data):
    return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))


adam7 = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
rgb8 = rng.integers(0, 256, (H, W, 3)).astype(np.uint8)
rows = [rgb8[y, x0::dx].tobytes() for x0, y0, dx, dy in adam7 for y in range(y0, H, dy) if rgb8[y, x0::dx].size]
png("interlaced.png", W, H, 8, 2, rows, interlace=1)
expect("interlaced.png", rgb8 / np.float32(255))

rgba16 = rng.integers(0, 65536, (H, W, 4)).astype(np.uint16)
png("rgba16.png", W, H, 16, 6, [row.astype(">u2").tobytes() for row in rgba16])
expect("rgba16.png", rgba16 / np.float32(65535))

palette = rng.integers(0, 256, (6, 3)).astype(np.uint8)
index = rng.integers(0, 6, (H, W)).astype(np.uint8)
padded = np.pad(index, ((0, 0), (0, 1)))
packed = (padded[:, ::2] << 4) | padded[:, 1::2]
opacity = np.array([0, 100, 255], np.uint8)
png("palette4.png", W, H, 4, 3, [row.tobytes() for row in packed],
    chunk(b"PLTE", palette.tobytes()) + chunk(b"tRNS", opacity.tobytes()))
alpha = np.concatenate([opacity, np.full(3, 255, np.uint8)])[index]
expect("palette4.png", np.dstack([palette[index], alpha]) / np.float32(255))

bits = rng.integers(0, 2, (H, W)).astype(np.uint8)
png("grey1.png", W, H, 1, 0, [np.packbits(row).tobytes() for row in bits])
expect("grey1.png", bits)

grey = rng.integers(0, 256, (H, W)).astype(np.uint8)
png("linear.png", W, H, 8, 0, [row.tobytes() for row in grey], chunk(b"gAMA", struct.pack(">I", 100000)))
expect("linear.png", grey / np.float32(255))

# --- TIFF -----------------------------------------------------------------------------------------------------------

tifffile.imwrite(OUT / "tiled16.tif", np.tile(rgba16[..., :3], (2, 2, 1)), tile=(16, 16), photometric="rgb", compression="zlib")
expect("tiled16.tif", np.tile(rgba16[..., :3], (2, 2, 1)) / np.float32(65535))
planes = half(3, H, W).astype(np.float32)
tifffile.imwrite(OUT / "planar.tif", planes, photometric="rgb", planarconfig="separate")
expect("planar.tif", planes.transpose(1, 2, 0))
tifffile.imwrite(OUT / "big_endian_grey16.tif", rgba16[..., 0], byteorder=">")
expect("big_endian_grey16.tif", rgba16[..., 0] / np.float32(65535))
tifffile.imwrite(OUT / "rgba8.tif", np.dstack([rgb8, grey]), photometric="rgb", extrasamples=["unassalpha"], compression="zlib")
expect("rgba8.tif", np.dstack([rgb8, grey]) / np.float32(255))
tifffile.imwrite(OUT / "half.tif", half_values := half(H, W, 3), photometric="rgb")
expect("half.tif", half_values)
tifffile.imwrite(OUT / "greyalpha.tif", np.dstack([grey, bits * 255]).astype(np.uint8), photometric="minisblack", extrasamples=["unassalpha"], planarconfig="contig")
expect("greyalpha.tif", np.dstack([grey, bits * 255]) / np.float32(255))
Image.fromarray(bits * 255).convert("1").save(OUT / "bilevel.tif", compression="tiff_lzw")
expect("bilevel.tif", bits)

# --- JPEG, WebP, HDR, PFM, QOI ---------------------------------------------------------------------------------------

ramp = np.dstack([np.add.outer(np.arange(24), np.arange(16)) * 5, np.full((24, 16), 90), np.add.outer(np.arange(24) * 8, np.zeros(16))]).astype(np.uint8)
exif = Image.Exif()
exif[0x0112] = 6
Image.fromarray(ramp).save(OUT / "turned.jpg", quality=97, subsampling=0, exif=exif)
expect("turned.jpg", np.rot90(np.asarray(Image.open(OUT / "turned.jpg")), -1) / np.float32(255))
Image.fromarray(ramp[..., 0]).save(OUT / "grey.jpg", quality=97)
expect("grey.jpg", np.asarray(Image.open(OUT / "grey.jpg")) / np.float32(255))
Image.fromarray(ramp).save(OUT / "progressive.jpg", quality=97, subsampling=0, progressive=True)
expect("progressive.jpg", np.asarray(Image.open(OUT / "progressive.jpg")) / np.float32(255))
Image.fromarray(np.dstack([rgb8, grey | 1])).save(OUT / "lossless.webp", lossless=True, exact=True)
expect("lossless.webp", np.dstack([rgb8, grey | 1]) / np.float32(255))

bright = np.exp(rng.normal(0, 2, (H, W, 3))).astype(np.float32)
oiio.ImageBuf(bright).write(str(OUT / "bright.hdr"))
decoded = oiio.ImageBuf(str(OUT / "bright.hdr")).get_pixels(oiio.FLOAT)
expect("bright.hdr", decoded)

(OUT / "big.pfm").write_bytes(b"PF\n%d %d\n1.0\n" % (W, H) + bright[::-1].astype(">f4").tobytes())
expect("big.pfm", bright)
(OUT / "little.pfm").write_bytes(b"Pf\n%d %d\n-1.0\n" % (W, H) + bright[::-1, :, 0].astype("<f4").tobytes())
expect("little.pfm", bright[..., 0])

# QOI with only QOI_OP_RGB and QOI_OP_RGBA is short to write and valid.
body = b"".join(b"\xff" + bytes(p) for p in np.dstack([rgb8, grey]).reshape(-1, 4))
(OUT / "plain.qoi").write_bytes(b"qoif" + struct.pack(">IIBB", W, H, 4, 0) + body + b"\0" * 7 + b"\1")
expect("plain.qoi", np.dstack([rgb8, grey]) / np.float32(255))
