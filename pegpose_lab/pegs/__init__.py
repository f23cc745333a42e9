"""Labelled pegs of a hub, or discs of any ring, in an image, and in one frame after another: `locate_pegs`, `track_pegs`.

For a `Hub` the steps are `candidates`, `rings`, `labels` and `measure`, with `hidden` for a peg that is not seen; `locate`
and `track` lead through them.  A new
rule for the labels belongs in `labels`.  With a frame before it, `moved` finds the discs' motion, and `follow` (of a ring
`search`) measures them there.

For a `RingPattern` (in the form of `design`) `ring` leads through these:

=============  ==============================================================================================
edges          the gradient across outlines, whatever the contrast; ellipses drawn to it
seeds          ellipses in the picture and its logarithm: Hough circles, and connected parts at many grey levels
consensus      two seeds of like size give the pattern's affine image; the others vote, and give the perspective
plane          homography and one radius, fitted to the edges of all discs together
judge, search  how much of each place is there; the rings, the best first; the ring near that of the frame before
places         measured, partial, missing or contradicted; centre and covariance
turns          the labels: marks, the frame before, or nothing
=============  ==============================================================================================
"""

from .locate import locate_pegs
from .measure import PegObservation
from .track import LostFrame, largest_turn, track_pegs

__all__ = [
    "LostFrame",
    "PegObservation",
    "largest_turn",
    "locate_pegs",
    "track_pegs",
]
