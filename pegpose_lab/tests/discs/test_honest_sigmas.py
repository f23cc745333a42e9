"""Errors are as large as the stated sigmas where noise is not white, where edges are wide, and where discs are small."""

import cv2
import numpy as np
import pytest

from pegpose_lab.discs import correlation, fit_discs, spectrum
from pegpose_lab.tests.discs.stacks import _circles
from pegpose_lab.tests.pictures import draw_ellipses

NOISE, CONTRAST = 4.0, 100.0


def _smoothed(image, rng):
    noise = cv2.GaussianBlur(rng.normal(size=image.shape), (0, 0), 1.0)
    return image + NOISE * noise / noise.std()


def _compressed(image, rng):
    noisy = _eight_bits(image + rng.normal(0, NOISE, image.shape))
    return cv2.imdecode(cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, 70])[1], cv2.IMREAD_GRAYSCALE)


def _demosaiced(image, rng):
    raw = _eight_bits(image + rng.normal(0, NOISE, image.shape))
    return cv2.cvtColor(cv2.demosaicing(raw, cv2.COLOR_BayerBG2BGR), cv2.COLOR_BGR2GRAY)


def _white(image, rng):
    return image + rng.normal(0, NOISE, image.shape)


def _eight_bits(image):
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _measured(radius, process, *, pictures, blur=0.9):
    """The fits of nine discs in each of some pictures, and their true centres."""
    rng, pitch = np.random.default_rng(3), max(4 * radius, 30)
    grid = pitch * np.stack(np.mgrid[:3, :3], axis=-1).reshape(9, 2) + 0.7 * pitch
    for _ in range(pictures):
        centers, ratio = grid + rng.uniform(-0.5, 0.5, (9, 2)), np.sqrt(rng.uniform(1, 1.3))
        axes = np.tile([radius * ratio, radius / ratio], (9, 1))
        ellipses = np.column_stack([centers, axes, rng.uniform(-1.5, 1.5, 9)])
        clean = draw_ellipses((int(3.4 * pitch),) * 2, ellipses, background=60.0, level=60.0 + CONTRAST, blur=blur)
        starts = _circles(centers + radius * rng.uniform(-0.05, 0.05, (9, 2)), np.full(9, 1.03 * radius))
        yield fit_discs(_eight_bits(process(clean, rng)), starts), centers


def _pulls(radius, process, **options):
    parts = [(discs, centers) for discs, centers in _measured(radius, process, **options)]
    assert all((discs.states == "measured").all() for discs, _ in parts)
    return np.concatenate([(discs.centers - centers) / discs.sigmas[:, :2] for discs, centers in parts])


@pytest.mark.parametrize("radius", [3, 4, 6, 9])
def test_small_discs_are_measured_with_honest_sigmas(radius):
    pulls = _pulls(radius, _white, pictures=15)
    assert 0.88 < np.sqrt((pulls**2).mean()) < 1.12


@pytest.mark.parametrize("process", [_smoothed, _compressed, _demosaiced])
@pytest.mark.parametrize("radius", [12, 40])
def test_sigmas_hold_where_neighbouring_pixels_err_together(process, radius, monkeypatch):
    pulls = _pulls(radius, process, pictures=12)
    assert 0.8 < np.sqrt((pulls**2).mean()) < 1.3
    monkeypatch.setattr(correlation, "_excess", lambda *_: np.ones(1))
    monkeypatch.setattr(correlation, "_autocorrelation", lambda *_: np.eye(13)[6][:, None] * np.eye(13)[6])
    assert np.sqrt((_pulls(radius, process, pictures=12) ** 2).mean()) > 1.3  # as if noise were white


@pytest.mark.parametrize("blur", [1.0, 2.0, 3.0, 4.5])
def test_wide_edges_are_measured_and_their_width_told(blur):
    for discs, centers in _measured(40, _white, pictures=2, blur=blur):
        assert discs.accepted.all() and np.abs(discs.blurs - np.hypot(blur, np.sqrt(1 / 12))).max() < 0.15
        assert np.abs((discs.centers - centers) / discs.sigmas[:, :2]).max() < 4.5


def test_white_displacements_have_no_excess_and_slow_ones_do():
    rng, k = np.random.default_rng(1), 48
    white = rng.normal(size=(2000, k))
    information = np.ones((2000, k))
    assert np.median(spectrum._excess(white, information)) == pytest.approx(0.87, abs=0.08)  # chi2 / 6 terms
    angles = 2 * np.pi / k * np.arange(k)
    slow = white + 2 * np.cos(3 * angles + rng.uniform(0, 6, (2000, 1)))
    assert spectrum._excess(slow, information).mean() > 10
    lost = white + 2 * np.cos(2 * angles)  # the fit's own frequencies say nothing
    np.testing.assert_allclose(spectrum._excess(lost, information), spectrum._excess(white, information), rtol=1e-9)


def test_a_disc_that_differs_little_from_a_texture_is_measured_in_part_only():
    usable = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        texture = cv2.GaussianBlur(rng.normal(size=(200, 200)), (0, 0), 3.0)
        image = draw_ellipses((200, 200), [[100.3, 99.6, 30.0, 30.0, 0.0]], background=100.0, level=110.0)
        image = image + 10 * texture / texture.std() + rng.normal(0, 1, image.shape)
        discs = fit_discs(_eight_bits(image), _circles([(100, 100)], [30]))
        assert not (discs.accepted & (np.abs(discs.contrasts) < 3 * discs.noises)).any()
        usable += discs.usable.sum()
        off = np.abs(discs.centers - (100.3, 99.6)) / discs.sigmas[:, :2]
        assert (off[discs.usable] < 5).all()
    assert usable >= 6


def test_a_middle_is_never_below_that_of_white_noise():
    rng = np.random.default_rng(2)
    factor = rng.normal(size=(8, 8))
    least, matrix = factor @ factor.T, rng.normal(size=(8, 8))
    more = correlation._at_least(matrix + matrix.T, least) - least
    assert np.linalg.eigvalsh((more + more.T) / 2).min() > -1e-6
    np.testing.assert_allclose(correlation._at_least(5 * least, least), 5 * least, rtol=1e-6)
