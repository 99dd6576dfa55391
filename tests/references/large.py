#!/usr/bin/env python3
"""An image larger than memory through tone-map, GaussianBlur and equalize, against NumPy, band by band.

    python3 tests/references/large.py [--pipe target/release/pipe] [--size 32768] [--vram 512MiB] [--folder DIR]

Writes the image (half floats, uncompressed EXR, SIZE x SIZE x 6 bytes: 6 GiB for 32768), runs `pipe` on it and compares
what comes out with double precision: every pixel of the tone-mapped and the equalized image, every 8th band of the blurred
one (and so pixels at the seams of tiles of any size). `pipe` may take 2 GiB of memory at most. Needs NumPy and, for the
default size, 24 GiB of disk and a quarter of an hour on two cores.
"""

import argparse
import os
import resource
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from multiprocessing import Pool
from pathlib import Path

import numpy as np

BAND = 256
MOST_MEMORY = 2 << 30


# The image: a landscape of light with fine structure, over four orders of magnitude.


def rows_of_light(size, first, last):
    """Rows first..last in half precision: (rows, size, 3)."""
    x = np.arange(size, dtype=np.float32)[None, :]
    y = np.arange(first, last, dtype=np.float32)[:, None]
    hills = np.exp(1.5 * np.sin(x / 971.0) + 1.2 * np.cos(y / 1310.0) + 0.8 * np.sin((x + y) / 89.0))
    grain = ((x.astype(np.int64) * 73856093) ^ (y.astype(np.int64) * 19349663)) & 1023
    light = 0.18 * hills * (0.5 + grain.astype(np.float32) / 1023.0)
    return np.stack([light, 0.8 * light, 0.6 * light + 0.01], axis=2).astype(np.float16)


# Uncompressed scan-line EXR.


def exr_header(size):
    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    channels = b"".join(c + b"\0" + struct.pack("<iBBBBii", 1, 0, 0, 0, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, size - 1, size - 1)
    return b"".join(
        [
            struct.pack("<ii", 20000630, 2),
            attribute("channels", "chlist", channels),
            attribute("compression", "compression", b"\0"),
            attribute("dataWindow", "box2i", window),
            attribute("displayWindow", "box2i", window),
            attribute("lineOrder", "lineOrder", b"\0"),
            attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
            attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
            attribute("screenWindowWidth", "float", struct.pack("<f", 1.0)),
            b"\0",
        ]
    )


def write_band(arguments):
    path, size, begin, first, last = arguments
    chunk = 8 + 6 * size
    rows = np.zeros((last - first, chunk), np.uint8)
    rows[:, 0:4] = np.arange(first, last, dtype="<i4")[:, None].view(np.uint8).reshape(-1, 4)
    rows[:, 4:8] = np.frombuffer(struct.pack("<i", 6 * size), np.uint8)
    light = rows_of_light(size, first, last)
    for i, channel in enumerate((2, 1, 0)):
        plane = np.ascontiguousarray(light[:, :, channel]).view(np.uint8).reshape(last - first, 2 * size)
        rows[:, 8 + 2 * size * i : 8 + 2 * size * (i + 1)] = plane
    with open(path, "r+b") as file:
        file.seek(begin + first * chunk)
        file.write(rows.tobytes())


def write_exr(path, size, pool):
    header = exr_header(size)
    begin, chunk = len(header) + 8 * size, 8 + 6 * size
    with open(path, "wb") as file:
        file.write(header)
        file.write((begin + chunk * np.arange(size, dtype="<u8")).tobytes())
        file.truncate(begin + chunk * size)
    bands = [(path, size, begin, y, min(y + BAND, size)) for y in range(0, size, BAND)]
    pool.map(write_band, bands)


def exr_rows(path, size, first, last):
    """Rows of an uncompressed RGB EXR of halves: (rows, size, 3)."""
    chunk = 8 + 6 * size
    with open(path, "rb") as file:
        file.seek(os.path.getsize(path) - chunk * (size - first))
        bytes_ = np.frombuffer(file.read(chunk * (last - first)), np.uint8).reshape(-1, chunk)
    planes = np.ascontiguousarray(bytes_[:, 8:]).view("<f2").reshape(last - first, 3, size)
    return planes[:, ::-1, :].transpose(0, 2, 1)


# 8-bit RGB PNG, row by row.


def png_rows(path, size):
    """Bands of rows of a PNG: (first, (rows, size, 3))."""
    inflate = zlib.decompressobj()
    row, above, first = 1 + 3 * size, np.zeros(3 * size, np.uint8), 0
    rest = b""
    with open(path, "rb") as file:
        assert file.read(8) == b"\x89PNG\r\n\x1a\n"
        while True:
            length, kind = struct.unpack(">I4s", file.read(8))
            data = file.read(length)
            file.read(4)
            if kind == b"IEND":
                break
            if kind != b"IDAT":
                continue
            rest += inflate.decompress(data)
            count = len(rest) // row
            if count == 0:
                continue
            lines = np.frombuffer(rest[: count * row], np.uint8).reshape(count, row)
            rest = rest[count * row :]
            out = np.empty((count, 3 * size), np.uint8)
            for i, line in enumerate(lines):
                match line[0]:
                    case 0:
                        above = line[1:]
                    case 1:
                        above = np.cumsum(line[1:].reshape(size, 3), axis=0, dtype=np.uint8).reshape(-1)
                    case 2:
                        above = line[1:] + above
                    case other:
                        sys.exit(f"{path}: no code here for PNG filter {other}")
                out[i] = above
            yield first, out.reshape(count, size, 3)
            first += count
    assert first == size, f"{path} has {first} rows"


# What the graphs mean, in double precision.

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def light64(size, first, last):
    return rows_of_light(size, first, last).astype(np.float64)


def logarithms(arguments):
    """Sum and number of the logarithms of luminance."""
    values = np.log(1e-6 + np.maximum(light64(*arguments) @ WEIGHTS, 0.0))
    return float(values.sum()), values.size


def srgb8(linear):
    v = np.clip(linear, 0.0, 1.0)
    v = np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)
    return np.floor(v * 255.0 + 0.5).astype(np.uint8)


