"""Sobel gradients, and edges one pixel wide."""

import cv2
import numpy as np


def _sobel(image):
    """Sobel gradient (dx, dy) of an image, border replicated."""
    return (
        cv2.Sobel(image, cv2.CV_16S, 1, 0, borderType=cv2.BORDER_REPLICATE),
        cv2.Sobel(image, cv2.CV_16S, 0, 1, borderType=cv2.BORDER_REPLICATE),
    )


class _Gradient:
    """Sobel gradient of an image, and its magnitude."""

    def __init__(self, image):
        self.dx, self.dy = _sobel(image)
        # not cv2.magnitude, whose last bit depends on where in memory its input lies; the sum of squares is exact
        self.magnitude = np.sqrt(np.square(self.dx, dtype=np.float32) + np.square(self.dy, dtype=np.float32))

    def threshold(self, request):
        """The gradient above which a pixel is an edge."""
        largest = float(self.magnitude.max())
        if request.edge_threshold is not None:
            return request.edge_threshold * largest
        scaled = cv2.convertScaleAbs(self.magnitude, alpha=255 / max(largest, 1.0))
        return cv2.threshold(scaled, 0, 255, cv2.THRESH_OTSU)[0] / 255 * largest


def _thin_edges(gradient, request):
    """Edge points one pixel wide: Canny's non-maximum suppression above the threshold, as bool."""
    threshold = gradient.threshold(request)
    edges = cv2.Canny(gradient.dx, gradient.dy, threshold, threshold, L2gradient=True)
    return (edges > 0) & (gradient.magnitude > threshold)
