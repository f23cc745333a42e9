"""The three Hough transforms against literal loops."""

import cv2
import numpy as np
import pytest
from scipy import ndimage

from pegpose_lab.circles import circle_accumulator
from pegpose_lab.circles import votes as votes_file
from pegpose_lab.circles.edges import _Gradient
from pegpose_lab.circles.peaks import _regional_peaks
from pegpose_lab.tests.circles.searches import RANGE, _picture


def _edges(image, threshold):
    """Edge pixels with G > t max(G), Sobel with replicated border."""
    dx = ndimage.sobel(image.astype(float), axis=1, mode="nearest")
    dy = ndimage.sobel(image.astype(float), axis=0, mode="nearest")
    magnitude = np.hypot(dx, dy)
    return [(x, y, dx[y, x], dy[y, x]) for y, x in np.argwhere(magnitude > threshold * magnitude.max())]


def _votes_by_loop(image, r_min, r_max, sign, threshold, phase):
    """One vote per edge pixel and half-pixel radius, along the gradient or against it."""
    votes = np.zeros(image.shape, complex)
    for x, y, gx, gy in _edges(image, threshold):
        r = r_min
        while r <= r_max:
            column = round(float(np.float32(x + sign * r * gx / np.hypot(gx, gy))))
            row = round(float(np.float32(y + sign * r * gy / np.hypot(gx, gy))))
            if 0 <= column < image.shape[1] and 0 <= row < image.shape[0]:
                angle = 2 * np.pi * np.log(r / r_min) / np.log(r_max / r_min) if phase else 0.0
                votes[row, column] += np.exp(1j * angle) / (2 * np.pi * r)
            r += 0.5
    return votes


def _circles_by_loop(edges, radii):
    """'A circle is drawn for each edge point with a radius r' (Sect. 3.1)."""
    height, width = edges.shape
    volume = np.zeros((len(radii), height, width))
    for plane, r in zip(volume, radii, strict=True):
        for y, x in np.argwhere(edges):
            for b in range(max(y - r - 1, 0), min(y + r + 2, height)):
                for a in range(max(x - r - 1, 0), min(x + r + 2, width)):
                    if round(np.hypot(a - x, b - y)) == r:
                        plane[b, a] += 1 / (2 * np.pi * r)
    return volume


def _maxima_by_reconstruction(surface, h):
    """h-maxima by reconstruction, 8-connected regional maxima, weighted centroids."""
    marker, square = surface - h, np.ones((3, 3))
    while True:
        grown = np.minimum(ndimage.grey_dilation(marker, footprint=square, mode="nearest"), surface)
        if (grown == marker).all():
            break
        marker = grown
    peaks, marker = [], np.round(marker, 9)
    # a plateau is a regional maximum if no neighbour of it is higher
    for value in np.unique(marker):
        plateaus, n = ndimage.label(marker == value, square)
        for k in range(1, n + 1):
            inside = plateaus == k
            border = ndimage.binary_dilation(inside, square) & ~inside
            if not (marker[border] > value).any() and surface[inside].max() >= h:
                y, x = np.nonzero(inside)
                w = surface[inside]
                peaks.append((w @ x / w.sum(), w @ y / w.sum(), w.max()))
    return sorted(peaks, key=lambda peak: -peak[2])


@pytest.mark.parametrize("polarity", ["bright", "dark"])
@pytest.mark.parametrize("method", ["two-stage", "phase-code"])
def test_votes_equal_the_literal_loop(method, polarity):
    image = _picture([(22.3, 20.8, 9.0)], (44, 48))
    fast = circle_accumulator(image, (6, 12), method=method, polarity=polarity, edge_threshold=0.3)
    slow = _votes_by_loop(image, 6, 12, 1 if polarity == "bright" else -1, 0.3, method == "phase-code")
    assert fast.shape == image.shape and np.iscomplexobj(fast) == (method == "phase-code")
    # a vote within rounding error of a pixel's border may fall on either side
    assert np.abs(fast - slow).sum() < 1e-3 * np.abs(slow).sum()


def test_gradient_is_correctly_rounded_wherever_it_lies_in_memory():
    image = np.random.default_rng(0).integers(0, 256, (61, 83), np.uint8)
    for offset in (0, 4, 16):
        buffer = np.empty(image.nbytes + offset, np.uint8)
        moved = buffer[offset:].reshape(image.shape)
        moved[...] = image
        gradient = _Gradient(moved)
        exact = np.hypot(gradient.dx.astype(np.longdouble), gradient.dy.astype(np.longdouble))
        np.testing.assert_array_equal(gradient.magnitude, exact.astype(np.float32))


def test_votes_do_not_depend_on_the_chunks(monkeypatch):
    image = _picture()
    whole = circle_accumulator(image, RANGE)
    monkeypatch.setattr(votes_file, "CHUNK", 1)
    np.testing.assert_allclose(circle_accumulator(image, RANGE), whole, rtol=1e-12, atol=1e-15)


def test_volume_equals_the_literal_loop():
    image = _picture([(20.3, 18.8, 8.0)], (36, 40))
    dx, dy = (cv2.Sobel(image, cv2.CV_16S, *d, borderType=cv2.BORDER_REPLICATE) for d in ((1, 0), (0, 1)))
    limit = 0.4 * np.hypot(dx.astype(float), dy).max()
    edges = (cv2.Canny(dx, dy, limit, limit, L2gradient=True) > 0) & (np.hypot(dx.astype(float), dy) > limit)
    fast = circle_accumulator(image, (5.5, 10), method="accumulator", edge_threshold=0.4)
    assert edges.any() and fast.shape == (5, *image.shape)
    np.testing.assert_allclose(fast, _circles_by_loop(edges, range(6, 11)), atol=1e-6)


@pytest.mark.parametrize("h", [0.05, 0.2, 0.5])
def test_peaks_equal_h_maxima_by_reconstruction(h):
    rng = np.random.default_rng(1)
    surface = ndimage.gaussian_filter(rng.random((60, 50)), 2)
    surface = ((surface - surface.min()) / np.ptp(surface)).astype(np.float32)
    fast = _regional_peaks(surface, h)
    slow = _maxima_by_reconstruction(surface.astype(float), np.float32(h).astype(float))
    assert len(fast) == len(slow) > 0
    np.testing.assert_allclose(fast, slow, atol=1e-4)
