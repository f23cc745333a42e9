"""Rings of discs in photographs of real parts: found, measured, and followed from frame to frame.

The photographs, with their marks by eye, are third-party data; what is written here are our own results in them.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..checks import DetectionError
from ..circles import find_circles
from ..discs import fit_discs
from ..files import MEASURED_FOLDER
from ..patterns import RingPattern
from ..pegs import locate_pegs
from .datasets import dataset
from .measured import made_by, write_measured
from .photographs import _grey

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

MARKED = "rings-a"
OFF = 0.35  # of its radius: a place that is farther from its mark is on another disc or none
RIGID = RingPattern(centers=[[-59.5, -50], [59.5, -50], [59.5, 50], [-59.5, 50]], disc_radius=8.0, bore=30.0)
RIGID_RADII = (4, 14)  # px
RUNS = (  # data set, name of the run, numbers of its first and last frame, and the step
    ("visp-mire2-a", "every tenth frame", 10, 120, 10),
    ("visp-mire2-b", "slightly tilted", 60, 75, 1),
    ("visp-mire2-b", "steep", 200, 215, 1),
)
FOURTH = np.sqrt(70)  # standard deviation of a fourth difference over that of one value


@dataclass(frozen=True)
class MarkedRing:
    """A photograph of a ring: its name, size (px), pattern, radius range (px), and places marked by eye (n, 3): x, y, r."""

    name: str
    size: tuple[int, int]
    pattern: RingPattern
    radius_range: tuple[float, float]
    marks: NDArray[np.float64] = field(repr=False)


def marked_rings() -> list[MarkedRing]:
    """Read the marks of the photographs.

    The pattern is what a user would state: equal places on a circle, or some of them, in px of the image; a ring of which
    not all places are marked starts anywhere on its circle.
    """
    entries = json.loads((dataset(MARKED) / "reference.json").read_text(encoding="utf-8"))
    return [
        MarkedRing(
            entry["name"], tuple(entry["size"]), _pattern(entry), tuple(entry["radius_range"]),
            np.column_stack([entry["centers"], entry["radii"]]),
        )
        for entry in entries
    ]  # fmt: skip


def _pattern(entry):
    """The pattern of a marked photograph; where places of the circle are left out, the marks' order gives the sense."""
    centers, n, radius = np.array(entry["centers"]), entry["n"], float(np.mean(entry["radii"]))
    polarity = {"mixed": "either"}.get(entry["polarity"], entry["polarity"])
    if len(centers) == n:
        pitch = float(np.linalg.norm(centers - centers.mean(axis=0), axis=1).mean())
        return RingPattern(n, pitch_radius=pitch, disc_radius=radius, polarity=polarity)
    z = centers @ (1, 1j)
    sense = np.sign(np.median(((z[2:] - z[1:-1]) / (z[1:-1] - z[:-2])).imag))
    pitch = float(np.median(np.abs(np.diff(z)))) / 2 / np.sin(np.pi / n)
    angles = sense * np.arange(len(centers)) * 2 * np.pi / n
    return RingPattern(angles=angles, pitch_radius=pitch, disc_radius=radius, polarity=polarity)


