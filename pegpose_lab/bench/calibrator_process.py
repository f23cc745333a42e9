"""Calibrates with another tool, in a process of that tool's Python: ``python -I THIS_FILE TOOL INPUT OUTPUT``.

INPUT is a .npz of `calibrators`, OUTPUT a .json.  The file needs numpy and the tool, nothing else, and imports nothing
of this project.  Every tool fits OpenCV's model with k1, k2, p1, p2, k3 to the same corners, without a board warp,
weights or outlier rejection, from a start of its own.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from importlib import metadata
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

COEFFICIENTS = 5


def compare(
    calibrate: Callable[..., dict], images: np.ndarray, orders: np.ndarray, points: np.ndarray, distances: np.ndarray,
    repeats: int,
) -> dict[str, Any]:  # fmt: skip
    """Calibrate all views, timed, and halves of them.

    Parameters
    ----------
    calibrate : callable
        Maps images (views, n, 2), px, to f and its sigma, px (None if the tool states none), and ``uncertain``, a
        function of image points (n, 2) and a distance, mm, that returns worst-direction sigmas, px, or None.
    images : (views, n, 2) ndarray
        px.
    orders : (splits, views) int ndarray
        Permutations of the views, whose halves are calibrated.
    points : (n, 2) ndarray
        px, where the uncertainty of projection is asked.
    distances : (m,) ndarray
        mm.
    repeats : int
        Timed calibrations; one before them is not timed.

    Returns
    -------
    dict
        f, sigma, ms (median of the processor times), uncertain (m lists, or None), halves (a list of f, sigma, f, sigma
        for each split).
    """
    times = []
    for _ in range(repeats + 1):
        start = time.process_time()
        found = calibrate(images)
        times.append(1e3 * (time.process_time() - start))
    middle = len(images) // 2
    halves = []
    for order in orders:
        pair = [calibrate(images[np.sort(half)]) for half in (order[:middle], order[middle:])]
        halves.append([half[name] for half in pair for name in ("f", "sigma")])
    uncertain = None
    if found["uncertain"] is not None:
        uncertain = [np.asarray(found["uncertain"](points, distance)).tolist() for distance in distances]
    ms = float(np.median(times[1:]))
    return {"f": found["f"], "sigma": found["sigma"], "ms": ms, "uncertain": uncertain, "halves": halves}


def mrcal_calibration(board: np.ndarray, shape: tuple[int, int], size: tuple[int, int]) -> Callable[..., dict]:
    """mrcal: poses from a pinhole of 60 degrees, then f and poses, then all; the noise is that of the residuals."""
    import mrcal

    spacing = float(board[1, 0] - board[0, 0])
    words = mrcal.optimize.__doc__ or ""
    frames, extrinsics = ("rt_ref_frame", "rt_cam_ref")
    if frames not in words:  # mrcal 2.4 and older
        frames, extrinsics = "frames_rt_toref", "extrinsics_rt_fromref"

    def calibrate(images):
        count = len(images)
        observed = np.concatenate([images.reshape(count, *shape, 2), np.ones((count, *shape, 1))], axis=3)
        indices = np.array([(view, 0, -1) for view in range(count)], np.int32)
        core = np.array([size[0], size[0], (size[0] - 1) / 2, (size[1] - 1) / 2], float)
        first = mrcal.estimate_monocular_calobject_poses_Rt_tocam(
            indices[:, :2], observed, spacing, [("LENSMODEL_PINHOLE", core)]
        )
        inputs = {
            "intrinsics": np.concatenate([core, np.zeros(COEFFICIENTS)])[None],
            frames: mrcal.rt_from_Rt(first),
            extrinsics: np.zeros((0, 6)),
            "points": np.zeros((0, 3)),
            "observations_board": observed,
            "observations_point": np.zeros((0, 3)),
            "indices_frame_camintrinsics_camextrinsics": indices,
            "indices_point_camintrinsics_camextrinsics": np.zeros((0, 3), np.int32),
            "lensmodel": "LENSMODEL_OPENCV5",
            "imagersizes": np.array([size], np.int32),
            "calibration_object_spacing": spacing,
            "calobject_warp": None,
            "do_optimize_calobject_warp": False,
            "do_apply_regularization": False,
            "do_apply_outlier_rejection": False,
            "do_optimize_frames": True,
            "do_optimize_extrinsics": True,
            "verbose": False,
        }
        for lens in (False, True):
            inputs["do_optimize_intrinsics_core"], inputs["do_optimize_intrinsics_distortions"] = True, lens
            mrcal.optimize(**inputs)
        _, residuals, jacobian, factorization = mrcal.optimizer_callback(**inputs)
        parameters = jacobian.shape[1]
        sigma = np.sqrt(np.sum(residuals**2) / (len(residuals) - parameters))
        unit, scale = np.zeros(parameters), np.ones(parameters)
        unit[0] = 1.0
        mrcal.unpack_state(scale, **inputs)
        variance = factorization.solve_xt_JtJ_bt(unit)[0] * scale[0] ** 2
        model = mrcal.cameramodel(optimization_inputs=inputs, icam_intrinsics=0)

        def uncertain(points, distance):
            rays = mrcal.unproject(points, *model.intrinsics(), normalize=True)
            return mrcal.projection_uncertainty(
                rays * (distance if np.isfinite(distance) else 1.0),
                model=model,
                atinfinity=bool(np.isinf(distance)),
                what="worstdirection-stdev",
                observed_pixel_uncertainty=float(sigma),
            )

        f = float(inputs["intrinsics"][0, 0])
        return {"f": f, "sigma": float(sigma * np.sqrt(variance)), "uncertain": uncertain}

    return calibrate


def calibsense_calibration(board: np.ndarray, shape: tuple[int, int], size: tuple[int, int]) -> Callable[..., dict]:
    """calibsense: OpenCV's fit with the covariance of all parameters."""
    from calibsense import instrument
    from calibsense.core.observations import ObservationSet, ViewObservations
    from calibsense.core.session import CalibrationSession
    from calibsense.core.target import Checkerboard

    target = Checkerboard(shape[1], shape[0], float(board[1, 0] - board[0, 0]))
    if not np.allclose(target.object_points(), board):
        raise SystemExit("calibsense orders the corners of a board in another way")

    def calibrate(images):
        views = tuple(ViewObservations(str(k), np.arange(len(view)), view) for k, view in enumerate(images))
        found = instrument(CalibrationSession(ObservationSet(target, size, views)))
        f, sigma = float(found.camera.fx), float(found.covariance.intrinsic_std()[0])
        return {"f": f, "sigma": sigma, "uncertain": None}

    return calibrate