def tone_mapped(light, average, white):
    """Reinhard 2002: the photographic operator; without `white` the simple one."""
    y = light @ WEIGHTS
    scaled = 0.18 * y / average
    burnt = 0.0 if white is None else scaled / white**2
    mapped = scaled * (1.0 + burnt) / (1.0 + scaled)
    return light * (mapped / np.where(y > 0.0, y, 1.0))[:, :, None]


def bins_of(mapped):
    return np.clip(np.floor(mapped @ WEIGHTS * 256.0), 0, 255).astype(np.int64)


def histogram(arguments):
    size, first, last, average = arguments
    return np.bincount(bins_of(tone_mapped(light64(size, first, last), average, None)).ravel(), minlength=256)


def expected_tone(arguments):
    size, first, last, average = arguments
    return srgb8(tone_mapped(light64(size, first, last), average, 4.0))


def expected_equal(arguments):
    size, first, last, average, levels = arguments
    mapped = tone_mapped(light64(size, first, last), average, None)
    y = mapped @ WEIGHTS
    return srgb8(mapped * (levels[bins_of(mapped)] / np.where(y > 0.0, y, 1.0))[:, :, None])


def blurred_difference(arguments):
    """The largest difference, relative to 1 + value, in rows first..last of the blurred image."""
    path, size, first, last, sigma = arguments
    radius = int(np.ceil(3 * sigma))
    k = np.arange(-radius, radius + 1)
    weights = np.exp(-(k**2) / (2 * sigma**2))
    weights /= weights.sum()
    got = exr_rows(path, size, first, last).astype(np.float64)
    rows = np.clip(np.arange(first - radius, last + radius), 0, size - 1)
    low, high = rows.min(), rows.max() + 1
    light = light64(size, low, high)[rows - low]
    columns = sum(w * light[i : i + last - first] for i, w in enumerate(weights))
    padded = np.pad(columns, ((0, 0), (radius, radius), (0, 0)), mode="edge")
    expected = sum(w * padded[:, i : i + size] for i, w in enumerate(weights))
    return float((np.abs(got - expected) / (1.0 + expected)).max())


