"""A pose as a file for ROS: YAML in the shape of vision_msgs/Detection3D."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..checks import as_covariance, as_number, as_pose
from ..files import replacing

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from .hub import HubPose

METRE = 1000.0  # mm: ROS counts in metres (REP 103)
TO_MM = np.array([METRE] * 3 + [1.0] * 3)  # of a motion (x, y, z, rotation vector)
SECOND = 10**9  # nanoseconds


@dataclass(frozen=True, eq=False)
class Detection:
    """A pose with its covariance, and what it is a pose of: the fields of a vision_msgs/Detection3D.

    Attributes
    ----------
    pose : RigidTransform
        frame_from_object, mm.
    covariance : (6, 6) ndarray
        In the order and frame of `HubPose.covariance`, mm and rad; infinite on the diagonal where nothing is known.
    frame_id : str
        Name of the frame in which the pose is given.
    class_id : str
        Name of the kind of object.
    stamp : float
        Time of the image, s.
    score : float
        Share of the object's pegs that were measured.
    size : (3,) ndarray
        Box about the pegs' tops, mm along the object's axes.

    Examples
    --------
    >>> Detection(RigidTransform.identity(), np.eye(6), "camera").class_id
    'hub'
    """

    pose: RigidTransform
    covariance: NDArray[np.float64]
    frame_id: str
    class_id: str = "hub"
    stamp: float = 0.0
    score: float = 1.0
    size: tuple[float, float, float] | NDArray[np.float64] = (0.0, 0.0, 0.0)


def detection_of(pose: HubPose, frame_id: str, *, class_id: str = "hub", stamp: float = 0.0) -> Detection:
    """Return a pose as a `Detection`.

    Parameters
    ----------
    pose : HubPose
    frame_id, class_id : str
        Names that are not empty: of the camera's frame and of the part.
    stamp : float
        s, not negative.

    Returns
    -------
    Detection

    Raises
    ------
    ValueError
        If the pose, a name or the stamp is unusable.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> tops = np.array([[48.0, 0, 400], [0, 48, 400], [-48, 0, 400], [0, -48, 400]])
    >>> pose = RigidTransform.from_translation([0.0, 0.0, 400.0])
    >>> found = SimpleNamespace(
    ...     cam_from_hub=pose, covariance=None, peg_centers=tops, peg_radii=np.full(4, 10.0), used=np.ones(4, bool))
    >>> detection_of(found, "camera").size.tolist(), float(detection_of(found, "camera").covariance[0, 0])
    ([116.0, 116.0, 0.0], inf)
    """
    for name, text in (("frame_id", frame_id), ("class_id", class_id)):
        if not isinstance(text, str) or not text.strip():
            raise ValueError(f"{name} is {text!r}; expected a name")
    if not hasattr(pose, "cam_from_hub"):
        raise ValueError(f"pose is {type(pose).__name__}; expected a HubPose")
    tops = as_pose(pose.cam_from_hub, "cam_from_hub").inv().apply(pose.peg_centers)
    reach = (np.abs(tops[:, :2]) + pose.peg_radii[:, None])[pose.used].max(axis=0)
    return Detection(
        pose.cam_from_hub,
        np.diag(np.full(6, np.inf)) if pose.covariance is None else pose.covariance,
        frame_id,
        class_id,
        as_number(stamp, "stamp", 0),
        float(np.mean(pose.used)),
        np.array([*(2 * reach), 0.0]),
    )


def write_detection(
    path: str | PathLike[str], pose: HubPose, frame_id: str, *, class_id: str = "hub", stamp: float = 0.0
) -> None:
    """Write a pose as YAML in the shape of ROS's vision_msgs/Detection3D: metres, rad, covariance in row-major order.

    ROS gives a covariance of (x, y, z, turns about x, y and z) in the axes of the frame that is named, which is the order
    and the frame of `HubPose.covariance`.  The file is the message that ``ros2 topic pub`` takes.

    Parameters
    ----------
    path : path
        Replaced as a whole.
    pose : HubPose
    frame_id, class_id, stamp
        As for `detection_of`.

    Raises
    ------
    ValueError
        If the pose, a name or the stamp is unusable.

    References
    ----------
    ROS REP 103, "Standard Units of Measure and Coordinate Conventions".

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from scipy.spatial.transform import RigidTransform
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> image = pl.render_hub(camera, RigidTransform.from_translation([2.0, -1.0, 400.0]), hub, rng=0)
    >>> pose = pl.estimate_pose(pl.locate_pegs(image, hub), camera, hub)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pl.write_detection(Path(folder, "pose.yaml"), pose, "camera_optical_frame", stamp=12.5)
    ...     found = pl.read_detection(Path(folder, "pose.yaml"))
    >>> found.frame_id, found.stamp, found.pose.translation.round().tolist()
    ('camera_optical_frame', 12.5, [2.0, -1.0, 400.0])
    """
    import yaml

    message = _as_message(detection_of(pose, frame_id, class_id=class_id, stamp=stamp))
    with replacing(path) as temporary:
        temporary.write_text(yaml.safe_dump(message, sort_keys=False, default_flow_style=None), encoding="utf-8")


def _as_message(detection):
    seconds, part = divmod(detection.stamp, 1.0)
    carry, nanoseconds = divmod(round(part * SECOND), SECOND)  # a part that rounds to a whole second
    covariance = detection.covariance / np.outer(TO_MM, TO_MM)
    pose = {
        "position": _named("xyz", detection.pose.translation / METRE),
        "orientation": _named("xyzw", detection.pose.rotation.as_quat(canonical=True)),
    }
    return {
        "header": {"stamp": {"sec": int(seconds) + carry, "nanosec": nanoseconds}, "frame_id": detection.frame_id},
        "results": [
            {
                "hypothesis": {"class_id": detection.class_id, "score": detection.score},
                "pose": {"pose": pose, "covariance": covariance.ravel().tolist()},
            }
        ],
        "bbox": {"center": _copy(pose), "size": _named("xyz", np.asarray(detection.size) / METRE)},
        "id": "",
    }


def _named(names, values):
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _copy(pose):
    """The same numbers as dictionaries of their own: YAML would write the second as a reference to the first."""
    return {name: dict(part) for name, part in pose.items()}


def read_detection(path: str | PathLike[str]) -> Detection:
    """Read a pose that `write_detection` wrote, or another vision_msgs/Detection3D as YAML.

    Of several hypotheses, the one with the largest score is read.

    Returns
    -------
    Detection

    Raises
    ------
    ValueError
        If the file is no such message.

    Examples
    --------
    See `write_detection`.
    """
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        text = file.read()
    try:
        return _from_message(_documents(text))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        reason = f"it has no {error}" if isinstance(error, KeyError) else error
        raise ValueError(f"{path} is no vision_msgs/Detection3D: {reason}") from error


def _documents(text):
    import yaml

    try:  # `ros2 topic echo` writes one message after the other
        return next((document for document in yaml.safe_load_all(text) if document is not None), None)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError("it is no YAML") from error


def _from_message(message):
    if not isinstance(message, dict) or not message["results"]:
        raise ValueError("it holds no hypothesis")
    result = max(message["results"], key=lambda result: float(result["hypothesis"]["score"]))
    pose, hypothesis, header = result["pose"]["pose"], result["hypothesis"], message["header"]
    numbers = np.array(result["pose"]["covariance"], dtype=float)
    if numbers.size != 36:
        raise ValueError(f"its covariance has {numbers.size} numbers; expected 36")
    rotation = Rotation.from_quat(_values(pose["orientation"], "xyzw"))
    return Detection(
        RigidTransform.from_components(_values(pose["position"], "xyz") * METRE, rotation),
        as_covariance(numbers.reshape(6, 6) * np.outer(TO_MM, TO_MM), "covariance"),
        str(header["frame_id"]),
        str(hypothesis["class_id"]),
        int(header["stamp"]["sec"]) + int(header["stamp"]["nanosec"]) / SECOND,
        float(hypothesis["score"]),
        _values(message["bbox"]["size"], "xyz") * METRE,
    )


def _values(fields, names):
    values = np.array([float(fields[name]) for name in names])
    if not np.isfinite(values).all():
        raise ValueError("its pose or size is not finite")
    return values
