"""The checked arguments of a search for circles, and the parts of the image to be searched."""

from dataclasses import dataclass

import numpy as np

from ..checks import as_choice, as_image, as_number, as_points

DETECTION_METHODS = {
    "two-stage": "two_stage",
    "phase-code": "phase_code",
    "accumulator": "volume",
    "multiscale": "multiscale",
}
"""The registry: a method's name, and the file here whose ``find(window, request)`` returns rows x, y, r, score."""

POLARITIES = ("bright", "dark")


@dataclass(frozen=True)
class _Request:
    """The checked arguments of a search."""

    r_min: float
    r_max: float
    method: str
    sign: float
    sensitivity: float
    edge_threshold: float | None


# ---------------------------------------------------------------------------------------------------- input


def _as_grey(image):
    """The image as uint8; a mask becomes 0 and 255."""
    if isinstance(image, np.ndarray) and image.dtype == bool:
        image = image.astype(np.uint8) * 255
    return as_image(image)


def _as_request(radius_range, method, polarity, sensitivity, edge_threshold):
    """Check everything but the image and the regions."""
    try:
        r_min, r_max = radius_range
    except (TypeError, ValueError) as error:
        raise ValueError(f"radius_range is {radius_range!r}; expected a pair (r_min, r_max) in px") from error
    r_min = as_number(r_min, "radius_range[0]", 0.0, 1e5, exclusive=True)
    r_max = as_number(r_max, "radius_range[1]", r_min, 1e5)
    method, polarity = as_choice(method, "method", DETECTION_METHODS), as_choice(polarity, "polarity", POLARITIES)
    sensitivity = as_number(sensitivity, "sensitivity", 0.0, 1.0)
    if edge_threshold is not None:
        edge_threshold = as_number(edge_threshold, "edge_threshold", 0.0, 1.0)
    return _Request(r_min, r_max, method, 1.0 if polarity == "bright" else -1.0, sensitivity, edge_threshold)


def _windows(shape, regions, request):
    """The parts of the image to search, as x0, y0, x1, y1."""
    height, width = shape
    if regions is None:
        return [(0, 0, width, height)]
    boxes = as_points(np.reshape(regions, (0, 4)) if np.size(regions) == 0 else regions, 4, "regions", 0)
    boxes = boxes[boxes[:, 2:].max(axis=1, initial=0) >= request.r_min]
    margin = request.r_max / 4 + 4
    low = np.clip(np.floor(boxes[:, :2] - margin), 0, [width, height])
    high = np.clip(np.ceil(boxes[:, :2] + boxes[:, 2:] + margin), 0, [width, height])
    windows = np.unique(np.hstack([low, high]).astype(int), axis=0)
    return [tuple(window) for window in windows if (window[2:] > window[:2]).all()]


# ----------------------------------------------------------------------------------------------- multiscale


def _least_score(request):
    """The smallest fraction of a circle's edge that must be seen."""
    return 1.55 - request.sensitivity
