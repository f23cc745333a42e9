"""What to say of a solution on the edge of its box."""

import numpy as np

from ...checks import CalibrationError
from ..joint.profile import profile_focal_length


def _edge_flags(coding, chromosome, allowed_f):
    """A sentence if the chromosome sits on the edge of the box, with what the view knows of f without a box.

    A wrong principal point moves f by more than the interval with it held says, so both intervals are told:
    `allowed_f` maps "fixed" and "free" to their words.
    """
    flags = coding.flags(chromosome)
    if not flags:
        return ()
    held, free = map(allowed_f, ("fixed", "free"))
    return (
        f"{flags[0]} Least squares of all parameters of this view (95 %, profile likelihood, this lens model): f is "
        f"{held} with this principal point, and {free} with the principal point free.",
    )


def _allowed_f(object_points, image_points, camera, principal_point):
    """The interval of f by its profile likelihood, in words."""
    try:
        low, high = profile_focal_length([object_points], [image_points], camera, principal_point=principal_point)
    except CalibrationError:
        return "not determined"
    if low == 0 or np.isinf(high):
        ends = [f"above {low:.5g} mm"] * (low > 0) + [f"below {high:.5g} mm"] * bool(np.isfinite(high))
        return ", ".join(["not determined", *ends])
    return f"{low:.5g} to {high:.5g} mm"
