"""Rings in photographs: the right ring, complete, and labels that hold from frame to frame."""

import cv2
import numpy as np
import pytest

from pegpose_lab.pegs import locate_pegs
from pegpose_lab.study import real_rings

NAMES = ("tire_hub", "sprocket", "dial_phone", "numpad_oblique", "motor_b", "rim_lot")


@pytest.mark.parametrize("name", NAMES)
def test_the_right_ring_in_a_photograph(name, pegpose_data):
    ring = next(ring for ring in real_rings.marked_rings() if ring.name == name)
    picture = cv2.imread(str(pegpose_data / "rings-a" / f"{name}.png"), cv2.IMREAD_GRAYSCALE)
    observation = locate_pegs(picture, ring.pattern, radius_range=ring.radius_range)
    apart = np.linalg.norm(ring.marks[:, None, :2] - observation.peg_centers, axis=2)
    assert (apart.min(axis=1) < real_rings.OFF * ring.marks[:, 2]).all() and "missing" not in observation.states


@pytest.mark.parametrize("run", [(60, 76), (200, 216)])
def test_a_run_of_frames_keeps_its_labels(run, pegpose_data):
    centers, bores, previous = [], [], None
    for number in range(*run):
        path = pegpose_data / "visp-mire2-b" / f"image.{number:04d}.png"
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        previous = locate_pegs(picture, real_rings.RIGID, radius_range=real_rings.RIGID_RADII, previous=previous)
        centers.append(previous.peg_centers)
        bores.append(previous.bore_center)
    centers = np.array(centers)
    assert np.linalg.norm(np.diff(centers, axis=0), axis=2).max() < 20  # half the way between two discs is 30
    noise = np.diff(centers - centers.mean(axis=1, keepdims=True), 4, axis=0) / np.sqrt(70)
    assert 1.4826 * np.median(np.abs(noise)) < 0.035
    off = np.array([real_rings._crossing(four) for four in centers]) - bores
    assert off.std(axis=0).max() < 0.07


def test_single_frames_of_another_run(pegpose_data):
    for path in sorted((pegpose_data / "visp-mire2-a").glob("*.png")):
        observation = locate_pegs(
            cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), real_rings.RIGID, radius_range=real_rings.RIGID_RADII
        )
        assert set(observation.states) == {"measured"} and np.isfinite(observation.bore_sigma).all()
