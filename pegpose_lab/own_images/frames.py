"""The part in each frame: tracked, its pose estimated, and whether a wheel would go on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from tqdm import tqdm

from ..checks import CalibrationError
from ..insertion import assembly_forecast
from ..pegs import track_pegs
from ..pose import estimate_pose
from ..targets import Hub
from .reading import read_picture

if TYPE_CHECKING:
    from pathlib import Path

    from ..calibration import Calibration
    from ..insertion import AssemblyForecast
    from ..pegs import PegObservation
    from ..pose import HubPose
    from .description import Description


DOUBTFUL = ("misfit-pegs", "ring-misfit", "rival-ring", "weak-ring", "labels-undecided")
"""Flags with which a pose is no pose to drive a robot by."""


@dataclass(frozen=True, eq=False)
class Frame:
    """What was found in one frame.

    Attributes
    ----------
    path : Path
    fate : str
        What became of it, in a sentence.
    observation : PegObservation or None
    pose : HubPose or None
    forecast : AssemblyForecast or None
        Of the wheel, if one is described.
    """

    path: Path
    fate: str
    observation: PegObservation | None = None
    pose: HubPose | None = None
    forecast: AssemblyForecast | None = None

    @property
    def doubtful(self) -> bool:
        """Whether a flag of its pose says that it may be wrong."""
        return self.pose is not None and any(flag.code in DOUBTFUL for flag in self.pose.flags)


def track_frames(
    paths: list[Path],
    described: Description,
    calibration: Calibration | None,
    *,
    plane_view: int | None,
    progress: bool,
) -> list[Frame]:
    """Find the part in one frame after the other (`track_pegs`), estimate its pose, and forecast the insertion."""
    frames, read = [], []

    def images():
        for path in tqdm(paths, unit="frame", desc="frames", disable=not progress):
            try:
                read.append((path, read_picture(path)))
            except (ValueError, OSError) as error:
                frames.append(Frame(path, f"not read: {error}"))
            else:
                yield read[-1][1].image

    for seen in track_pegs(images(), described.part, radius_range=described.radius_range):
        frames.append(_judged(*read.pop(), seen, described, calibration, plane_view))
    return frames


def _judged(path, picture, seen, described, calibration, plane_view):
    """The frame with its pose and forecast, as far as they go."""
    notes = "".join(f" ({note})" for note in picture.notes)
    if not seen:
        hint = "; a part without a bore and two screws is described by ring" if isinstance(described.part, Hub) else ""
        return Frame(path, f"not found{notes}: {seen.reason}{hint}")
    fate = f"{seen.states.count('measured')} of {len(seen.states)} discs measured{notes}"
    fate = "; ".join([fate, *map(str, seen.flags)])
    if calibration is None:
        return Frame(path, fate, seen)
    size = tuple(calibration.camera.image_size)
    if size != picture.size:
        taken = f"the camera is calibrated for {size[0]} x {size[1]} px and the frame has {picture.size[0]} x {picture.size[1]}"
        return Frame(path, f"{fate}; no pose: {taken}: calibrate the camera that took it, at its resolution", seen)
    plane = None if plane_view is None else calibration.cam_from_object[plane_view]
    try:
        pose = estimate_pose(seen, calibration, described.part, plane=plane, plane_view=plane_view)
    except (CalibrationError, ValueError) as error:
        return Frame(path, f"{fate}; no pose: {error}", seen)
    fate = "; ".join([fate, *map(str, pose.flags)])
    frame = Frame(path, fate, seen, replace(pose, flags=(*seen.flags, *pose.flags)))
    if frame.doubtful:
        return replace(frame, fate=f"{fate.rstrip('.')}; the pose is doubtful")
    if described.wheel is None:
        return frame
    repeatability = described.robot_repeatability
    try:
        forecast = assembly_forecast(pose, described.part, described.wheel, robot_repeatability=repeatability)
    except CalibrationError as error:
        return replace(frame, fate=f"{fate}; no forecast: {error}")
    return replace(frame, forecast=forecast)
