"""The detectors side by side: their range, their packages, their memory and style."""

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from pegpose_lab import fit_discs
from pegpose_lab.bench import bounds, detectors, peers, resources, score
from pegpose_lab.lab import environment, plotting
from pegpose_lab.tests.pictures import draw_ellipses, to_uint8


def _small_picture():
    picture = draw_ellipses((150, 220), [(70.3, 74.8, 45, 45, 0), (170, 74, 20, 20, 0)])
    return to_uint8(picture, 1, 0)


@pytest.mark.parametrize("name", peers.COMPARED)
def test_methods_keep_to_the_range_and_bear_empty_pictures(name):
    method = peers.COMPARED[name]
    if peers.missing(method):
        pytest.skip(peers.missing(method))
    found, _ = peers.run(method, _small_picture(), (40, 60))
    assert len(found) == 1
    assert_allclose(found.centers[0], [70.3, 74.8], atol=1.5)
    assert_allclose(found.radii[0], 45, atol=1.5)
    assert len(peers.run(method, np.full((150, 220), 60, np.uint8), (40, 60))[0]) == 0


def test_radius_sigma_is_first_order_in_the_axes():
    discs = fit_discs(_small_picture(), SimpleNamespace(centers=[[70.0, 75.0], [10.0, 10.0]], radii=[44.0, 40.0]))
    draws = np.random.default_rng(0).multivariate_normal(discs.semi_axes[0], discs.covariance[0, 2:4, 2:4], 50_000)
    sigmas = detectors.radius_sigmas(discs)
    assert_allclose(sigmas[0], np.sqrt(draws.prod(axis=1)).std(), rtol=0.02)
    assert np.isinf(sigmas[1])


def test_missing_packages_are_named(monkeypatch, tmp_path):
    monkeypatch.setattr(environment, "VENV", tmp_path)
    method = peers.COMPARED["EdgeDrawing"]
    assert peers.missing(method) == "opencv-contrib-python-headless is not installed"
    assert peers.version(method) == ""
    monkeypatch.setattr(peers.importlib.util, "find_spec", lambda _: None)
    assert "scikit-image" in peers.missing(peers.COMPARED["skimage hough_circle"])
    names = ("EdgeDrawing", "skimage hough_circle")
    assert resources.describe_methods(names, names)["missing"][0] == peers.missing(method)
    assert score._methods_for(names, 0, 10) == []


def test_every_detector_has_a_style_of_its_own():
    assert set(plotting.DETECTORS) == set(peers.COMPARED)
    assert len(set(plotting.DETECTORS.values())) == len(peers.COMPARED)


# ---- measuring ----


def test_threads_of_opencv_are_given_back():
    before = bounds.cv2.getNumThreads()
    with pytest.raises(ZeroDivisionError), score.one_thread():
        assert bounds.cv2.getNumThreads() == 1
        raise ZeroDivisionError
    assert bounds.cv2.getNumThreads() == before


def test_memory_is_that_of_the_call(tmp_path):
    """A method that makes an array of 160 MB from a picture of 20 MB, which is there before."""
    np.save(tmp_path / "frame.npy", np.zeros((4000, 5000), np.uint8))
    code = (
        "import sys, numpy as np; from pegpose_lab.bench import detectors, peers, resources; "
        "peers.COMPARED['x'] = detectors.Method('x', lambda image, _: np.ones(image.size).sum(), ''); "
        "resources.tell_memory('x', sys.argv[1])"
    )
    command = [sys.executable, "-c", code, tmp_path / "frame.npy"]
    told = float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert 140 < told < 175


def test_growth_is_the_exponent():
    sizes = np.array([0.5, 2.0, 8.0])
    table = pd.DataFrame({"megapixels": sizes, "method": peers.OURS, "ms": 7 * sizes**1.3})
    assert_allclose(resources.growth(table), 1.3)