def measure_rings() -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Locate the ring in each marked photograph, given its pattern and radius range only.

    Returns
    -------
    rings : DataFrame
        A row for each photograph: picture, width, height, places; found (0 or 1); measured, partial, missing, contradicted:
        the places' states; wrong: places off their mark by more than `OFF`; residual (px), residual_over_sigma, labelled_by;
        said: the flags' codes, or what was said where no ring was found.
    places : DataFrame
        A row for each place: picture, place, x, y, r (px), state, sigma (px, of a coordinate, the larger one).
    circles : DataFrame
        What `find_circles` and `fit_discs` find in the same range: picture, x, y, r, state.
    """
    rings, places, circles = [], [], []
    for ring in marked_rings():
        image = _grey(dataset(MARKED) / f"{ring.name}.png")
        discs = _discs(image, ring)
        circles += [(ring.name, *row) for row in discs]
        counts = dict.fromkeys(("measured", "partial", "missing", "contradicted"), 0)
        try:
            seen = locate_pegs(image, ring.pattern, radius_range=ring.radius_range)
        except DetectionError as error:
            rings.append((ring.name, *ring.size, len(ring.marks), 0, *counts.values(), 0, 0.0, 0.0, "", str(error)))
            continue
        counts |= {state: seen.states.count(state) for state in counts}
        apart = np.linalg.norm(seen.peg_centers[:, None] - ring.marks[:, :2], axis=2)
        wrong = int((apart.min(axis=0) > OFF * ring.marks[:, 2]).sum())
        codes = " ".join(sorted({flag.code for flag in seen.flags}))
        quality = wrong, seen.residual, seen.residual_over_sigma, seen.labelled_by, codes
        rings.append((ring.name, *ring.size, len(seen.states), 1, *counts.values(), *quality))
        sigmas = np.sqrt(np.diagonal(seen.peg_covariances, axis1=1, axis2=2)).max(axis=1)
        rows = zip(*seen.peg_centers.T, seen.peg_radii, seen.states, sigmas, strict=True)
        places += [(ring.name, number, *row) for number, row in enumerate(rows, 1)]
    columns = [
        "picture", "width", "height", "places", "found", *counts, "wrong", "residual", "residual_over_sigma",
        "labelled_by", "said",
    ]  # fmt: skip
    return (
        pd.DataFrame(rings, columns=columns),
        pd.DataFrame(places, columns=["picture", "place", "x", "y", "r", "state", "sigma"]),
        pd.DataFrame(circles, columns=["picture", "x", "y", "r", "state"]),
    )


def _discs(image, ring):
    """Rows x, y, r, state of the circles in the ring's radius range, of its polarity or of both."""
    rows: list[tuple[Any, ...]] = []
    kinds = ("bright", "dark") if ring.pattern.polarity == "either" else (ring.pattern.polarity,)
    for polarity in kinds:
        discs = fit_discs(image, find_circles(image, ring.radius_range, polarity=polarity))
        rows += zip(*discs.centers.T, discs.radii, discs.states, strict=True)
    return rows


def follow_runs() -> pd.DataFrame:
    """Follow the four discs and the bore of a target through runs of frames.

    Returns
    -------
    DataFrame
        A row for each run: dataset, run, frames, located (frames in which the ring is found), measured (places, of four a
        frame), labels_kept (0 or 1: no disc jumps by half the way to the next), noise (px, of one coordinate of one frame:
        robust standard deviation of the fourth differences over sqrt(70), NaN for single frames), crossing (px, standard
        deviation of the bore's centre about the crossing of the diagonals, the larger one of x and y).
    """
    rows = []
    for name, run, first, last, step in RUNS:
        numbers, consecutive = range(first, last + 1, step), step == 1
        seen, previous = [], None
        for number in numbers:
            image = _grey(dataset(name) / f"image.{number:04d}.png")
            previous = locate_pegs(image, RIGID, radius_range=RIGID_RADII, previous=previous if consecutive else None)
            seen.append(previous)
        centers = np.array([one.peg_centers for one in seen])
        away = np.array([_crossing(four) for four in centers]) - [one.bore_center for one in seen]
        noise, kept = np.nan, np.nan
        if consecutive:
            relative = np.diff(centers - centers.mean(axis=1, keepdims=True), 4, axis=0)
            noise = 1.4826 * np.median(np.abs(relative)) / FOURTH
            pitch = np.linalg.norm(np.diff(centers, axis=1), axis=2).min()
            kept = float(np.linalg.norm(np.diff(centers, axis=0), axis=2).max() < pitch / 2)
        measured = sum(one.states.count("measured") for one in seen)
        rows.append((name, run, len(numbers), len(seen), measured, kept, noise, away.std(axis=0).max()))
    columns = ["dataset", "run", "frames", "located", "measured", "labels_kept", "noise", "crossing"]
    return pd.DataFrame(rows, columns=columns)


def _crossing(centers):
    """The point (2,) where the diagonals of four points cross."""
    points = np.column_stack([centers, np.ones(4)])
    x, y, w = np.cross(np.cross(points[0], points[2]), np.cross(points[1], points[3]))
    return x / w, y / w


def write_real_rings(folder: Path = MEASURED_FOLDER) -> None:
    """Measure the rings and runs, and write the tables into `folder`."""
    rings, places, circles = measure_rings()
    made = made_by("real_rings")
    write_measured(
        folder, "real_rings", rings.round({"residual": 2, "residual_over_sigma": 2}), f"rings in photographs; {made}"
    )
    rounded = {"x": 1, "y": 1, "r": 1, "sigma": 2}
    write_measured(folder, "real_ring_places", places.round(rounded), f"places of these rings, px; {made}")
    write_measured(
        folder, "real_ring_circles", circles.round(rounded), f"circles found in the same photographs, px; {made}"
    )
    runs = follow_runs().round({"noise": 3, "crossing": 3})
    write_measured(
        folder, "real_ring_runs", runs, f"four discs and a bore, followed through runs of frames, px; {made}"
    )
