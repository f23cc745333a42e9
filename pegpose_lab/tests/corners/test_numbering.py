"""Which part of a board a grid is: every cut of small boards, with what its sides show."""

import numpy as np
import pytest

from pegpose_lab.corners.numbering import ENDS, GOES_ON, UNKNOWN, numberings
from pegpose_lab.targets import Checkerboard


def order_of(board):
    return np.arange(board.columns * board.rows).reshape(board.rows, board.columns)


def turns_alike(board):
    """The turns of a board that keep shape and colours."""
    turns = range(4) if board.columns == board.rows else (0, 2)
    dark = np.indices((board.rows - 1, board.columns - 1)).sum(axis=0) % 2 == 0
    return [turn for turn in turns if (np.rot90(dark, turn) == dark).all()]


@pytest.mark.parametrize("shape", [(6, 4), (5, 4), (5, 5), (4, 4), (5, 3)])
@pytest.mark.parametrize("unknown", [False, True])
def test_the_true_numbering_is_always_among_them(shape, unknown):
    """Cuts of all sizes at all places, seen at all turns; with all sides known it is the only one."""
    board, rng = Checkerboard(*shape), np.random.default_rng(0)
    order = order_of(board)
    dark = np.indices((board.rows, board.columns)).sum(axis=0) % 2 == 0
    for top, left in np.ndindex(board.rows - 2, board.columns - 2):
        for rows, columns in np.ndindex(board.rows - top - 2, board.columns - left - 2):
            part = slice(top, top + rows + 3), slice(left, left + columns + 3)
            ends = top == 0, part[1].stop == board.columns, part[0].stop == board.rows, left == 0
            for turn in range(4):
                seen, first = np.rot90(order[part], turn), np.rot90(dark[part][:-1, :-1], turn)[0, 0]
                sides = [ENDS if ends[(side + turn) % 4] else GOES_ON for side in range(4)]
                if unknown:
                    sides = [UNKNOWN if rng.random() < 0.5 else side for side in sides]
                classes = numberings(board, seen.shape, sides, first)
                assert any((number == seen).all() for numbers in classes for number in numbers)
                if not unknown and all(ends):
                    assert len(classes) == 1 and len(classes[0]) == len(turns_alike(board))


def test_three_rims_determine_a_cut_board():
    board = Checkerboard(9, 6)
    classes = numberings(board, (4, 9), (ENDS, ENDS, UNKNOWN, ENDS), True)
    assert len(classes) == 1 and (classes[0][0] == order_of(board)[:4]).all()


def test_two_opposite_rims_do_not():
    assert len(numberings(Checkerboard(9, 6), (5, 9), (UNKNOWN, ENDS, UNKNOWN, ENDS), True)) == 2


def test_a_corner_of_the_board_is_not_enough_where_columns_may_be_rows():
    sides = ENDS, UNKNOWN, UNKNOWN, ENDS
    assert len(numberings(Checkerboard(9, 6), (6, 7), sides, True)) == 1  # seven columns or more: no rows
    assert len(numberings(Checkerboard(8, 6), (4, 4), sides, True)) == 2


def test_colours_are_not_trusted_where_they_do_not_tell_turns_apart():
    """A board of 8 x 6 may be printed with light and dark exchanged."""
    sides = ENDS, ENDS, ENDS, ENDS
    assert all(len(numberings(Checkerboard(8, 6), (6, 8), sides, dark)) == 1 for dark in (True, False))


@pytest.mark.parametrize("shape, sides", [((7, 9), (UNKNOWN,) * 4), ((5, 9), (ENDS,) * 4), ((6, 9), (GOES_ON,) * 4)])
def test_no_part_of_the_board(shape, sides):
    assert numberings(Checkerboard(9, 6), shape, sides, True) == []
