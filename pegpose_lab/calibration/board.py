r"""The shape of a calibration board that is not exactly the one of its drawing: bent, or with another aspect ratio.

In the board's plane, u and v run from -1 to 1 across all its points along x and y.  A bent board leaves the plane by

.. math:: w_x (1 - u^2) + w_y (1 - v^2) + t\, u v + b_x u (1 - u^2) + b_y v (1 - v^2)

mm along the plane's z axis, which points away from the camera for a board whose x runs right and y down.  The first two
terms are the warp of mrcal's board model, a bow of the whole board along x and along y.  The other three are its twist and
an S-shaped bend along each axis.  The aspect ratio stretches y about the board's middle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform

from ..checks import as_number, as_points
from .planes import FLAT, is_planar, plane_frame, relief

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

UNKNOWNS = {"warp": ("warp_x", "warp_y"), "bend": ("twist", "bend_x", "bend_y"), "aspect": ("aspect",)}
"""The unknowns of a board by the names of `calibrate_joint`, and their parameters: mm, except that aspect has no unit."""

FLAT_VALUES = {"aspect": 1.0}
"""The values of a board that is exact; 0 for the parameters that are not named."""

SMALLEST_PART = 1e-9
"""An unknown that moves points by less than this part of the board's half width moves none, but for rounding."""

FIRST_NOISE = 0.1
"""px: noise of the first fit with priors; later fits take that of the residuals."""


