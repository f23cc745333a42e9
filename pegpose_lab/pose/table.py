"""The poses of a sequence as a table, and as a CSV file."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..files import replacing

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from numpy.typing import NDArray
    from pandas import DataFrame

    from ..pegs import LostFrame
    from .hub import HubPose

MOTION = ("t_x", "t_y", "t_z", "r_x", "r_y", "r_z")
"""Translation, mm, and rotation vector, rad, of cam_from_hub."""

_PAIRS = list(combinations_with_replacement(range(6), 2))
_COVARIANCES = [f"cov_{MOTION[i]}_{MOTION[j]}" for i, j in _PAIRS]
_NUMBERS = ["x", "y", "theta", *MOTION, *_COVARIANCES, "rms", "chi2", "pegs"]


def pose_table(poses: Sequence[HubPose | LostFrame | str], *, times: Sequence[float] | None = None) -> DataFrame:
    """Return the poses of a sequence as a table, a row for each frame.

    Parameters
    ----------
    poses : sequence of HubPose, LostFrame or str
        In the place of a pose that was not found, the `LostFrame` of `track_pegs`, or the reason.
    times : sequence of float, optional
        Of the frames, s.

    Returns
    -------
    DataFrame
        frame, counted from 1; time, s, if given; x, y (mm) and theta (rad) as in `HubPose`; t_x to r_z, translation
        (mm) and rotation vector (rad) of cam_from_hub; cov_t_x_t_x to cov_r_z_r_z, the upper triangle of the covariance
        (mm, rad; empty if there is none); rms, px; chi2; pegs, how many were measured; flags, their codes; status, the
        reason of a frame without a pose, whose numbers are NaN.

    Raises
    ------
    ValueError
        If `times` has another length, or an entry is none of these.

    Examples
    --------
    >>> from pegpose_lab.pose import pose_table
    >>> pose_table(["no peg in the image"], times=[0.1])[["frame", "time", "x", "status"]].values.tolist()
    [[1, 0.1, nan, 'no peg in the image']]
    """
    import pandas as pd

    poses = list(poses)
    if times is not None and len(times) != len(poses):
        raise ValueError(f"times has {len(times)} values and poses {len(poses)}; expected as many")
    rows = [_row(pose, number) for number, pose in enumerate(poses, 1)]
    table = pd.DataFrame(rows, columns=["frame", *_NUMBERS, "flags", "status"])
    if times is not None:
        table.insert(1, "time", np.asarray(times, float))
    return table


def _row(pose, number):
    reason = pose if isinstance(pose, str) else getattr(pose, "reason", None)
    if reason is not None:
        return [number, *[np.nan] * len(_NUMBERS), "", " ".join(reason.split()) or "no pose"]
    if not hasattr(pose, "cam_from_hub"):
        raise ValueError(f"poses[{number - 1}] is {type(pose).__name__}; expected a HubPose, a LostFrame, or a reason")
    covariance = np.full((6, 6), np.nan) if pose.covariance is None else pose.covariance
    motion = [*pose.cam_from_hub.translation, *pose.cam_from_hub.rotation.as_rotvec()]
    upper = [covariance[pair] for pair in _PAIRS]
    fit = [pose.rms, pose.chi2, np.count_nonzero(pose.used)]
    codes = " ".join(flag.code for flag in pose.flags)
    return [number, pose.x, pose.y, pose.theta, *motion, *upper, *fit, codes, ""]


def write_pose_table(
    path: str | PathLike[str], poses: Sequence[HubPose | LostFrame | str], *, times: Sequence[float] | None = None
) -> None:
    """Write the `pose_table` of a sequence as a CSV file with all digits, replaced as a whole.

    Raises
    ------
    ValueError
        As `pose_table` does.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import pegpose_lab as pl
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pl.write_pose_table(Path(folder, "poses.csv"), ["no peg in the image"])
    ...     pl.read_pose_table(Path(folder, "poses.csv"))["status"].tolist()
    ['no peg in the image']
    """
    table = pose_table(poses, times=times)
    with replacing(path) as temporary:
        table.to_csv(temporary, index=False, lineterminator="\n", encoding="utf-8")


def read_pose_table(path: str | PathLike[str]) -> DataFrame:
    """Read a file of `write_pose_table`: the same numbers to the last bit.

    Raises
    ------
    ValueError
        If columns are missing.

    Examples
    --------
    See `write_pose_table`.
    """
    import pandas as pd

    texts = {"flags": str, "status": str}
    try:
        table = pd.read_csv(path, dtype=texts, encoding="utf-8-sig")
    except ValueError as error:  # pandas' own errors are of this kind
        raise ValueError(f"{path} is no table of poses: {error}") from error
    missing = [name for name in ("frame", *_NUMBERS, *texts) if name not in table]
    if missing:
        raise ValueError(f"{path} is no table of poses: it has no column {', '.join(missing[:3])}")
    return table.fillna(dict.fromkeys(texts, ""))


def table_poses(table: DataFrame) -> tuple[list[RigidTransform | None], NDArray[np.float64]]:
    """Return cam_from_hub of each row of a `pose_table` (None without a pose), and the covariances (n, 6, 6).

    Examples
    --------
    >>> table_poses(pose_table(["no peg in the image"]))[0]
    [None]
    """
    motions = table[list(MOTION)].to_numpy(float)
    poses = [
        RigidTransform.from_components(motion[:3], Rotation.from_rotvec(motion[3:]))
        if np.isfinite(motion).all()
        else None
        for motion in motions
    ]
    covariances = np.full((len(table), 6, 6), np.nan)
    for (i, j), name in zip(_PAIRS, _COVARIANCES, strict=True):
        covariances[:, i, j] = covariances[:, j, i] = table[name].to_numpy(float)
    return poses, covariances
