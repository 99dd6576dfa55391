"""Makes the files of `data/volumes`: small odd volumes, and beside each the values that it must decode to.

Run in a scratch environment with: pip install numpy nibabel pynrrd
The values are NumPy's own (what was given to the writer). An expectation is `FILE.expected.npy`, always float32,
(z, y, x, channels); `FILE@PART.expected.npy` belongs to a part of the file.
"""

import pathlib

import nibabel
import nrrd
import numpy as np

OUT = pathlib.Path(__file__).parent / "data" / "volumes"
OUT.mkdir(parents=True, exist_ok=True)
rng = np.random.default_rng(11)
X, Y, Z = 5, 4, 3


def integers(kind, *shape):
    info = np.iinfo(kind)
    values = rng.integers(info.min, info.max, shape, dtype=kind, endpoint=True)
    values.flat[:2] = info.min, info.max
    return values


def floats(kind, *shape):
    return rng.normal(0.3, 2.0, shape).astype(kind)


def value(stored):
    """What stored numbers stand for: unsigned 8 and 16 bits for 0..1, others for themselves."""
    if stored.dtype in (np.uint8, np.uint16):
        return stored / np.float64(np.iinfo(stored.dtype).max)
    return stored.astype(np.float64)


def expect(name, values):
    """`values` with axes x, y, z and perhaps channels."""
    values = values.reshape(values.shape[:3] + (-1,))
    np.save(OUT / f"{name}.expected.npy", np.ascontiguousarray(values.transpose(2, 1, 0, 3), dtype=np.float32))


# --- NRRD: arrays are indexed [x, y, z], as pynrrd does by default ---------------------------------------------------

KINDS = {"u8": np.uint8, "i8": np.int8, "u16": np.uint16, "i16": np.int16, "u32": np.uint32, "i32": np.int32, "i64": np.int64}
for name, kind in KINDS.items():
    data = integers(kind, X, Y, Z)
    encoding = "gzip" if name in ("u8", "i16") else "raw"
    nrrd.write(str(OUT / f"{name}.nrrd"), data, {"encoding": encoding, "spacings": [0.5, 1.0, 2.0]})
    expect(f"{name}.nrrd", value(data))
for name, kind in {"f32": np.float32, "f64": np.float64}.items():
    data = floats(kind, X, Y, Z)
    nrrd.write(str(OUT / f"{name}.nrrd"), data, {"encoding": "gzip" if name == "f64" else "raw"})
    expect(f"{name}.nrrd", data)
data = floats(">f4", X, Y, Z)
nrrd.write(str(OUT / "big.nrrd"), data, {"encoding": "raw", "endian": "big"})
expect("big.nrrd", data)
data = floats(np.float32, X, Y, Z)
directions = [[0.5, 0, 0], [0, 0.6, 0.8], [0, -1.6, 1.2]]
nrrd.write(str(OUT / "detached.nhdr"), data, {"encoding": "raw", "space": "left-posterior-superior", "space directions": directions})
expect("detached.nhdr", data)
data = floats(np.float32, X, Y, Z)
nrrd.write(str(OUT / "detached-gzip.nhdr"), data, {"encoding": "gzip"}, detached_header=True)
expect("detached-gzip.nhdr", data)
data = integers(np.uint8, 4, X, Y, Z)
nrrd.write(str(OUT / "rgba.nrrd"), data, {"encoding": "raw", "kinds": ["RGBA-color", "domain", "domain", "domain"]})
expect("rgba.nrrd", value(data).transpose(1, 2, 3, 0))

# --- NIfTI: arrays are indexed [x, y, z] -------------------------------------------------------------------------------

AFFINE = np.diag([0.5, 1.0, 2.0, 1.0])
for name, kind in KINDS.items():
    data = integers(kind, X, Y, Z)
    image = nibabel.Nifti1Image(data, AFFINE, dtype=kind)
    ending = "nii.gz" if name in ("u16", "i32") else "nii"
    nibabel.save(image, OUT / f"{name}.{ending}")
    expect(f"{name}.{ending}", value(data))
data = floats(np.float32, X, Y, Z)
nibabel.save(nibabel.Nifti2Image(data, AFFINE), OUT / "version2.nii.gz")
expect("version2.nii.gz", data)
data = floats(np.float64, X, Y, Z)
nibabel.save(nibabel.Nifti1Image(data, AFFINE), OUT / "f64.nii")
expect("f64.nii", data)
header = nibabel.Nifti1Header(endianness=">")
data = integers(np.int16, X, Y, Z)
header.set_data_dtype(np.int16)
header.set_data_shape(data.shape)
image = nibabel.Nifti1Image(data, AFFINE, header)
nibabel.save(image, OUT / "big.nii")
expect("big.nii", value(data))
stored = integers(np.uint8, X, Y, Z)
image = nibabel.Nifti1Image(stored, AFFINE, dtype=np.uint8)
image.header.set_slope_inter(2.5, -100.0)
with open(OUT / "scaled.nii", "wb") as file:
    image.header["vox_offset"] = 352
    image.header["magic"] = b"n+1"
    image.header.write_to(file)
    file.write(bytes(352 - file.tell()) + stored.tobytes(order="F"))
assert np.allclose(nibabel.load(OUT / "scaled.nii").get_fdata(), stored * 2.5 - 100.0)
expect("scaled.nii", stored * 2.5 - 100.0)
series = floats(np.float32, X, Y, Z, 3)
nibabel.save(nibabel.Nifti1Image(series, AFFINE), OUT / "series.nii.gz")
expect("series.nii.gz@2", series[..., 2])
rgb = integers(np.uint8, X, Y, Z, 3)
packed = np.ascontiguousarray(rgb).view([("R", "u1"), ("G", "u1"), ("B", "u1")]).reshape(X, Y, Z)
nibabel.save(nibabel.Nifti1Image(packed, AFFINE), OUT / "rgb.nii")
expect("rgb.nii", value(rgb))

# --- NPY: arrays are indexed [z, y, x] ---------------------------------------------------------------------------------

for name, data in {
    "c-order.npy": integers(np.int16, Z, Y, X),
    "fortran.npy": np.asfortranarray(floats(np.float32, Z, Y, X)),
    "half.npy": floats(np.float16, Z, Y, X),
    "big.npy": floats(">f8", Z, Y, X),
    "channels.npy": integers(np.uint8, Z, Y, X, 4),
    "fortran-channels.npy": np.asfortranarray(floats(np.float32, Z, Y, X, 2)),
}.items():
    np.save(OUT / name, data)
    values = value(data)
    expect(name, values.transpose(2, 1, 0) if values.ndim == 3 else values.transpose(2, 1, 0, 3))

# --- raw ---------------------------------------------------------------------------------------------------------------

data = integers(np.uint16, X, Y, Z)
(OUT / "be.raw").write_bytes(data.astype(">u2").tobytes(order="F"))
expect(f"be.raw@{X}x{Y}x{Z}:u16be", value(data))
