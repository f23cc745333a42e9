"""Pictures of blurred discs with exact truth, drawn without any part of the package."""

import numpy as np
from scipy.ndimage import gaussian_filter


def draw_ellipses(shape, ellipses, *, background=60.0, level=160.0, blur=0.9, oversample=4, patch=12):
    """Return a float picture of filled ellipses (cx, cy, a, b, angle), supersampled, then blurred.

    The blur's `oversample`-fold picture is averaged over each pixel, so the total edge variance is
    blur^2 + 1/12.  `level` is one value or one per ellipse.
    """
    picture = np.full(shape, float(background))
    for (cx, cy, a, b, angle), value in zip(ellipses, np.broadcast_to(level, len(ellipses)), strict=True):
        reach = int(np.ceil(a)) + patch
        x0, y0 = int(round(cx)) - reach, int(round(cy)) - reach
        share = _coverage(2 * reach + 1, (cx - x0, cy - y0), a, b, angle, blur, oversample)
        rows = slice(max(y0, 0), min(y0 + 2 * reach + 1, shape[0]))
        columns = slice(max(x0, 0), min(x0 + 2 * reach + 1, shape[1]))
        share = share[rows.start - y0 : rows.stop - y0, columns.start - x0 : columns.stop - x0]
        picture[rows, columns] += share * (value - picture[rows, columns])
    return picture


def _coverage(size, center, a, b, angle, blur, oversample):
    """Share of each pixel of a size x size patch that the blurred ellipse covers."""
    fine = (np.arange(size * oversample) + 0.5) / oversample - 0.5
    x, y = np.meshgrid(fine - center[0], fine - center[1])
    along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    norm = np.hypot(along / a, across / b)
    slope = np.hypot(along / a**2, across / b**2) / np.maximum(norm, 1e-12)
    inside = np.clip((1 - norm) / np.maximum(slope, 1e-12) * oversample + 0.5, 0, 1)
    inside = gaussian_filter(inside, blur * oversample, mode="nearest") if blur > 0 else inside
    return inside.reshape(size, oversample, size, oversample).mean(axis=(1, 3))


def to_uint8(picture, noise=0.0, rng=None):
    """Return `picture` with Gaussian noise, rounded and clipped to 8 bits."""
    noisy = picture + noise * np.random.default_rng(rng).standard_normal(picture.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def center_bound(radius, contrast, blur, noise):
    """Cramer-Rao bound of a disc centre per axis, px: (sigma/A) sqrt(2 s/(sqrt(pi) r))."""
    sigma, edge = np.sqrt(noise**2 + 1 / 12), np.sqrt(blur**2 + 1 / 12)
    return sigma / contrast * np.sqrt(2 * edge / (np.sqrt(np.pi) * radius))
