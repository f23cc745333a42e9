"""Board, part, ring and wheel from the values of a description: nothing is taken for granted, and mistakes are named."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from ..checks import as_number
from ..insertion import Wheel, as_pair
from ..patterns import RingPattern
from ..targets import Checkerboard, Hub

if TYPE_CHECKING:
    from typing import Any

NEEDED = {
    Checkerboard: ("columns", "rows", "square"),
    Hub: ("n_pegs", "pitch_circle_diameter", "peg_radius"),
    RingPattern: ("disc_radius",),
    Wheel: ("clearance",),
}
"""Measures that must be given: a value that fits the paper's hub would be wrong for another part."""

SHOWN = {
    Checkerboard: "{columns: 8, rows: 6, square: 29.0}",
    Hub: "{n_pegs: 4, pitch_circle_diameter: 97.05, peg_radius: 10.1}",
    RingPattern: "{n: 4, pitch_radius: 48.5, disc_radius: 10.1}",
    Wheel: "{clearance: 0.1}",
}
LEAST = 0.2  # mm, of a square and of a part: what is smaller was given in metres
UNITS = 100.0  # ratio of part and board beyond which one of them must be in another unit


def board_of(values: Any) -> Checkerboard:
    """The board; ValueError that names what is missing or unusable."""
    return _made(Checkerboard, values, "board")


def part_of(values: Any) -> Hub:
    """A part with equally spaced pegs; ValueError as `board_of`."""
    return _made(Hub, values, "part")


def ring_of(values: Any) -> RingPattern:
    """A ring of discs; ValueError as `board_of`, and if angles are in degrees."""
    angles = values.get("angles") if isinstance(values, dict) else None
    if isinstance(angles, (list, tuple)) and any(
        isinstance(one, (int, float)) and abs(one) > 2 * np.pi + 0.01 for one in angles
    ):
        raise ValueError(f"ring: angles are in radians, and {max(angles, key=abs):g} is more than a turn")
    if isinstance(values, dict) and values.get("centers") is None and values.get("pitch_radius") is None:
        raise ValueError(
            f"ring lacks pitch_radius (with n or angles) or centers; expected its measures, such as {SHOWN[RingPattern]}"
        )
    return _made(RingPattern, values, "ring")


def wheel_of(values: Any, part: Hub | RingPattern | None) -> Wheel:
    """The wheel for a part with pegs: its holes lie where the pegs are, if nothing else is said."""
    if not isinstance(part, Hub):
        raise ValueError(
            f"wheel needs a part with equally spaced pegs, such as part: {SHOWN[Hub]}; a ring has no forecast"
        )
    fits = {"n_holes": part.n_pegs, "pitch_circle_diameter": part.pitch_circle_diameter}
    wheel = _made(Wheel, fits | values if isinstance(values, dict) else values, "wheel")
    as_pair(part, wheel)
    return wheel


def names_of(values: Any) -> tuple[str, ...]:
    """Names of the lens's coefficients."""
    if not isinstance(values, (list, tuple)) or not all(isinstance(one, str) for one in values):
        raise ValueError(f"coefficients is {values!r}; expected names, such as [k1, k2, p1, p2]")
    return tuple(values)


def radii_of(pair: Any) -> tuple[float, float]:
    """Smallest and largest radius, px."""
    if not isinstance(pair, (list, tuple)) or len(pair) != 2:
        raise ValueError(f"radius_range is {pair!r}; expected [smallest, largest] in px")
    low = as_number(pair[0], "radius_range[0]", 0, exclusive=True)
    return low, as_number(pair[1], "radius_range[1]", low, 1e5)


def in_one_unit(board: Checkerboard | None, part: Hub | RingPattern | None) -> None:
    """ValueError if part and board differ so much in size that one of them is in another unit."""
    if board is not None and board.square < LEAST:
        raise ValueError(f"board: a square of {board.square:g} mm is too small to be seen: give its side in mm")
    if part is None:
        return
    across = part.pitch_circle_diameter if isinstance(part, Hub) else 2 * np.hypot(*part.places.T).max()
    if across < LEAST:
        raise ValueError(f"the part is {across:g} mm across, too small to be seen: give its measures in mm")
    if board is None:
        return
    wide = np.hypot(board.columns, board.rows) * board.square
    if not 1 / UNITS < across / wide < UNITS:
        raise ValueError(
            f"the part is {across:g} across and the board {wide:g}: give both in mm, for poses are in the board's unit"
        )


def _made(kind, values, name):
    """A board, hub, ring or wheel of the values; ValueError that names the key."""
    if not isinstance(values, dict):
        raise ValueError(f"{name} is {values!r}; expected its measures, such as {SHOWN[kind]}")
    allowed = [field.name for field in fields(kind) if field.init]
    unknown = [key for key in values if key not in allowed]
    if unknown:
        raise ValueError(f"{name} has a key that is not known, {unknown[0]}; expected some of {', '.join(allowed)}")
    missing = [key for key in NEEDED[kind] if values.get(key) is None]
    if missing:
        raise ValueError(f"{name} lacks {missing[0]}; expected its measures in mm, such as {SHOWN[kind]}")
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from error
