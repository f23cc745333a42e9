"""Conversion between the chromosomes (f, T_z) in the box of Eq. 5 and the genes of the algorithm."""

import numpy as np

from ...checks import as_choice
from ...flags import Flag

BOX = 0.25
"""Half-width of stage 2's box, as a fraction of the linear f and T_z (Eq. 5)."""

OBLIQUE = 0.15
"""The valley is oblique to the magnification if that changes by more than this fraction along the floor in the box.  On
views of ordinary lenses it changes by 0.01 to 0.1; on a wide-angle view where it changes by 0.2, 17 of 60 runs stopped
up to 0.16 px above the optimum, and none with the gene along the floor."""

EDGE = 1e-3
"""A solution lies on the edge of the box if its distance from the edge is below this fraction of the box's width."""

OVERSHOOT = 1e3
"""Penalty, px, per width of the box by which a chromosome's f lies outside it."""


class _Genes:
    """Converts between the chromosomes (f, T_z) in the box of Eq. 5 and the genes of the algorithm.

    ``"printed"`` genes are (f, T_z) themselves.  ``"magnification"`` genes are (m, T_z) with
    m = f / (T_z + mean c_2), the magnification at the centroid of the points.  f and T_z lie in a valley
    that is narrow because m is well determined, and long because T_z is not; these genes are its axes.  The box is
    the same: m has the range that the box allows, f outside the box is clipped, and the clipped part is penalised.
    (Clipping alone would favour the corners of the box, because many values of m would give the same f there.)
    With a wide-angle lens the valley may be oblique to m; `follow` then replaces mean(c_2) by the offset for which
    f / (T_z + offset) is most nearly constant along the floor of the valley.
    If the optimum lies on the edge in f, it lies on an oblique ridge, which these genes climb slowly: with 25 seeds
    on each of 11 such simulated views, 225 of 275 runs end within 1e-4 px of it, and the worst 0.045 px above.
    """

    def __init__(self, form, linear, c2, box):
        form = as_choice(form, "genes", ("magnification", "printed"))
        centre = np.array([linear.camera.focal_length, linear.cam_from_object[0].translation[2]])
        half = box * np.abs(centre)
        self.form, self.lower, self.upper = form, centre - half, centre + half
        self._measure_from(c2.mean())

    def _measure_from(self, offset):
        """Take T_z + offset for the depth that belongs to f in the first gene."""
        centre = (self.lower + self.upper) / 2
        self.offset = offset
        self.smallest_depth = 0.1 * (centre[1] + offset)  # if the box reaches behind the camera
        printed = self.form == "printed"
        self.initial = centre if printed else np.array([centre[0] / self.depth(centre[1]), centre[1]])

    def follow(self, focal_lengths, t_z):
        """Turn the first gene along the floor of the valley, f (n,) at T_z (n,), if that is `OBLIQUE` to it."""
        inside = (focal_lengths > self.lower[0]) & (focal_lengths < self.upper[0])
        if self.form == "printed" or np.count_nonzero(inside) < 3:
            return
        slope, intercept = np.polyfit(t_z[inside], focal_lengths[inside], 1)
        ends = (slope * t_z + intercept) / self.depth(t_z)
        if np.ptp(ends) > OBLIQUE * np.mean(ends) and slope > 0 and intercept / slope + self.lower[1] > 0:
            self._measure_from(intercept / slope)

    @classmethod
    def stack(cls, codings):
        """Combine the codings of several runs into one, which takes genes (r, m, 2)."""
        both = object.__new__(cls)
        both.form = codings[0].form
        for name in ("lower", "upper", "offset", "smallest_depth"):
            setattr(both, name, np.stack([getattr(coding, name) for coding in codings])[:, None])
        return both

    def depth(self, t_z):
        """Depth of the points' centroid, mm (or T_z plus the offset of `follow`)."""
        return np.maximum(t_z + self.offset, self.smallest_depth)

    @property
    def bounds(self):
        """(2, 2) bounds of the genes."""
        if self.form == "printed":
            return np.column_stack([self.lower, self.upper])
        smallest = self.lower[0] / self.depth(self.upper[1])
        largest = self.upper[0] / self.depth(self.lower[1])
        return np.array([[smallest, largest], [self.lower[1], self.upper[1]]])

    def decode(self, genes):
        """Genes (..., 2) to chromosomes (f, T_z)."""
        if self.form == "printed":
            return genes
        focal_length = np.clip(self._focal_length(genes), self.lower[..., 0], self.upper[..., 0])
        return np.stack([focal_length, genes[..., 1]], axis=-1)

    def penalty(self, genes):
        """The penalty, px, for genes (..., 2) whose f was clipped."""
        if self.form == "printed":
            return np.zeros(genes.shape[:-1])
        focal_length, lower, upper = self._focal_length(genes), self.lower[..., 0], self.upper[..., 0]
        outside = np.maximum(lower - focal_length, focal_length - upper)
        return OVERSHOOT * np.maximum(outside, 0) / (upper - lower)

    def _focal_length(self, genes):
        return genes[..., 0] * self.depth(genes[..., 1])

    def flags(self, chromosome):
        """A flag if the chromosome lies on the edge of the box."""
        gap = np.minimum(chromosome - self.lower, self.upper - chromosome) / (self.upper - self.lower)
        names = [name for name, value in zip(("f", "T_z"), gap, strict=True) if value < EDGE]
        if not names:
            return ()
        box = ", ".join(
            f"{name} {low:.5g} to {high:.5g} mm"
            for name, low, high in zip(("f", "T_z"), self.lower, self.upper, strict=True)
        )
        text = (
            f"The solution sits on the edge of its box in {' and '.join(names)} (box: {box}): the best f may lie "
            "outside; widen the box, tilt the board more, or calibrate several views jointly."
        )
        return (Flag("edge-of-box", text),)
