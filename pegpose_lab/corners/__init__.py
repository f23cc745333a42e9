"""Corners of a checkerboard in an image: `find_corners`.

`find` has the steps, `grid` the search to a pixel, `fit` the sub-pixel fit, `whole_board` what makes a grid
the board that was asked for.  Another detector of corners is one file here.
"""

from .find import find_corners

__all__ = [
    "find_corners",
]