# Running and comparing.


def run(pipe, arguments):
    started = time.time()
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    subprocess.run([pipe, *arguments], check=True)
    most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
    print(f"  {time.time() - started:.0f} s, {most / 2**20:.0f} MiB at most", flush=True)
    if most > MOST_MEMORY:
        sys.exit(f"`pipe {' '.join(arguments)}` took {most / 2**20:.0f} MiB ({before} KiB before)")


def compare_png(path, size, pool, expected, arguments):
    """Counts samples that differ, by how much."""
    most, different = 0, 0
    bands = [(size, y, min(y + BAND, size), *arguments) for y in range(0, size, BAND)]
    wanted = pool.imap(expected, bands)
    pending, at = np.empty((0, size, 3), np.uint8), 0
    for first, got in png_rows(path, size):
        while at < first + len(got):
            if len(pending) == 0:
                pending = next(wanted)
            n = min(len(pending), first + len(got) - at)
            off = np.abs(got[at - first : at - first + n].astype(np.int16) - pending[:n].astype(np.int16))
            most, different = max(most, int(off.max())), different + int((off > 0).sum())
            pending, at = pending[n:], at + n
    share = different / (3 * size * size)
    print(f"  {most} code values at most, {100 * share:.5f} % of samples differ", flush=True)
    return most, share


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pipe", default="target/release/pipe")
    parser.add_argument("--size", type=int, default=32768)
    parser.add_argument("--vram", default="512MiB")
    parser.add_argument("--folder")
    parser.add_argument("--device", default="cpu")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=a.folder) as name, Pool() as pool:
        folder, size = Path(name), a.size
        source = folder / "in.exr"
        print(f"writing {size}x{size} pixels", flush=True)
        write_exr(source, size, pool)
        bands = [(size, y, min(y + BAND, size)) for y in range(0, size, BAND)]
        sums = pool.map(logarithms, bands)
        common = ["--vram", a.vram, "--device", a.device]

        print("tone-map", flush=True)
        run(a.pipe, ["run", "tone-map", str(source), str(folder / "tone.png"), *common])
        luminance_average = float(np.exp(sum(s for s, _ in sums) / sum(n for _, n in sums)))
        most, share = compare_png(folder / "tone.png", size, pool, expected_tone, [luminance_average])
        assert most <= 1 and share < 1e-3
        (folder / "tone.png").unlink()

        print("equalize", flush=True)
        run(a.pipe, ["run", "equalize", str(source), str(folder / "equal.png"), *common])
        counts = sum(pool.map(histogram, [(*band, luminance_average) for band in bands]))
        levels = np.floor(255 * np.cumsum(counts) / counts.sum()) / 255
        most, share = compare_png(folder / "equal.png", size, pool, expected_equal, [luminance_average, levels])
        # A value at the border of two bins may count in the other one, and then looks like its neighbours.
        assert share < 1e-3
        (folder / "equal.png").unlink()

        print("GaussianBlur", flush=True)
        graph = folder / "blur.ron"
        graph.write_text(
            'Graph(version: 1, inputs: {"in": Image}, outputs: {"out": "b"}, nodes: {"b": GaussianBlur(image: "in", sigma: 8)})'
        )
        blurred = folder / "blur.exr"
        run(a.pipe, ["run", str(graph), str(source), str(blurred), "--compression", "none", *common])
        some = [(str(blurred), size, first, last, 8.0) for (_, first, last) in bands[::8] + bands[-1:]]
        worst = max(pool.map(blurred_difference, some))
        print(f"  {worst:.2e} of 1 + value at most")
        # Half precision rounds by 2^-11 of the value.
        assert worst < 6e-4
    print("all equal to NumPy")


if __name__ == "__main__":
    main()
