"""From a folder of images to calibration, poses and report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..calibration import Calibration, calibrate_joint
from ..camera import Sensor
from ..checks import CalibrationError
from .boards import find_boards
from .description import read_description
from .frames import Frame, track_frames
from .writing import write_results

if TYPE_CHECKING:
    from os import PathLike

    from .boards import BoardImage
    from .description import Description

OUTPUT = "pegpose"
"""Folder, in that of the images, in which everything is written."""

LAST = "last"


@dataclass(frozen=True, eq=False)
class FolderRun:
    """What came out of a folder of images.

    Attributes
    ----------
    boards : list of BoardImage
    calibration : Calibration or None
    why_not : str
        Why there is no calibration.
    frames : list of Frame
    files : list of Path
        What was written.

    Examples
    --------
    >>> FolderRun([], None, "no images of a board", [], []).calibration is None
    True
    """

    boards: list[BoardImage]
    calibration: Calibration | None
    why_not: str
    frames: list[Frame]
    files: list[Path]

    def summary(self) -> str:
        """A line for each image, then one for the camera."""
        lines = [f"{one.path.name}: {one.fate}" for one in (*self.boards, *self.frames)]
        if self.calibration is None:
            return "\n".join([*lines, f"camera: not calibrated: {self.why_not}"])
        if self.calibration.covariance is None:
            return "\n".join([*lines, "camera: as in its file, which states no uncertainty"])
        name = "focal_length" if "focal_length" in self.calibration.camera.parameters else "f_x"
        low, high = self.calibration.interval(name)
        views = len(self.calibration.cam_from_object)
        lines.append(f"camera: {views} views, rms {self.calibration.rms:.3f} px, {name} {low:.6g} to {high:.6g} (95 %)")
        return "\n".join([*lines, *(f"  {flag.code}: {flag}" for flag in self.calibration.flags)])


def run_folder(
    folder: str | PathLike[str], *, output: str | PathLike[str] | None = None, workers: int = 2, progress: bool = True
) -> FolderRun:
    """Calibrate from the images of a board, find the part in its frames, and write files and a report.

    Images may be of any kind that OpenCV reads; see `read_picture`.  One that cannot be used is named with the reason, and the
    others go on.  Corners are kept in the output folder: a run that was interrupted goes on where it stopped.

    Parameters
    ----------
    folder : path
        With ``pegpose.yaml``, see `read_description`.
    output : path, optional
        By default the folder `OUTPUT` in it.
    workers : int
        Processes for the boards.
    progress : bool
        Show progress bars.

    Returns
    -------
    FolderRun
        Written are ``camera.yaml`` (OpenCV), ``camera_info.yaml`` (ROS), ``corners.csv``, ``discs.csv`` (of the part, px),
        ``poses.csv``, ``pose.yaml`` (ROS's Detection3D, of the last frame whose pose is not doubtful), ``forecasts.csv`` (if a
        wheel is described) and ``report.html``, as far as there is something to write; those of an earlier run are removed.

    Raises
    ------
    ValueError
        If the description, or the calibration that it names, is missing or unusable, or there is no image.

    Examples
    --------
    >>> import tempfile
    >>> from pegpose_lab.own_images import write_sample
    >>> with tempfile.TemporaryDirectory() as name:
    ...     run = run_folder(write_sample(name), workers=1, progress=False)
    >>> run.frames[0].fate, [path.name for path in run.files][-4:]
    ('4 of 4 discs measured', ['poses.csv', 'forecasts.csv', 'pose.yaml', 'report.html'])
    """
    folder = Path(folder)
    described = read_description(folder)
    target = Path(output) if output is not None else folder / OUTPUT
    board_paths, frame_paths = (described.paths(folder, pattern) for pattern in (described.boards, described.frames))
    if not board_paths and not frame_paths:
        raise ValueError(
            f"{folder} has no images in {described.boards} or {described.frames}: put them there, or name their places in "
            "pegpose.yaml, such as boards: 'IMG_1*.jpg'"
        )
    kept = target / "kept"
    kept.mkdir(parents=True, exist_ok=True)
    _check_plane(described, board_paths)
    boards = []
    if described.camera is None:
        boards = find_boards(board_paths, described.board, kept, workers=workers, progress=progress)
    if described.camera is None:
        calibration, why_not = _calibrated(boards, described)
    else:
        calibration, why_not = _given(folder / described.camera), ""
    frames = [Frame(path, "not looked at: no part is described") for path in frame_paths]
    if described.part is not None:
        frames = track_frames(
            frame_paths,
            described,
            calibration,
            plane_view=_plane_view(described, boards) if calibration else None,
            progress=progress,
        )
    files = write_results(target, described, boards, calibration, why_not, frames)
    return FolderRun(boards, calibration, why_not, frames, files)


def _calibrated(boards: list[BoardImage], described: Description):
    """The joint calibration of the used views, or why there is none."""
    used = [one for one in boards if one.used]
    if not used:
        return None, "no image shows the board" if boards else "there are no images of a board"
    size, pitch = used[0].size, described.pixel_pitch
    sensor = Sensor((pitch, pitch), ((size[0] - 1) / 2, (size[1] - 1) / 2), size)
    points = described.board.object_points
    options = {"lens": described.lens} if described.lens != "perspective" else {"coefficients": described.coefficients}
    try:
        found = calibrate_joint([points[one.index] for one in used], [one.corners for one in used], sensor, **options)
    except (CalibrationError, ValueError) as error:
        return None, str(error)
    return found, ""


def _given(path):
    """The calibration of a file; ValueError if there is none."""
    try:
        return Calibration.load(path)
    except OSError as error:
        raise ValueError(f"camera: {path} cannot be read ({error.strerror or error})") from error


def _check_plane(described, paths):
    """ValueError, before anything is searched, if the image of the plane is not there."""
    names = [path.name for path in paths]
    if described.plane not in (None, LAST, *names):
        raise ValueError(
            f"plane is {described.plane!r}; expected 'last' or one of the images: {', '.join(names) or 'none'}"
        )


def _plane_view(described, boards):
    """Number, among the used views, of the one in the plane of the part; ValueError if it cannot be used."""
    if described.plane is None:
        return None
    name = boards[-1].path.name if described.plane == LAST else described.plane
    used = [one.path.name for one in boards if one.used]
    if name not in used:
        fate = next(one.fate for one in boards if one.path.name == name)
        raise ValueError(
            f"plane: {name} cannot be used ({fate}): take another image with the board in the plane of the part"
        )
    return used.index(name)
