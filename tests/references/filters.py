"""Expected values of the filters, made by SciPy, OpenCV, scikit-image and MedPy: writes filters.json beside this file.

    python3 -m venv venv && venv/bin/pip install numpy scipy opencv-python-headless scikit-image medpy
    venv/bin/python tests/references/filters.py

Versions that made the committed file: numpy 2.4.6, scipy 1.17.1, opencv 5.0.0, scikit-image 0.26.0, medpy 0.5.2.

A case is a node, a border policy, the values of one output at a few pixels, and how far off a result may be, as a share of
max(1, |value|). Where two libraries know the filter, both are asked and must agree.
"""

import json
import math
from pathlib import Path

import cv2
import numpy as np
from medpy.filter.smoothing import anisotropic_diffusion
from scipy import ndimage, stats
from skimage.filters import difference_of_gaussians
from skimage.morphology import disk

WIDTH, HEIGHT = 37, 29
# Corners, edges and the inside.
PIXELS = [(x, y) for y in (0, 1, 9, 14, 28) for x in (0, 2, 11, 18, 33, 36)]

SCIPY = {"Clamp": "nearest", "Mirror": "reflect", "Repeat": "wrap", "Black": "constant"}
OPENCV = {"Clamp": cv2.BORDER_REPLICATE, "Mirror": cv2.BORDER_REFLECT, "Repeat": cv2.BORDER_WRAP, "Black": cv2.BORDER_CONSTANT}
NUMPY = {"Clamp": "edge", "Mirror": "symmetric", "Repeat": "wrap", "Black": "constant"}


