"""Hand-eye calibration on photographs: two robots, and whether the stated intervals hold the poses that were left out.

`visp_franka_eye_to_hand` has a tag of 48 mm on the flange of a robot before a fixed camera; `robot-dots-10x10` a sheet of
dots before a camera on the wrist, whose file says that the dots are 25.4 mm apart, while the sheet prints 20 mm.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd
from scipy.spatial.transform import RigidTransform, Rotation

from ..calibration import board_pose, calibrate_zhang
from ..camera import OpenCVCamera
from ..files import MEASURED_FOLDER
from ..handeye import calibrate_hand_eye
from .datasets import dataset
from .disc_pulls import SHEETS, _measured
from .measured import made_by, write_measured
from .photographs import _grey

if TYPE_CHECKING:
    from pathlib import Path

    from ..handeye import HandEye

TAG, DOTS = "visp_franka_eye_to_hand", "robot-dots-10x10"
TAG_NUMBER, TAG_SIDE, PITCH = 10, 48.0, 25.4  # of the family 36h11; mm; mm, as the sheet's file says
QUARTERS = tuple(Rotation.from_rotvec([0, 0, turn * np.pi / 2]) for turn in range(4))


@dataclass(frozen=True, eq=False)
class RealPoses:
    """Pairs of poses from photographs."""

    dataset: str
    setup: str
    robot_from_end_effector: list[RigidTransform]
    cam_from_target: list[RigidTransform]


def tag_poses() -> RealPoses:
    """The poses of the tag, from OpenCV's corners, refined by its own `cornerSubPix`, and the maker's camera matrix.

    Returns
    -------
    RealPoses
    """
    folder = dataset(TAG)
    text = (folder / "franka_camera.xml").read_text(encoding="utf-8")
    fx, fy, cx, cy = (float(re.search(rf"<{name}>([-\d.]+)</{name}>", text)[1]) for name in ("px", "py", "u0", "v0"))
    camera = OpenCVCamera(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.zeros(5), (640, 480))
    corners = TAG_SIDE / 2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector, robot, target = cv2.aruco.ArucoDetector(family, settings), [], []
    for number in range(1, 9):
        found, names, _ = detector.detectMarkers(_grey(folder / f"franka_image-{number}.png"))
        image_points = found[names.ravel().tolist().index(TAG_NUMBER)].reshape(4, 2).astype(float)
        target.append(board_pose(corners, image_points, camera))
        text = (folder / f"franka_pose_rPe_{number}.yaml").read_text(encoding="utf-8")
        x, y, z, *turn = (float(value) for value in re.findall(r"\[([-\d.e]+)\]", text))
        robot.append(RigidTransform.from_components([1000 * x, 1000 * y, 1000 * z], Rotation.from_rotvec(turn)))
    return RealPoses(TAG, "eye-to-hand", robot, target)


def dot_poses() -> RealPoses:
    """The poses of the sheet of dots, with its camera calibrated from the same dots, and the origin in its middle.

    The sheet looks the same after a quarter turn: of the four, the one nearest to the data set's own guess is taken.

    Returns
    -------
    RealPoses
    """
    folder, robot, object_points, image_points = dataset(DOTS), [], [], []
    (sheet,) = (sheet for sheet in SHEETS if sheet.dataset == DOTS)
    for number in range(15):
        seen = _measured(sheet, folder / f"{number}.png")
        usable = np.isfinite(seen.centers[:, 0])
        middle = (np.array(sheet.grid) - 1) / 2
        object_points.append(np.column_stack([PITCH * (seen.places - middle), np.zeros(len(seen.places))])[usable])
        image_points.append(seen.centers[usable])
        text = (folder / f"pose{number}.yaml").read_text(encoding="utf-8")
        values = {name: float(value) for name, value in re.findall(r"(\w+): ([-\d.e]+)", text)}
        shift = [1000 * values[name] for name in "xyz"]
        turn = Rotation.from_quat([values[name] for name in ("qx", "qy", "qz", "qw")])
        robot.append(RigidTransform.from_components(shift, turn))
    found = calibrate_zhang(object_points, image_points, (640, 480))
    guess = Rotation.from_rotvec([0, 0, -np.pi / 2])  # of the camera on the wrist, and of the sheet, z up, in the base
    target = []
    for arm, pose in zip(robot, found.cam_from_object, strict=True):
        expected = (arm.rotation * guess).inv() * guess * Rotation.from_rotvec([np.pi, 0, 0])
        turned = [pose * RigidTransform.from_rotation(quarter) for quarter in QUARTERS]
        target.append(min(turned, key=lambda pose, near=expected: (near.inv() * pose.rotation).magnitude()))
    return RealPoses(DOTS, "eye-in-hand", robot, target)


def left_out_hits(poses: RealPoses, *, estimate_scale: bool) -> tuple[HandEye, np.ndarray, np.ndarray]:
    """Calibrate with all poses, then predict each from a calibration without it.

    Returns
    -------
    found : HandEye
        With all poses.
    errors : (n, 6) ndarray
        Measured less predicted, mm and rad, in the camera's axes at the target's origin.
    half_widths : (n, 6) ndarray
        Of the 95 % intervals that the calibration without the pose states.
    """
    robot, target = poses.robot_from_end_effector, poses.cam_from_target
    options = {"setup": poses.setup, "estimate_scale": estimate_scale}
    errors, half_widths = [], []
    for left in range(len(robot)):
        rest = [number for number in range(len(robot)) if number != left]
        found = calibrate_hand_eye([robot[k] for k in rest], [target[k] for k in rest], **options)
        predicted = found.cam_from_target(robot[left]).pose
        shift = found.target_scale * target[left].translation - predicted.translation
        errors.append(np.concatenate([shift, (target[left].rotation * predicted.rotation.inv()).as_rotvec()]))
        half_widths.append(found.new_pose_half_widths(robot[left]))
    return calibrate_hand_eye(robot, target, **options), np.array(errors), np.array(half_widths)


def measure_hand_eyes() -> pd.DataFrame:
    """Calibrate both robots, with the target's stated size and with an unknown one.

    Returns
    -------
    DataFrame
        A row for each: dataset, scale ("stated" or "unknown"), poses; rms residuals (residual, mm; residual_turn, deg);
        rms errors at poses left out (left_out, mm; left_out_turn, deg); held, the share of the components of these errors
        within their stated 95 % intervals (%); half_width, of the camera's place, the largest (mm); target_scale and its
        sigma; flags, their codes.
    """
    rows = []
    for poses in (tag_poses(), dot_poses()):
        for unknown in (False, True):
            found, errors, half_widths = left_out_hits(poses, estimate_scale=unknown)
            rows.append(
                {
                    "dataset": poses.dataset,
                    "scale": "unknown" if unknown else "stated",
                    "poses": len(errors),
                    "residual": _rms(found.residuals[:, :3]),
                    "residual_turn": np.rad2deg(_rms(found.residuals[:, 3:])),
                    "left_out": _rms(errors[:, :3]),
                    "left_out_turn": np.rad2deg(_rms(errors[:, 3:])),
                    "held": 100 * np.mean(np.abs(errors) < half_widths),
                    "half_width": found.half_widths[:3].max(),
                    "target_scale": found.target_scale,
                    "target_scale_sigma": found.target_scale_sigma,
                    "flags": " ".join(flag.code for flag in found.flags) or "none",
                }
            )
    return pd.DataFrame(rows)


def _rms(vectors):
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def write_hand_eyes(folder: Path = MEASURED_FOLDER) -> None:
    """Measure both robots and write the table into `folder`."""
    comment = (
        "hand-eye calibration of two robots, with the stated size of the target or an unknown one: rms residuals and errors "
        "at poses left out (mm, deg), % of these within 95 % intervals, half the camera's widest interval (mm); "
        + made_by("hand_eyes")
    )
    digits = {"residual": 3, "residual_turn": 3, "left_out": 2, "left_out_turn": 2, "held": 1, "half_width": 2}
    table = measure_hand_eyes().round(digits | {"target_scale": 4, "target_scale_sigma": 4})
    write_measured(folder, "hand_eyes", table, comment)
