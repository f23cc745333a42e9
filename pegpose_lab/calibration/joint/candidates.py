"""Richer models than the fitted one, of the lens and of the board, and the derivatives by what they add."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..board import UNKNOWNS, BoardUnknowns
from .models import COEFFICIENTS, EQUIDISTANT, RATIONAL, FisheyeModel, OpenCVModel, TsaiModel, lens_model
from .views import evaluate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .fitting import Fit

FINE_RADIAL = ("r8", "r10", "r12")
"""Powers of the radius beyond k3, which tell of a rational or equidistant lens: near 0, k4 to k6 act as k1 to k3 do."""

PATTERN = tuple(f"pattern_{order}" for order in range(8))
"""A radial shift by further powers of the radius, as Legendre polynomials: it follows three rings of a pattern."""

WARPED, BENT = UNKNOWNS["warp"], (*UNKNOWNS["warp"], *UNKNOWNS["bend"])


@dataclass(frozen=True)
class Candidate:
    """A richer model: what the flag calls it, and the names of the columns that it adds (or that stand for them).

    `model` is None if there is none here; `nested` tells whether the fitted model is a special case of it; `of_board`
    whether it is the board that differs.
    """

    words: str
    model: TsaiModel | OpenCVModel | FisheyeModel | None
    columns: tuple[str, ...]
    nested: bool = True
    of_board: bool = False


def candidates_for(fit: Fit, object_points: Sequence[NDArray[np.float64]]) -> list[Candidate]:
    """The richer models that a fit is compared with; their searches start at its principal point, if it is in the image."""
    model, center = copy(fit.model), in_pixels(fit)[1]
    if model.free_center and np.all((center > 0) & (center < model.sensor.image_size)):
        model.sensor = replace(model.sensor, principal_point=tuple(center))
    return [*_of_lens(model), *_of_pixels(model), *_of_board(model, object_points)]


def _richer(model, coefficients=None, lens=None, two=None, free_center=None):
    """The lens model with other options, and the same board."""
    lens = ("equidistant" if isinstance(model, FisheyeModel) else "perspective") if lens is None else lens
    coefficients = model.coefficient_names if coefficients is None else coefficients
    two, free_center = (model.two if two is None else two), (model.free_center if free_center is None else free_center)
    return lens_model(model.sensor, free_center, two, coefficients, lens).on(model.board)


def _of_lens(model):
    if isinstance(model, FisheyeModel):
        return _of_fisheye(model)
    named = model.coefficient_names
    known = ("k1",) if named is None else named  # kappa1 undistorts, but has nearly the effect of k1
    missing = [name for name in ("k1", "k2", "k3") if name not in known]
    found = []
    for number in range(1, len(missing) + 1):
        radial = tuple(name for name in COEFFICIENTS if name in (*known, *missing[:number]))
        rational = tuple(name for name in RATIONAL if name in (*known, *radial))
        found.append(Candidate(f"distortion by {', '.join(rational)}", _richer(model, rational), (*missing[:number],)))
    for last in ("k4", "k6"):  # all six are often more than the views determine
        wanted = ("k1", "k2", "k3", "k4") if last == "k4" else RATIONAL[:2] + RATIONAL[4:]
        whole = tuple(name for name in RATIONAL if name in (*known, *wanted))
        if last not in known:
            words = f"rational distortion by {', '.join(whole)}"
            columns = (*missing, *FINE_RADIAL[: 1 if last == "k4" else 3])
            found.append(Candidate(words, _richer(model, whole), columns))
    words = "an equidistant (fisheye) lens"
    found.append(Candidate(words, _richer(model, EQUIDISTANT, "equidistant"), (*missing, *FINE_RADIAL), nested=False))
    if not missing:
        found.append(Candidate("a radial pattern that none of the models here has,", None, PATTERN))
    if not {"p1", "p2"} & set(known):
        base = missing[:1] if named is None else []  # k1 alone may fit worse than kappa1
        tangential = tuple(name for name in RATIONAL if name in (*known, *base, "p1", "p2"))
        words = f"distortion by {', '.join(tangential)}"
        found.append(Candidate(words, _richer(model, tangential), (*base, "p1", "p2")))
    return found


def _of_fisheye(model):
    missing = tuple(name for name in EQUIDISTANT if name not in model.coefficient_names)
    found = []
    if missing:
        found.append(
            Candidate(f"an equidistant lens with {', '.join(EQUIDISTANT)}", _richer(model, EQUIDISTANT), missing)
        )
    gate = (*missing, *PATTERN)
    tangential = ("p1", "p2")
    for coefficients in (("k1", "k2"), ("k1", "k2", "k3"), ("k1", "k2", *tangential), ("k1", "k2", *tangential, "k3")):
        words, columns = f"a perspective lens with {', '.join(coefficients)}", gate
        if "p1" in coefficients:
            columns = (*gate, *tangential)
        found.append(Candidate(words, _richer(model, coefficients, "perspective"), columns, nested=False))
    if not missing:
        found.append(Candidate("a radial pattern that none of the models here has,", None, PATTERN))
    found.append(Candidate("a tangential pattern, which no equidistant lens here has,", None, tangential))
    return found


def _of_pixels(model):
    found = []
    if not model.two:
        found.append(Candidate("f_x and f_y apart", _richer(model, two=True), ("f_y",)))
    if not model.free_center:
        found.append(Candidate("a free principal point", _richer(model, free_center=True), ("c_x", "c_y")))
    words = "pixels whose rows and columns are not perpendicular (skew), which no camera here has,"
    return [*found, Candidate(words, None, ("skew",))]


def _of_board(model, object_points):
    """A bent board, one that is bent otherwise, and one of another aspect ratio; none if the views show no one plane."""
    board = model.board if model.board else BoardUnknowns.of(object_points, ())
    if board is None:
        return []
    found = []
    for words, names in (
        ("a bent board", WARPED),
        ("a board bent otherwise (five terms)", BENT),
        ("a board of another aspect ratio", UNKNOWNS["aspect"]),
    ):
        further = tuple(name for name in names if name not in board.names)
        if further:
            found.append(Candidate(words, model.on(board.also(names)), further, of_board=True))
    return found


def further_columns(fit: Fit, candidates: Sequence[Candidate]) -> dict[str, NDArray[np.float64]]:
    """Derivatives (V m, 2) of the image points by all that the candidates add, by name."""
    turned = fit.views.points @ fit.state.rotations.transpose(0, 2, 1) + fit.state.positions[:, None]
    points = turned.reshape(-1, 3)  # of the exact board: a bend of tenths of a mm changes no column
    focal, center, coefficients = in_pixels(fit)
    kind = FisheyeModel if isinstance(fit.model, FisheyeModel) else OpenCVModel
    model = kind(fit.model.sensor, True, True, kind.every)
    by_shared = model.project(model.values(focal, center, coefficients), points)[1]
    columns = {name: by_shared[:, :, index] for index, name in enumerate(model.names) if name != "f_x"}
    image = (evaluate(fit.model, fit.views, fit.state)[0] + fit.views.image).reshape(-1, 2)
    x, y = ((image - center) / focal).T
    r2 = x * x + y * y
    columns["skew"] = np.column_stack([y, np.zeros_like(y)])
    normalized = points[:, :2] / points[:, 2:]
    radius = np.hypot(*normalized.T)[:, None]
    if kind is FisheyeModel:
        columns["p1"] = np.column_stack([2 * x * y, r2 + 2 * y * y])
        columns["p2"] = np.column_stack([r2 + 2 * x * x, 2 * x * y])
        own, first = np.arctan(radius), len(EQUIDISTANT) + 1
    else:
        for power, name in enumerate(FINE_RADIAL, start=1):
            columns[name] = columns["k3"] * radius ** (2 * power)
        own, first = radius, 4  # f, k1, k2 and k3 are the first ones
    farthest = max(own[fit.views.used.ravel() > 0].max(), 1e-300)
    along = normalized / np.where(radius > 0, radius, 1) * own
    legendre = np.polynomial.legendre.legvander(
        np.minimum(2 * (own[:, 0] / farthest) ** 2 - 1, 1), first + len(PATTERN)
    )
    for order, name in enumerate(PATTERN, start=first):
        columns[name] = along * legendre[:, order, None]
    boards = [candidate.model for candidate in candidates if candidate.of_board]
    if boards:
        board = boards[0].board.also(
            [name for candidate in candidates for name in candidate.columns if candidate.of_board]
        )
        values = [*fit.state.shared, *board.start[len(fit.model.board.names) if fit.model.board else 0 :]]
        state = type(fit.state)(np.array(values), fit.state.rotations, fit.state.positions)
        jacobian = evaluate(fit.model.on(board), fit.views, state)[1]
        for index, name in enumerate(fit.model.on(board).names):
            if name in board.names:
                columns[name] = jacobian[..., index].reshape(-1, 2)
    return columns


def in_pixels(fit: Fit) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """f_x and f_y, the principal point, and the coefficients (zeros for a model with kappa1)."""
    if isinstance(fit.model, TsaiModel):
        camera = fit.model.camera(fit.state.shared)
        zeros = np.zeros(len(RATIONAL))
        return camera.focal_length * camera.pixels_per_mm, np.array(camera.principal_point), zeros
    return fit.model.split(fit.state.shared)