@dataclass(frozen=True, eq=False)
class BoardUnknowns:
    """The unknowns of a board in the bundle adjustment.

    `frame` is plane_from_object.  In the plane, the board's middle is `middle` (2,) and it reaches `half` (2,) from there,
    mm.  `sigmas` (q,) are those of the priors, infinite without one; `variance` is that of an image coordinate, px^2.
    """

    frame: RigidTransform
    middle: np.ndarray
    half: np.ndarray
    names: list[str]
    sigmas: np.ndarray
    variance: float = FIRST_NOISE**2

    @classmethod
    def of(
        cls, object_points: Sequence[NDArray[np.float64]], names: Sequence[str], sigmas: Sequence[float] | None = None
    ) -> BoardUnknowns | None:
        """The unknowns of the board that all views show; None if their points are not of one plane."""
        points = np.concatenate(object_points)
        if not is_planar(points):
            return None
        frame = plane_frame(points)
        in_plane = frame.apply(points)[:, :2]
        low, high = in_plane.min(axis=0), in_plane.max(axis=0)
        sigmas = np.full(len(names), np.inf) if sigmas is None else np.asarray(sigmas, np.float64)
        return cls(frame, (low + high) / 2, (high - low) / 2, list(names), sigmas)

    def also(self, names: Sequence[str]) -> BoardUnknowns:
        """The same board with these unknowns besides its own."""
        further = [name for name in names if name not in self.names]
        sigmas = np.concatenate([self.sigmas, np.full(len(further), np.inf)])
        return replace(self, names=self.names + further, sigmas=sigmas)

    @property
    def start(self) -> NDArray[np.float64]:
        """The values of an exact board, the means of the priors."""
        return np.array([FLAT_VALUES.get(name, 0.0) for name in self.names])

    @property
    def has_prior(self) -> bool:
        """Whether an unknown has a prior."""
        return bool(np.isfinite(self.sigmas).any())

    @property
    def prior_weights(self) -> NDArray[np.float64]:
        """Weights of the priors in units of squared residuals, px^2."""
        return self.variance / self.sigmas**2

    def bent(
        self, object_points: NDArray[np.float64], values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The points (..., 3) of the exact board on the board of these values, and the derivatives (..., 3, q)."""
        x, y, z = np.moveaxis(object_points @ self.frame.rotation.as_matrix().T + self.frame.translation, -1, 0)
        u, v = (x - self.middle[0]) / self.half[0], (y - self.middle[1]) / self.half[1]
        heights = {
            "warp_x": 1 - u * u,
            "warp_y": 1 - v * v,
            "twist": u * v,
            "bend_x": u * (1 - u * u),
            "bend_y": v * (1 - v * v),
        }
        by_values = np.zeros((*x.shape, 3, len(self.names)))
        for column, name in enumerate(self.names):
            if name == "aspect":
                by_values[..., 1, column] = y - self.middle[1]
            else:
                by_values[..., 2, column] = heights[name]
        back = self.frame.rotation.as_matrix().T
        by_values = back @ by_values
        return object_points + by_values @ (values - self.start), by_values


@dataclass(frozen=True, eq=False)
class BoardShape:
    """The estimated shape of a board (`calibration.board` has the equation).

    Attributes
    ----------
    unknowns : BoardUnknowns
        The board's plane and extent.
    values : dict of str to float
        warp_x, warp_y, twist, bend_x, bend_y, mm, and aspect, as far as they were estimated.
    statistic, probability : float
        F of the estimated values against an exact board (Hotelling's, where the sigmas are stated by the scatter between
        the views), and the probability of such an F or a larger one if the board is exact.

    Examples
    --------
    >>> import numpy as np
    >>> from pegpose_lab import Checkerboard, Sensor, calibrate_joint
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> camera = Sensor((0.01, 0.01), (319.5, 239.5), (640, 480)).camera(8.0, kappa1=0.001)
    >>> board, turns = Checkerboard().object_points, Rotation.from_rotvec(0.5 * np.eye(3))
    >>> poses = [RigidTransform.from_components([-90, -70, 500], turn) for turn in turns]
    >>> bowed = board + np.outer(0.2 * (1 - (board[:, 0] / 101.5 - 1) ** 2), [0, 0, 1])  # by 0.2 mm in its middle
    >>> images = [camera.project(bowed, pose) for pose in poses]
    >>> found = calibrate_joint([board] * 3, images, camera.sensor, board=("warp",)).board
    >>> round(found.values["warp_x"], 3), round(float(found.apply(board)[3:5, 2].mean()), 3)
    (0.2, 0.196)
    """

    unknowns: BoardUnknowns
    values: dict[str, float]
    statistic: float
    probability: float

    def apply(self, object_points: ArrayLike) -> NDArray[np.float64]:
        """Points (n, 3) of the exact board, mm, to where they are on this board: a measured board for any method."""
        points = as_points(object_points, 3, "object_points")
        return self.unknowns.bent(points, np.array([self.values[name] for name in self.unknowns.names]))[0]

    def __str__(self) -> str:
        shape = ", ".join(
            f"{name} = {value:.5f}" if name == "aspect" else f"{name} = {value:+.3f} mm"
            for name, value in self.values.items()
        )
        verdict = "fits better than" if self.probability < 0.01 else "fits no better than"
        return f"{shape}: this board {verdict} an exact one (F = {self.statistic:.3g}, p = {self.probability:.2g})"


def board_unknowns(
    object_points: Sequence[NDArray[np.float64]], board: Sequence[str] | Mapping[str, float]
) -> tuple[BoardUnknowns | None, float]:
    """The unknowns of the option ``board`` of `calibrate_joint`, and the relative sigma of the scale (0: exact).

    Raises
    ------
    ValueError
        If the option is unusable, or the views do not show one flat board.
    """
    if isinstance(board, str) or not np.iterable(board):
        raise ValueError(f"board is {board!r}; expected a sequence of {', '.join(UNKNOWNS)}, or a dictionary of priors")
    names, known = list(board), (*UNKNOWNS, "scale")
    if set(map(str, names)) - set(known) or len(set(names)) < len(names):
        raise ValueError(f"board is {board!r}; expected each once, of {', '.join(known)}")
    priors = dict(board) if isinstance(board, Mapping) else dict.fromkeys(names, np.inf)
    for name, sigma in priors.items():
        if sigma != np.inf:
            as_number(sigma, f"board[{name!r}]", 0, exclusive=True)
    scale = priors.pop("scale", 0.0)
    if scale == np.inf:
        raise ValueError(
            "board: the views do not tell the board's scale, for all positions grow with it and f does not change; "
            "measure a length across the board, and give its relative sigma, for example board={'scale': 5e-4}"
        )
    if not priors:
        return None, scale
    parameters = [(parameter, sigma) for name, sigma in priors.items() for parameter in UNKNOWNS[name]]
    unknowns = BoardUnknowns.of(object_points, *zip(*parameters, strict=True))
    if unknowns is None:
        points = np.concatenate(object_points)
        raise ValueError(
            f"object_points leave the plane through all views' points by {100 * relief(points):.2g} % of their width; "
            f"with unknowns of the board all views must show one board, flat to {100 * FLAT:g} %"
        )
    moved = np.abs(unknowns.bent(np.concatenate(object_points), unknowns.start)[1]).max(axis=(0, 1))
    for name, part in zip(unknowns.names, moved, strict=True):
        if part <= SMALLEST_PART * max(unknowns.half):
            raise ValueError(f"board: {name} moves no point of a board with so few rows or columns; leave it out")
    return unknowns, scale
