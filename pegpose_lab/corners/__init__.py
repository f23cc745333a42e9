"""Corners of a checkerboard in an image: `find_corners`, and `locate_board` for boards that are seen in part.

`find` has the steps, `grid` the search to a pixel, `measure` the sub-pixel corners of a grid with the `fit` of each,
`whole_board` what makes a grid the board that was asked for.  For a part of a board, `grow` finds all corners that are
seen, `rims` what lies beyond them, `numbering` which corners of the board they are, and `part` has these steps.
Another detector of corners is one file here.
"""

from .find import find_corners, locate_board
from .result import BoardCorners

__all__ = [
    "BoardCorners",
    "find_corners",
    "locate_board",
]
