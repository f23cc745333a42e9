"""The drift of a peg's radius that one fixed scale makes on a tilted hub, and its comparison with Table 3."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..pose import project_discs
from ..render import disc_outline

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..camera import TsaiCamera
    from ..targets import Hub

    Floats = NDArray[np.float64]


def radii_over_turn(camera: TsaiCamera, cam_from_hub: RigidTransform, hub: Hub, angles: ArrayLike) -> Floats:
    """Return the image radii of peg 1 as the hub turns about its own axis, px: by major axis, by area, by minor axis.

    Parameters
    ----------
    camera : TsaiCamera
    cam_from_hub : RigidTransform
        Of the hub before it turns.
    hub : Hub
    angles : (n,) array_like
        rad.

    Returns
    -------
    (3, n) ndarray

    Examples
    --------
    >>> from pegpose_lab import paper
    >>> truth = paper.paper_experiment()
    >>> radii = radii_over_turn(truth.camera, truth.cam_from_hubs[0], truth.hub, [0.0, 3.14])
    >>> radii.shape, bool(np.all(radii[0] > radii[1])), bool(np.all(radii[1] > radii[2]))
    ((3, 2), True, True)
    """
    rows = []
    for angle in np.asarray(angles, np.float64):
        pose = cam_from_hub * RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, angle]))
        outline = disc_outline(camera, pose, hub.peg_centers[0], hub.peg_radius)
        minor, major = np.sqrt(2 * np.linalg.eigvalsh(np.cov(outline.T, bias=True)))
        rows.append([major, project_discs(camera, pose, hub.peg_centers[:1], [hub.peg_radius])[1][0], minor])
    return np.array(rows).T


def block_means(
    angles: ArrayLike, curve: ArrayLike, motions: Iterable[tuple[float, float]], blocks: Sequence[tuple[int, int]]
) -> Floats:
    """Return the means of a curve over blocks of frames, for hubs that turn evenly.

    Parameters
    ----------
    angles, curve : (n,) array_like
        The curve over a full turn; angles in rad.
    motions : (m,) pairs
        Angle in frame 1 and total turn up to the last frame, rad.
    blocks : (b,) pairs of int
        First and last frame of each block, counted from 1.

    Returns
    -------
    (m, b) ndarray
        In the curve's unit.

    Examples
    --------
    >>> angles = np.linspace(0, 2 * np.pi, 361)
    >>> block_means(angles, np.cos(angles), [(0, 0), (np.pi, 0)], [(1, 10), (11, 20)]).round(6).tolist()
    [[1.0, 1.0], [-1.0, -1.0]]
    """
    turned = np.arange(blocks[-1][1]) / (blocks[-1][1] - 1)
    values = [np.interp(start + turn * turned, angles, curve, period=2 * np.pi) for start, turn in motions]
    return np.array([[value[first - 1 : last].mean() for first, last in blocks] for value in values])


class ChiSquares(NamedTuple):
    """chi squared with a free offset and without, and that offset; (m,) each."""

    offset_free: Floats
    as_scaled: Floats
    offset: Floats


def chi_squares(predicted: ArrayLike, means: ArrayLike, standard_errors: ArrayLike) -> ChiSquares:
    """Compare predicted means (m, b) with printed ones (b,): squared differences in standard errors, summed.

    Examples
    --------
    >>> found = chi_squares([[1.0, 2.0], [1.0, 1.0]], [2.0, 3.0], [0.5, 0.5])
    >>> found.offset_free.tolist(), found.as_scaled.tolist(), found.offset.tolist()
    ([0.0, 2.0], [8.0, 20.0], [1.0, 1.5])
    """
    predicted, means, errors = (np.asarray(x, np.float64) for x in (predicted, means, standard_errors))
    offset = (means - predicted) @ (errors**-2 / np.sum(errors**-2))
    free = np.sum(((means - predicted - offset[:, None]) / errors) ** 2, axis=1)
    return ChiSquares(free, np.sum(((means - predicted) / errors) ** 2, axis=1), offset)