def plane(a, b, k, q):
    """A pattern of fractions that floats hold exactly, on a ramp; the tests make the same."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return ((a * x + b * y + k * x * y + q * x * x) % 32) / 32 + (x + 2 * y) / 64


GREY = plane(7, 13, 5, 3)
GREY[10, 12] += 6
COLOUR = np.dstack([plane(3, 5, 1, 0), plane(11, 2, 3, 1), plane(1, 9, 7, 5), plane(5, 5, 0, 0) / 4])

cases = []


def case(node, border, values, within=1e-5, port="out"):
    values = np.asarray(values, dtype=np.float64)
    assert values.shape[:2] == (HEIGHT, WIDTH), node
    picked = [values[y, x].tolist() for x, y in PIXELS]
    flat = [v for p in picked for v in (p if isinstance(p, list) else [p])]
    cases.append({"node": node, "border": border, "port": port, "within": within, "values": [float(f"{v:.9g}") for v in flat]})


def agree(a, b, within=2e-6):
    assert np.allclose(a, b, rtol=within, atol=within), np.abs(a - b).max()
    return a


def gauss(image, sigma, border, radius=None, axes=(0, 1)):
    """Both axes by their own σ, cut at ceil(3σ) unless said."""
    sigmas = sigma if isinstance(sigma, tuple) else (sigma, sigma)
    for axis in axes:
        s = sigmas[1 - axis]
        if s > 0:
            r = math.ceil(3 * s) if radius is None else radius
            image = ndimage.gaussian_filter1d(image, s, axis=axis, mode=SCIPY[border], radius=r)
    return image


def unbounded(image, sigma, border):
    """The Gaussian itself, as far as it matters."""
    return gauss(image, sigma, border, radius=math.ceil(8 * sigma))


def one_dimensional():
    for border in SCIPY:
        case('BlurH(image: "grey", sigma: 1.5)', border, gauss(GREY, 1.5, border, axes=(1,)))
        case('BlurV(image: "grey", sigma: 1.5)', border, gauss(GREY, 1.5, border, axes=(0,)))
    case('BlurH(image: "grey", sigma: 6)', "Clamp", gauss(GREY, 6, "Clamp", axes=(1,)))
    case('BlurV(image: "grey", sigma: 4, radius: 5)', "Clamp", gauss(GREY, 4, "Clamp", radius=5, axes=(0,)))
    weights = [0.125, 0.5, 0.25, -0.25, 0.75]
    for node, axis in ("BlurH", 1), ("BlurV", 0):
        case(f'{node}(image: "grey", weights: {weights})', "Repeat", ndimage.convolve1d(GREY, weights, axis=axis, mode="wrap"))


def gaussian():
    for border in SCIPY:
        expected = gauss(GREY, 2, border)
        if border != "Repeat":  # OpenCV's Gaussian knows no periodic border.
            agree(expected, cv2.GaussianBlur(GREY, (13, 13), 2, borderType=OPENCV[border]))
        case('GaussianBlur(image: "grey", sigma: 2, method: Separable)', border, expected)
        for method in "Recursive", "Pyramid":
            for sigma in 5, 20:
                wide = unbounded(GREY, sigma, border)
                # 1e-3 of the range, which is 8.5.
                case(f'GaussianBlur(image: "grey", sigma: {sigma}, method: {method})', border, wide, within=8.5e-3)
    case('GaussianBlur(image: "grey", sigma: (4, 1.25))', "Clamp", gauss(GREY, (4, 1.25), "Clamp"))
    colour = np.dstack([gauss(COLOUR[..., c], 2.5, "Mirror") for c in range(4)])
    case('GaussianBlur(image: "colour", sigma: 2.5)', "Mirror", colour)


def importance(image, sigma, samples):
    """Means of linearly interpolated shifts; SciPy shifts the other way, and the samples are symmetric."""
    for axis in 0, 1:
        offsets = sigma * stats.norm.ppf((2 * np.arange(1, samples + 1) - 1) / (2 * samples))
        shift = lambda o: ndimage.shift(image, (o, 0) if axis == 0 else (0, o), order=1, mode="nearest")
        image = np.mean([shift(o) for o in offsets], axis=0)
    return image


def sampled():
    case('GaussianImportance(image: "grey")', "Clamp", importance(GREY, 2, 5))
    case('GaussianImportance(image: "grey", sigma: 3.5, samples: 12)', "Clamp", importance(GREY, 3.5, 12))
    case('GaussianBlur(image: "grey", sigma: 2, method: Importance(samples: 9))', "Clamp", importance(GREY, 2, 9))


def kernels():
    kernel = np.array([[1, 2, 3, 0, -1], [0, 4, 1, 2, 0], [2, 0, 0, 1, 5]], dtype=np.float64)
    for border in SCIPY:
        expected = ndimage.convolve(GREY, kernel / kernel.sum(), mode=SCIPY[border])
        if border != "Repeat":
            agree(expected, cv2.filter2D(GREY, -1, kernel[::-1, ::-1] / kernel.sum(), borderType=OPENCV[border]))
        case(f'Convolve(image: "grey", kernel: {kernel.astype(int).tolist()})', border, expected)
    for border in SCIPY:
        mean = ndimage.uniform_filter(GREY, 9, mode=SCIPY[border])
        if border != "Repeat":
            agree(mean, cv2.blur(GREY, (9, 9), borderType=OPENCV[border]))
        case('BoxBlur(image: "grey", radius: 4)', border, mean)
    case('BoxBlur(image: "grey", radius: 25)', "Clamp", ndimage.uniform_filter(GREY, 51, mode="nearest"))


def derivatives():
    for border in SCIPY:
        gx, gy = (ndimage.sobel(GREY, axis=axis, mode=SCIPY[border]) for axis in (1, 0))
        for port, values in ("gx", gx), ("gy", gy), ("out", np.hypot(gx, gy)):
            case('Sobel(image: "grey")', border, values, port=port)
        laplacian = ndimage.laplace(GREY, mode=SCIPY[border])
        if border != "Repeat":
            agree(gx, cv2.Sobel(GREY, cv2.CV_64F, 1, 0, borderType=OPENCV[border]))
            agree(laplacian, cv2.Laplacian(GREY, cv2.CV_64F, ksize=1, borderType=OPENCV[border]))
        case('Laplacian(image: "grey")', border, laplacian)
        case(
            'DifferenceOfGaussians(image: "grey", sigma1: 1, sigma2: 2)',
            border,
            difference_of_gaussians(GREY, 1, 2, mode=SCIPY[border], truncate=3),
        )


def order():
    for radius in 1, 2, 3:
        for border in SCIPY:
            case(
                f'Median(image: "grey", radius: {radius})',
                border,
                ndimage.median_filter(GREY, 2 * radius + 1, mode=SCIPY[border]),
                within=0,
            )
    small = GREY.astype(np.float32)
    assert np.array_equal(cv2.medianBlur(small, 5), ndimage.median_filter(small, 5, mode="nearest"))
    shapes = {"Square": lambda r: np.ones((2 * r + 1, 2 * r + 1)), "Disk": disk}
    operations = {
        "Dilate": ndimage.grey_dilation,
        "Erode": ndimage.grey_erosion,
        "Open": ndimage.grey_opening,
        "Close": ndimage.grey_closing,
    }
    borders = list(SCIPY)
    for i, (node, operation) in enumerate(operations.items()):
        for j, (shape, footprint) in enumerate(shapes.items()):
            for k, radius in enumerate((1, 6, 11)):
                border = borders[(i + j + k) % 4]
                values = operation(GREY, footprint=footprint(radius), mode=SCIPY[border])
                case(f'{node}(image: "grey", radius: {radius}, shape: {shape})', border, values, within=0)


def bilateral(image, sigma_space, sigma_range, border, opencv=False):
    """Tomasi and Manduchi over a square by the Euclidean distance; OpenCV takes a disk and the sum of the differences."""
    radius = math.ceil(3 * sigma_space)
    padded = np.pad(image, [(radius, radius), (radius, radius), (0, 0)], mode=NUMPY[border])
    total, weights = np.zeros_like(image), np.zeros(image.shape[:2] + (1,))
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            if opencv and math.hypot(dx, dy) > radius:
                continue
            there = padded[radius + dy : radius + dy + HEIGHT, radius + dx : radius + dx + WIDTH]
            difference = np.abs(there - image)
            far = difference.sum(-1) ** 2 if opencv else (difference**2).sum(-1)
            weight = np.exp(-(dx * dx + dy * dy) / (2 * sigma_space**2) - far / (2 * sigma_range**2))[..., None]
            total += weight * there
            weights += weight
    return total / weights


def edge_aware():
    opaque = np.dstack([COLOUR[..., :3], np.ones((HEIGHT, WIDTH))])
    # scikit-image 0.26 shifts its window by half a pixel and cannot serve.
    theirs = cv2.bilateralFilter(opaque[..., :3].astype(np.float32), 11, 0.7, 1.5, borderType=cv2.BORDER_REPLICATE)
    agree(bilateral(opaque[..., :3], 1.5, 0.7, "Clamp", opencv=True), theirs, within=1e-3)
    for border in SCIPY:
        values = bilateral(GREY[..., None], 1.5, 0.4, border)[..., 0]
        case('Bilateral(image: "grey", sigma_space: 1.5, sigma_range: 0.4)', border, values)
    for border in "Clamp", "Mirror":
        # Of an opaque picture: alpha stays 1.
        rgb = bilateral(opaque[..., :3], 1.5, 0.7, border)
        case('Bilateral(image: "opaque", sigma_space: 1.5, sigma_range: 0.7)', border, np.dstack([rgb, opaque[..., 3]]))
    guide = COLOUR[..., :3] @ [0.2126, 0.7152, 0.0722]
    for radius, eps in (8, 1e-3), (3, 0.05):
        for border in SCIPY:
            case(f'Guided(image: "grey", guide: "colour", radius: {radius}, eps: {eps})', border, guided(GREY, guide, radius, eps, border))
    case('Guided(image: "grey")', "Clamp", guided(GREY, GREY, 8, 1e-3, "Clamp"))
    diffused = anisotropic_diffusion(GREY, niter=20, kappa=0.1, gamma=0.2, option=2)
    case('AnisotropicDiffusion(image: "grey")', "Clamp", diffused)
    diffused = anisotropic_diffusion(GREY, niter=5, kappa=0.7, gamma=0.15, option=2)
    case('AnisotropicDiffusion(image: "grey", iterations: 5, kappa: 0.7, dt: 0.15)', "Clamp", diffused)


def guided(image, guide, radius, eps, border):
    """The authors' guidedfilter.m, with the border policy in place of their smaller windows at the edges."""
    mean = lambda v: ndimage.uniform_filter(v, 2 * radius + 1, mode=SCIPY[border])
    mean_i, mean_p = mean(guide), mean(image)
    slope = (mean(guide * image) - mean_i * mean_p) / (mean(guide * guide) - mean_i * mean_i + eps)
    return mean(slope) * guide + mean(mean_p - slope * mean_i)


def light():
    bright = gauss(np.maximum(GREY - 1.25, 0), 3, "Clamp")
    case('Bloom(image: "grey", threshold: 1.25, sigma: 3, intensity: 0.4)', "Clamp", GREY + 0.4 * bright)
    detail = GREY - gauss(GREY, 2, "Mirror")
    case('UnsharpMask(image: "grey")', "Mirror", GREY + detail)
    sharp = np.where(np.abs(detail) > 0.25, GREY + 0.75 * detail, GREY)
    case('UnsharpMask(image: "grey", amount: 0.75, threshold: 0.25)', "Mirror", sharp)


for section in one_dimensional, gaussian, sampled, kernels, derivatives, order, edge_aware, light:
    section()
lines = ",\n".join(json.dumps(c) for c in cases)
Path(__file__).with_suffix(".json").write_text(f'{{"size": [{WIDTH}, {HEIGHT}], "pixels": {json.dumps(PIXELS)}, "cases": [\n{lines}\n]}}\n')
print(len(cases), "cases")
