"""Pictures of blurred discs with exact truth, and random ones for hypothesis, drawn without the package."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr


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


# How a picture is turned, and where a place in the turned one lies in the picture of a shape.
TURNS = {
    "flipped": (lambda image: image[:, ::-1], lambda x, y, shape: (shape[1] - 1 - x, y)),
    "upside down": (lambda image: image[::-1], lambda x, y, shape: (x, shape[0] - 1 - y)),
    "transposed": (lambda image: image.T, lambda x, y, shape: (y, x)),
}


# ------------------------------------------------------------------------------------------- random pictures


@dataclass(frozen=True)
class Scene:
    """A random picture, uint8 or bool, its discs as rows x, y, r (of equal area), and the polarity of most."""

    image: np.ndarray
    discs: np.ndarray
    polarity: str


ARRANGEMENTS = ("apart", "touching", "concentric", "at the border", "anywhere")
LAYOUTS = {
    "plain": lambda image: image,
    "by columns": np.asfortranarray,
    "every other": lambda image: np.repeat(np.repeat(image, 2, axis=0), 3, axis=1)[::2, ::3],
    "reversed": lambda image: image[::-1, ::-1].copy()[::-1, ::-1],
}
SEEDS = st.integers(0, 2**24 - 1)  # of all numbers: hypothesis itself draws them slowly, and at the limits most


def scenes(masks=0):
    """Pictures of 0 to 4 discs, 1 x 1 to 160 x 160 px; some constant or nothing but noise, `masks` of ten bool."""
    return st.builds(
        random_scene,
        SEEDS,
        kind=st.sampled_from(("constant", "noise") + 10 * ("discs",)),
        arrangement=st.sampled_from((*ARRANGEMENTS, "apart", "concentric")),
        number=st.sampled_from((1, 2, 3, 4, 1, 2, 3, 4, 1, 2, 0)),
        polarity=st.sampled_from(("bright", "dark")),
        layout=st.sampled_from(sorted(LAYOUTS)),
        mask=st.sampled_from(masks * (True,) + (10 - masks) * (False,)),
    )


def random_scene(seed, kind, arrangement, number, polarity, layout, mask):
    """The `Scene` of a seed; the image cannot be written to."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 48, 2) if rng.random() < 0.1 else rng.integers(48, 161, 2))
    ellipses, background = np.empty((0, 5)), rng.uniform(0, 120)
    if kind == "discs":
        ellipses = _random_ellipses(rng, shape, arrangement, number)
    steps = rng.uniform(15, 180) * rng.uniform(0.4, 1, len(ellipses))
    steps = np.cumsum(steps) / 2 if arrangement == "concentric" else steps
    levels = background + np.where(rng.random(len(ellipses)) < 0.15, -0.7, 1) * steps
    blur = rng.choice([0.0, *rng.uniform(0.3, 2.5, 5)])
    picture = draw_quickly(shape, ellipses, background, levels, blur)
    picture = picture if polarity == "bright" else 255 - picture
    image = picture > np.mean([picture.min(), picture.max()]) if mask else _spoilt(rng, picture, kind)
    image = LAYOUTS[layout](image)
    image.setflags(write=False)
    return Scene(image, np.column_stack([ellipses[:, :2], np.sqrt(ellipses[:, 2] * ellipses[:, 3])]), polarity)


def draw_quickly(shape, ellipses, background, levels, blur):
    """As `draw_ellipses`, but each pixel by its distance to the edge to first order."""
    y, x = np.indices(shape)
    picture, s = np.full(shape, background, float), np.sqrt(blur**2 + 1 / 12)
    for (cx, cy, a, b, angle), level in zip(ellipses, levels, strict=True):
        dx, dy, cos, sin = x - cx, y - cy, np.cos(angle), np.sin(angle)
        norm = np.hypot((dx * cos + dy * sin) / a, (dy * cos - dx * sin) / b)
        picture += ndtr((1 - norm) * (np.sqrt(a * b) / s)) * (level - picture)
    return picture


def _random_ellipses(rng, shape, arrangement, number):
    """Rows cx, cy, a, b, angle of `number` discs, half of them round."""
    size, sides = min(shape), np.array(shape[::-1])
    center, radius, circles = rng.uniform(0.3, 0.7, 2) * sides, rng.uniform(0.08, 0.3) * size, []
    cells = rng.permutation(4)[:number]
    for i, cell in enumerate(cells):
        if arrangement == "apart":
            center, radius = (0.25 + 0.5 * np.array([cell % 2, cell // 2])) * sides, rng.uniform(0.06, 0.21) * size
        elif arrangement == "touching" and i > 0:
            before, radius, turn = radius, radius * rng.uniform(0.6, 1.4), rng.uniform(0, 2 * np.pi)
            center = center + (before + radius) * np.array([np.cos(turn), np.sin(turn)])
        elif arrangement == "concentric" and i > 0:
            radius *= rng.uniform(0.4, 0.85)
        elif arrangement == "at the border":
            center, radius = rng.random(2) * sides, rng.uniform(0.06, 0.3) * size
            axis, inside = rng.integers(0, 2), rng.uniform(-0.1, 1.4) * radius
            center[axis] = rng.choice([inside, sides[axis] - inside])
        elif arrangement == "anywhere":
            center, radius = rng.uniform(-0.1, 1.1, 2) * sides, rng.uniform(0.03, rng.choice([0.3, 0.7])) * size
        circles.append((*center, radius))
    x, y, r = np.array(circles).reshape(-1, 3).T
    stretch = np.where(rng.random(len(r)) < 0.5, 1.0, rng.uniform(0.8, 1, len(r)))
    return np.column_stack([x - 0.5, y - 0.5, r / stretch**0.5, r * stretch**0.5, rng.uniform(-1.5, 1.5, len(r))])


def _spoilt(rng, picture, kind):
    """The picture as uint8; at times in uneven light, too light or too dark, with noise, or salt and pepper."""
    if kind == "constant":
        return to_uint8(picture)
    if rng.random() < 0.3:
        picture = picture + rng.uniform(-40, 40) * np.linspace(-1, 1, picture.shape[1])
    if rng.random() < 0.2:
        picture = picture * rng.uniform(0.5, 2) + rng.uniform(-60, 60)
    noise = rng.uniform(0.5, 10) if kind == "noise" or rng.random() < 0.8 else 0.0
    image = to_uint8(picture, noise, rng)
    if rng.random() < 0.2:
        dots = rng.random(image.shape) < rng.uniform(0, 0.05)
        image[dots] = rng.choice([0, 255], dots.sum())
    return image
