"""Which place of a ring is number 1: the marks, the frame before, or nothing."""

from dataclasses import dataclass

import numpy as np

from .design import SIGNS
from .edges import _refined
from .judge import _agreement
from .labels import _least_move, _leftmost

MARK_REACHES = (0.35, 0.2)  # of a mark's radius
MARK_SEEN = 0.5  # how much of a mark has to be there
MARK_MARGIN = 0.25  # by which the marks of one turn have to be clearer than those of another


@dataclass(frozen=True, eq=False)
class _Labels:
    """The chosen turn, the turns that are as possible (the first is the chosen one), and who decided."""

    turn: np.ndarray
    turns: list
    labelled_by: str
    marks: tuple
    seen: np.ndarray


def _rotation(design, turn):
    """The matrix (3, 3) that takes each of the design's places to place `turn` of it."""
    places = design.places @ (1, 1j)
    spin = (places[turn] * places.conj()).sum()
    spin /= abs(spin)
    return np.array([[spin.real, -spin.imag, 0], [spin.imag, spin.real, 0], [0, 0, 1.0]])


def _label(field, ring, design, pattern, previous, base):
    """The labels of a ring as `_Labels`.

    `base` is where the bore is and where the ring's plane has it: the marks may lie as deep as the bore.
    """
    turns, marks = design.turns, (np.empty((0, 2)), np.empty((0, 2, 2)), np.empty(0))
    if pattern.marks:
        depths = (None,) if base is None else (None, base)
        found = [_marks_seen(field, ring, design, pattern, turns, depth) for depth in depths]
        marks = max(found, key=lambda one: one[2].mean(axis=1).max())
        clear = marks[2]
    possible, by = np.arange(len(turns)), "nothing"
    if pattern.marks:
        worth = clear.mean(axis=1)
        if worth.max() >= MARK_SEEN:
            possible = np.flatnonzero(worth > worth.max() - MARK_MARGIN)
            by = "mark" if len(possible) == 1 else by
    centers = ring.plane.ellipses(design.places)[0]
    if len(possible) == 1:
        chosen, by = possible[0], "mark" if pattern.marks and clear.max() > 0 else by
    elif previous is not None:
        labelled = [centers[turns[i]] for i in possible]
        chosen, by = possible[_least_move(labelled, previous, "ring", "discs")], "previous frame"
    else:
        chosen = possible[_leftmost([centers[turns[i][0]] for i in possible])]
    if pattern.marks:
        marks = tuple(values[chosen] for values in marks)
    back = np.argsort(turns[chosen])
    rest = [back[turns[i]] for i in possible if i != chosen]
    rest = [] if by == "previous frame" else rest
    return _Labels(turns[chosen], [np.arange(len(back)), *rest], by, marks[:2], marks[2])


def _marks_seen(field, ring, design, pattern, turns, depth):
    """Centres (t, m, 2), shapes (t, m, 2, 2) of the marks in the picture after t turns, and how clear (t, m) they are."""
    places = np.array([mark.center for mark in pattern.marks])
    ratios = np.array([mark.radius for mark in pattern.marks]) / pattern.disc_radius
    signs = np.array([SIGNS[mark.polarity] for mark in pattern.marks])
    spots = np.concatenate(
        [(places - design.middle) / design.scale @ _rotation(design, turn)[:2, :2].T for turn in turns]
    )
    centers, shapes = ring.plane.ellipses(spots, ring.plane.radius * np.tile(ratios, len(turns)))
    if depth is not None:
        there, expected, ratio = depth
        centers, shapes = there + (centers - expected) * ratio, shapes * ratio
    own = _refined(field, centers, shapes, np.tile(signs, len(turns)), MARK_REACHES)
    seen = _agreement(centers, shapes, *own[:2]) * own[2]
    kept, size = seen > 0, (len(turns), len(places))
    found = np.where(kept[:, None], own[0], centers), np.where(kept[:, None, None], own[1], shapes)
    return found[0].reshape(*size, 2), found[1].reshape(*size, 2, 2), seen.reshape(size)
