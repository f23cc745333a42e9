"""Rings in photographs: the right ring, complete, and labels that hold from frame to frame."""

import json

import cv2
import numpy as np
import pytest

from pegpose_lab.patterns import RingPattern
from pegpose_lab.pegs import locate_pegs

NAMES = ("tire_hub", "sprocket", "dial_phone", "numpad_oblique", "motor_b", "rim_lot")
TARGET = RingPattern(centers=[[-59.5, -50], [59.5, -50], [59.5, 50], [-59.5, 50]], disc_radius=8.0, bore=30.0)


def pattern_of(entry):
    """The pattern of a marked photograph; where places of the circle are left out, the order of the marks gives the sense."""
    centers, n = np.array(entry["centers"]), entry["n"]
    kind = {"mixed": "either"}.get(entry["polarity"], entry["polarity"])
    radius = float(np.mean(entry["radii"]))
    if len(centers) == n:
        pitch = float(np.linalg.norm(centers - centers.mean(axis=0), axis=1).mean())
        return RingPattern(n, pitch_radius=pitch, disc_radius=radius, polarity=kind)
    z = centers @ (1, 1j)
    sense = np.sign(np.median(((z[2:] - z[1:-1]) / (z[1:-1] - z[:-2])).imag))
    pitch = float(np.median(np.abs(np.diff(z)))) / 2 / np.sin(np.pi / n)
    angles = sense * np.arange(len(centers)) * 2 * np.pi / n
    return RingPattern(angles=angles, pitch_radius=pitch, disc_radius=radius, polarity=kind)


@pytest.mark.parametrize("name", NAMES)
def test_the_right_ring_in_a_photograph(name, pegpose_data):
    folder = pegpose_data / "rings-a"
    (entry,) = [one for one in json.loads((folder / "reference.json").read_text()) if one["name"] == name]
    picture = cv2.imread(str(folder / f"{name}.png"), cv2.IMREAD_GRAYSCALE)
    observation = locate_pegs(picture, pattern_of(entry), radius_range=entry["radius_range"])
    apart = np.linalg.norm(np.array(entry["centers"])[:, None] - observation.peg_centers, axis=2)
    assert (apart.min(axis=1) < 0.35 * np.array(entry["radii"])).all() and "missing" not in observation.states


def crossing(centers):
    """Where the diagonals of four points cross."""
    points = np.column_stack([centers, np.ones(4)])
    x, y, w = np.cross(np.cross(points[0], points[2]), np.cross(points[1], points[3]))
    return np.array([x / w, y / w])


@pytest.mark.parametrize("run", [(60, 76), (200, 216)])
def test_a_run_of_frames_keeps_its_labels(run, pegpose_data):
    centers, bores, previous = [], [], None
    for number in range(*run):
        path = pegpose_data / "visp-mire2-b" / f"image.{number:04d}.png"
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        previous = locate_pegs(picture, TARGET, radius_range=(4, 14), previous=previous)
        centers.append(previous.peg_centers)
        bores.append(previous.bore_center)
    centers = np.array(centers)
    assert np.linalg.norm(np.diff(centers, axis=0), axis=2).max() < 20  # half the way between two discs is 30
    noise = np.diff(centers - centers.mean(axis=1, keepdims=True), 4, axis=0) / np.sqrt(70)
    assert 1.4826 * np.median(np.abs(noise)) < 0.035
    off = np.array([crossing(four) for four in centers]) - bores
    assert off.std(axis=0).max() < 0.07


def test_single_frames_of_another_run(pegpose_data):
    for path in sorted((pegpose_data / "visp-mire2-a").glob("*.png")):
        observation = locate_pegs(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), TARGET, radius_range=(4, 14))
        assert set(observation.states) == {"measured"} and np.isfinite(observation.bore_sigma).all()
