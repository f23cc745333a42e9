"""Joint calibration beside other tools that state an uncertainty or refine poses: mrcal, calibsense, lensboy, OpenCV.

All of them get the same corners and fit the same model, OpenCV's with k1, k2, p1, p2, k3.  Each of the three runs in
an environment of its own (`lab.calibrators`); one that is not installed has a row with the reason.
"""

from __future__ import annotations

import functools
import json
import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd
from tqdm import tqdm

from .. import __version__, paper, study
from ..calibration import calibrate_joint, projection_uncertainty
from ..camera import Sensor
from ..lab import calibrators as environments
from ..targets import Checkerboard
from .calibrator_process import compare
from .score import one_thread

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from ..calibration import Calibration

OURS, CLASSICAL = "calibrate_joint", "calibrate_joint, independent noise"
OPENCV, REFERENCE = "cv2.calibrateCameraExtended", "mrcal"
PEERS = (REFERENCE, environments.DEBIAN, "calibsense", "lensboy")
SHARED = ("k1", "k2", "p1", "p2", "k3")
SEED, VIEWS, NOISE = 31, 13, 0.1  # of the simulated corners; px
SPLITS = 10
DISTANCES = (np.inf, 1000.0)  # mm
MEASURED_FILE = "mrcal_uncertainty"
TIMEOUT = 600.0  # s for one tool; the slowest takes half a minute


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of one board in all views: the board's shape (rows, columns), its points, images (views, n, 2), px."""

    name: str
    shape: tuple[int, int]
    board: NDArray[np.float64]
    images: NDArray[np.float64]
    sensor: Sensor

    @property
    def image_corners(self) -> NDArray[np.float64]:
        """The four corners of the image, px."""
        right, bottom = np.subtract(self.sensor.image_size, 1.0)
        return np.array([[0, 0], [right, 0], [0, bottom], [right, bottom]])


def corner_sets() -> list[Corners]:
    """The corners that the tools are compared on: 13 simulated views of the paper's camera, and OpenCV's photographs.

    Returns
    -------
    list of Corners

    Examples
    --------
    >>> [corners.images.shape for corners in corner_sets()]
    [(13, 48, 2), (13, 54, 2)]
    """
    camera, board, rng = paper.paper_camera(), Checkerboard(8, 6, 29.0), np.random.default_rng([SEED, VIEWS])
    points = board.object_points
    poses = study.trial_poses(board, 30.0, VIEWS, rng)
    images = [camera.project(points, pose) + NOISE * rng.standard_normal(points[:, :2].shape) for pose in poses]
    sets = [Corners("simulated", (6, 8), points, np.array(images), camera.sensor)]
    boards, images, size, _ = study.load_corners()
    sensor = Sensor((1.0, 1.0), tuple(np.subtract(size, 1) / 2), size)
    return [*sets, Corners("opencv_left", (6, 9), boards[0], np.array(images), sensor)]


def our_calibration(
    corners: Corners, images: NDArray[np.float64] | None = None, *, classical: bool = True
) -> Calibration:
    """The joint calibration in the compared model.

    Parameters
    ----------
    corners : Corners
    images : (views, n, 2) ndarray, optional
        px; some of the views.
    classical : bool
        With the covariance of independent noise, as the other tools state it; else as `calibrate_joint` returns it.
    """
    images = corners.images if images is None else images
    found = calibrate_joint(
        [corners.board] * len(images), list(images), corners.sensor, focal="two", coefficients=SHARED
    )
    covariance = getattr(found, "classical_covariance", None)
    return replace(found, covariance=covariance) if classical and covariance is not None else found


def measure_calibrators(*, splits: int = SPLITS, repeats: int = 3) -> pd.DataFrame:
    """f, its sigma, the agreement of halves, the time and the uncertainty of projection of every tool.

    Parameters
    ----------
    splits : int
        Random halves of the views, the same for all tools.
    repeats : int
        Timed calibrations of each tool.

    Returns
    -------
    DataFrame
        corners, tool, version; f and sigma (of f_x, px); half_px, the rms difference of f between halves, and z, the
        same over the stated sigmas (rms, 1 if they are right); ms of processor time; corner_inf and corner_1m, the
        largest stated uncertainty of projection at the image's corners, px, at infinity and at 1 m; off_mrcal, the
        largest deviation from mrcal's at the four corners, %; missing, why a tool could not run.  A tool that states
        no sigma or no uncertainty of projection has NaN there.
    """
    rows = []
    for corners in tqdm(corner_sets(), unit="set", desc="tools  ", disable=None):
        answers = {name: _answer(name, corners, splits, repeats) for name in (OURS, CLASSICAL, OPENCV, *PEERS)}
        mrcal = next((answers[name] for name in PEERS[:2] if not answers[name].get("missing")), {})
        rows += [{"corners": corners.name, "tool": name, **_row(answer, mrcal)} for name, answer in answers.items()]
    return pd.DataFrame(rows)


