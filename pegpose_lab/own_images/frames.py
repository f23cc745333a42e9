"""The part in each frame: tracked, and its pose estimated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tqdm import tqdm

from ..checks import CalibrationError, DetectionError
from ..pegs import locate_pegs
from ..pose import estimate_pose
from .reading import read_picture

if TYPE_CHECKING:
    from pathlib import Path

    from ..calibration import Calibration
    from ..patterns import RingPattern
    from ..pegs import PegObservation
    from ..pose import HubPose
    from ..targets import Hub


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
    """

    path: Path
    fate: str
    observation: PegObservation | None = None
    pose: HubPose | None = None


def track_frames(
    paths: list[Path],
    part: Hub | RingPattern,
    calibration: Calibration | None,
    *,
    radius_range: tuple[float, float] | None,
    plane_view: int | None,
    progress: bool,
) -> list[Frame]:
    """Find the part in one frame after the other, with the labels of the frame before, and estimate its pose."""
    frames, previous = [], None
    for path in tqdm(paths, unit="frame", desc="frames", disable=not progress):
        frame = _frame(path, part, calibration, radius_range, plane_view, previous)
        previous = frame.observation or previous
        frames.append(frame)
    return frames


def _frame(path, part, calibration, radius_range, plane_view, previous):
    try:
        picture = read_picture(path)
    except (ValueError, OSError) as error:
        return Frame(path, f"not read: {error}")
    notes = "".join(f" ({note})" for note in picture.notes)
    try:
        observation = _located(picture.image, part, radius_range, previous)
    except (DetectionError, ValueError) as error:
        return Frame(path, f"not found{notes}: {error}")
    told = "; ".join(observation.flags)
    seen = f"{observation.states.count('measured')} of {len(observation.states)} discs measured{notes}"
    seen = f"{seen}; {told}" if told else seen
    if calibration is None:
        return Frame(path, seen, observation)
    if tuple(calibration.camera.image_size) != picture.size:
        return Frame(path, f"{seen}; no pose: the frame has another size than the boards' images", observation)
    plane = None if plane_view is None else calibration.cam_from_object[plane_view]
    try:
        pose = estimate_pose(observation, calibration, part, plane=plane, plane_view=plane_view)
    except (CalibrationError, ValueError) as error:
        return Frame(path, f"{seen}; no pose: {error}", observation)
    flags = "".join(f"; {flag}" for flag in pose.flags)
    return Frame(path, f"{seen}{flags}", observation, pose)


def _located(image, part, radius_range, previous):
    """The part with the labels of the frame before, or, where these cannot be carried, with its own."""
    try:
        return locate_pegs(image, part, radius_range=radius_range, previous=previous)
    except DetectionError:
        if previous is None:
            raise
        return locate_pegs(image, part, radius_range=radius_range)