def lensboy_calibration(board: np.ndarray, shape: tuple[int, int], size: tuple[int, int]) -> Callable[..., dict]:
    """lensboy: states no covariance."""
    import lensboy

    settings = lensboy.OpenCVConfig(image_height=size[1], image_width=size[0])
    everywhere = np.arange(len(board))

    def calibrate(images):
        frames = [lensboy.Frame(everywhere, view) for view in images]
        found = lensboy.calibrate_camera(
            board, frames, settings, estimate_target_warp=False, outlier_threshold_stddevs=None
        )
        return {"f": float(found.camera_model.fx), "sigma": None, "uncertain": None}

    return calibrate


TOOLS = {"mrcal": mrcal_calibration, "calibsense": calibsense_calibration, "lensboy": lensboy_calibration}


def version(package: str) -> str:
    """The version of a tool: of its wheel, or of Debian's package."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        command = ["dpkg-query", "-W", "-f", "${Version}", f"python3-{package}"]
        return subprocess.run(command, capture_output=True, text=True).stdout


def main(tool: str, source: str, target: str) -> None:
    """Calibrate with a tool and write what `compare` returns, with its version."""
    given = np.load(source)
    calibrate = TOOLS[tool](given["board"], tuple(given["shape"].tolist()), tuple(given["size"].tolist()))
    answer = compare(
        calibrate, *(given[name] for name in ("images", "orders", "points", "distances")), given["repeats"]
    )
    with open(target, "w", encoding="utf-8") as file:
        json.dump(answer | {"version": version(tool)}, file)


if __name__ == "__main__":
    main(*sys.argv[1:])