def write_mrcal_uncertainty(folder: Path) -> None:
    """Write mrcal's uncertainty of projection at the corners and the middle of the image into mrcal_uncertainty.csv.

    Raises
    ------
    SystemExit
        If mrcal is not installed, or fails.
    """
    name = next((name for name in PEERS[:2] if not environments.missing(name)), None)
    if name is None:
        raise SystemExit(environments.missing(REFERENCE))
    rows = []
    for corners in corner_sets():
        middle = np.subtract(corners.sensor.image_size, 1.0) / 2
        points = np.vstack([corners.image_corners, middle])
        answer = _ask(name, corners, points, _orders(corners, 0), 1)
        if "missing" in answer:
            raise SystemExit(answer["missing"])
        for distance, sigmas in zip(DISTANCES, answer["uncertain"], strict=True):
            for point, sigma in zip(points, sigmas, strict=True):
                rows.append(
                    (corners.name, *point, distance, round(sigma, 9), round(answer["f"], 6), round(answer["sigma"], 9))
                )
    table = pd.DataFrame(rows, columns=["corners", "x", "y", "distance", "sigma", "f_x", "f_x_sigma"])
    comment = (
        "mrcal's uncertainty of projection (worst direction, px) at x, y (px) and distance (mm), its f_x and sigma (px), "
        f"OPENCV5 without warp, regularisation and outlier rejection, mrcal {answer['version']}"
    )
    study.write_measured(folder, MEASURED_FILE, table, f"{comment}; {study.made_by(MEASURED_FILE)}")


# ---- one tool ----


def _answer(name, corners, splits, repeats):
    """What `compare` returns of a tool, or the reason why it is missing."""
    points, orders = corners.image_corners, _orders(corners, splits)
    if name in _HERE:
        with one_thread():
            found = compare(
                lambda images: _HERE[name](corners, images),
                corners.images,
                orders,
                points,
                np.array(DISTANCES),
                repeats,
            )
        return found | {"version": cv2.__version__ if name == OPENCV else __version__}
    reason = environments.missing(name)
    return {"missing": reason} if reason else _ask(name, corners, points, orders, repeats)


def _ask(name, corners, points, orders, repeats):
    """The answer of another tool's process; a process that fails is a reason."""
    with tempfile.TemporaryDirectory() as folder:
        given, answer = Path(folder, "given.npz"), Path(folder, "answer.json")
        np.savez(
            given,
            board=corners.board,
            shape=corners.shape,
            size=corners.sensor.image_size,
            images=corners.images,
            orders=orders,
            points=points,
            distances=DISTANCES,
            repeats=repeats,
        )
        file = Path(__file__).with_name("calibrator_process.py")
        tool = REFERENCE if name == environments.DEBIAN else name
        command = [environments.calibrator_python(name), "-I", file, tool, given, answer]
        try:
            ran = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
        except subprocess.TimeoutExpired:
            return {"missing": f"{name} took more than {TIMEOUT:g} s"}
        if ran.returncode:
            return {"missing": f"{name} failed: {(ran.stderr.strip().splitlines() or ['no message'])[-1]}"}
        return json.loads(answer.read_text(encoding="utf-8"))


def _ours(corners, images, classical=False):
    found = our_calibration(corners, images, classical=classical)

    def uncertain(points, distance):
        return projection_uncertainty(found, points, distance).sigmas

    return {"f": found.camera.parameters["f_x"], "sigma": found.sigma("f_x"), "uncertain": uncertain}


def _opencv(corners, images):
    boards = [corners.board.astype(np.float32)] * len(images)
    found = cv2.calibrateCameraExtended(boards, list(images.astype(np.float32)), corners.sensor.image_size, None, None)
    return {"f": float(found[1][0, 0]), "sigma": float(np.ravel(found[5])[0]), "uncertain": None}


_HERE = {OURS: _ours, CLASSICAL: functools.partial(_ours, classical=True), OPENCV: _opencv}


def _orders(corners, splits):
    """The same permutations of the views for every tool."""
    rng = np.random.default_rng(SEED)
    orders = [rng.permutation(len(corners.images)) for _ in range(splits)]
    return np.array(orders, int).reshape(splits, len(corners.images))


def _row(answer: dict[str, Any], mrcal: dict[str, Any]) -> dict[str, Any]:
    """The columns of `measure_calibrators` of one answer."""
    names = ("version", "f", "sigma", "half_px", "z", "ms", "corner_inf", "corner_1m", "off_mrcal", "missing")
    row = dict.fromkeys(names, np.nan) | {"version": "", "missing": answer.get("missing", "")}
    if row["missing"]:
        return row
    row |= {name: answer[name] for name in ("version", "f", "ms")}
    first, first_sigma, second, second_sigma = np.array(answer["halves"], float).T
    row["half_px"] = np.sqrt(np.mean((first - second) ** 2))
    if answer["sigma"] is not None:
        row["sigma"] = answer["sigma"]
        row["z"] = np.sqrt(np.mean((first - second) ** 2 / (first_sigma**2 + second_sigma**2)))
    if answer["uncertain"]:
        sigmas = np.array(answer["uncertain"])
        row["corner_inf"], row["corner_1m"] = sigmas.max(axis=1)
        if mrcal:
            row["off_mrcal"] = 100 * np.abs(sigmas / np.array(mrcal["uncertain"]) - 1).max()
    return row
