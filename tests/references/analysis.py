"""Expected values of the analysis nodes, made by NumPy: writes analysis.json beside this file.

    python3 -m venv venv && venv/bin/pip install numpy openexr
    venv/bin/python tests/references/analysis.py

Versions that made the committed file: numpy 2.4.6, OpenEXR 3.5.3.

Counts are those of numpy.histogram, to the last pixel; what is not finite is left out before, as NumPy wants it.
"""

import json
from pathlib import Path

import numpy as np
import OpenEXR

HERE = Path(__file__).parent
WIDTH, HEIGHT = 257, 129


def noise():
    """Numbers of a linear congruential generator in -0.5..1.5; every 97th is no number, every 101st infinite."""
    n = WIDTH * HEIGHT
    state = np.empty(n, np.uint64)
    s = 1
    for i in range(n):
        s = (s * 1664525 + 1013904223) % 2**32
        state[i] = s
    v = (np.float32(state >> np.uint64(8)) / np.float32(2**23) - np.float32(0.5)).astype(np.float32)
    v[::97] = np.nan
    v[5::101] = np.inf
    v[7::103] = -np.inf
    return v.reshape(HEIGHT, WIDTH)


def fnv(values):
    """FNV-1a over whole numbers, as text: JSON has no 64 bits."""
    h = 0xCBF29CE484222325
    for v in values.ravel():
        h = ((h ^ int(v)) * 0x100000001B3) % 2**64
    return f"{h:016x}"


def natural():
    pixels = OpenEXR.File(str(HERE / "../data/workshop.exr")).channels()["RGB"].pixels
    return pixels[..., 1].astype(np.float32)


IMAGES = {"noise": noise(), "constant": np.full((HEIGHT, WIDTH), 0.25, np.float32), "natural": natural()}


def histograms():
    for name, image in IMAGES.items():
        finite = image[np.isfinite(image)]
        for bins, low, high in [(2, 0, 1), (256, 0, 1), (1000, 0, 1), (777, -0.25, 1.75), (4096, 0, 1), (5000, 0.1, 0.7), (65536, 0, 1)]:
            low, high = float(np.float32(low)), float(np.float32(high))
            for outside in ["Ignore", "Clamp"]:
                values = finite.astype(np.float64)
                if outside == "Clamp":
                    values = np.clip(values, low, high)
                counts, _ = np.histogram(values, bins, (low, high))
                yield {
                    "image": name, "bins": bins, "range": [low, high], "outside": outside,
                    "total": int(counts.sum()), "head": [int(c) for c in counts[:16]], "fnv": fnv(counts),
                }


def statistics():
    for name, image in IMAGES.items():
        v = image[np.isfinite(image)].astype(np.float64)
        p01, median, p99 = np.percentile(v, [1, 50, 99])
        yield {
            "image": name, "min": v.min(), "max": v.max(), "mean": v.mean(), "stddev": v.std(), "median": median, "p01": p01, "p99": p99,
            "nan_count": int(np.isnan(image).sum()), "inf_count": int(np.isinf(image).sum()),
            "geometric": float(np.exp(np.log(1e-6 + np.maximum(v, 0)).mean())),
        }


def sums():
    image = IMAGES["natural"].astype(np.float64)
    sat = image.cumsum(0).cumsum(1)
    yield from ([x, y, sat[y, x]] for y in (0, 1, 100, 255) for x in (0, 1, 63, 64, 300, 511))


def equalized():
    """H = floor((levels - 1) CDF(bin))/(levels - 1), with values beyond the range in the last bin."""
    image = IMAGES["natural"].astype(np.float64)
    bins = 256
    bin_of = np.clip(np.floor(image * bins), 0, bins - 1).astype(int)
    cdf = np.cumsum(np.bincount(bin_of.ravel(), minlength=bins))
    h = np.floor((bins - 1) * cdf[bin_of] / image.size) / (bins - 1)
    return fnv(np.round(h * 255))


if __name__ == "__main__":
    table = {"histograms": list(histograms()), "statistics": list(statistics()), "sums": list(sums()), "equalized": equalized()}
    (HERE / "analysis.json").write_text(json.dumps(table, indent=1) + "\n")
