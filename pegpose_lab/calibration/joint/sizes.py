"""What a view that does not fit may be: a picture of another size, a cropped one, or one with badly measured corners.

The camera of the other views is held.  If the view fits it after its pixels are scaled or shifted, that is named.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import CalibrationError
from .bundle import descend
from .candidates import in_pixels
from .homographies import linear_homographies, plane_rotations, poses_of
from .models.lens import Lens
from .richer import plain
from .views import State, Views, evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .fitting import Fit

FITS = 4.0
"""A view fits a changed camera if its variance is below this many times that of the other views."""

NOISY = 9.0
"""A view is noisy by itself if its own variance is more than this many times that of the other views."""

SCALES = (1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 1.0, 4 / 3, 3 / 2, 2.0, 3.0, 4.0)
"""Scales of a picture from which the searches start; pictures are halved and doubled, mostly."""

SAME_SIZE = 0.01
"""A picture has the size of the others if its scale is this near to 1."""


class Resized(Lens):
    """A known camera whose picture is scaled by s and shifted: u' = s (u + 1/2) - 1/2 + o (pixel centres at whole
    numbers).  `free` says which of s, o_x, o_y are estimated; the others are 1, 0, 0."""

    def __init__(self, fit, free):
        self.fit, self.columns = fit, np.flatnonzero(free)
        self.names = [("scale", "o_x", "o_y")[column] for column in self.columns]
        self.camera_parameters = fit.state.shared[: len(fit.model.lens_names)]

    def values(self, shared: NDArray[np.float64]) -> NDArray[np.float64]:
        values = np.array([1.0, 0.0, 0.0])
        values[self.columns] = shared
        return values

    def project(
        self, shared: NDArray[np.float64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """As `models.TsaiModel.project`."""
        scale, *shift = self.values(shared)
        projection = self.fit.model.project(self.camera_parameters, points)
        if projection is None or scale <= 0:
            return None
        image, _, by_point = projection
        by_shared = np.zeros((len(points), 2, 3))
        by_shared[:, :, 0] = image + 0.5
        by_shared[:, 0, 1] = by_shared[:, 1, 2] = 1
        return scale * (image + 0.5) - 0.5 + shift, by_shared[:, :, self.columns], scale * by_point


def fits_as(rest: Fit, object_points: NDArray[np.float64], image_points: NDArray[np.float64], noise: float) -> str:
    """In words, what makes a view fit the camera of the others, `rest`; "" if nothing does.

    `noise` is the sigma per axis of the view's corners by themselves (`noise.own_noise`).
    """
    views = Views.stack([object_points], [image_points])
    for free in ((True, False, False), (False, True, True), (True, True, True)):
        model = Resized(rest, free)
        found = _best(model, views, plane_rotations([object_points]))
        freedom = 2 * len(object_points) - 6 - sum(free)
        if found is None or freedom <= 0:
            continue
        scale, *shift = model.values(found[0].shared)
        if found[1] > FITS * rest.variance * freedom * max(scale, 1.0) ** 2:  # noise is scaled with the picture
            continue
        scale = min((*SCALES, scale), key=lambda usual: (abs(usual / scale - 1) > SAME_SIZE / 2, usual == scale))
        parts = []
        if abs(scale - 1) > SAME_SIZE:
            parts.append(f"scaled by {plain(1 / scale, 3)} (a picture of {plain(scale, 3)} times the size)")
        if np.hypot(*shift) > 1:
            parts.append(
                f"shifted by {plain(-shift[0], 3, True)} and {plain(-shift[1], 3, True)} px (a cropped picture)"
            )
        return f"with pixels {' and '.join(parts)}" if parts else ""
    if noise > np.sqrt(NOISY * rest.variance):
        return f"only to {plain(noise, 2)} px, the noise of their own corners: blurred, moved, or badly found"
    return ""


def _best(model, views, plane):
    """The state of a view at the least sum of squares, and that sum; None if no start sees all points."""
    focal, center, _ = in_pixels(model.fit)
    found = []
    for scale in SCALES if 0 in model.columns else (1.0,):
        target = ((views.image + 0.5) / scale - 0.5 - center) / focal
        rotations, positions = poses_of(linear_homographies(views, plane, target)[0], plane, 1.0)
        state = State(np.array([scale, 0.0, 0.0])[model.columns], rotations, positions)
        evaluated = evaluate(model, views, state)
        if evaluated is not None:
            found.append((np.sum((evaluated[0] * views.used[..., None]) ** 2), len(found), state))
    ends = []
    for _, number, state in sorted(found)[:3]:
        try:
            state, equations, _ = descend(model, views, state, views.used)
        except (CalibrationError, np.linalg.LinAlgError):
            continue
        ends.append((equations.cost, number, state))
    if not ends:
        return None
    cost, _, state = min(ends)
    return state, cost
