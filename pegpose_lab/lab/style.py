"""Colours, markers and sizes of every figure; a method has the same colour everywhere.

`COLORS` is the Okabe-Ito palette, which colour-blind readers can distinguish.
"""

COLORS = {
    "paper": "#000000",
    "truth": "#666666",
    "linear": "#E69F00",
    "genetic": "#D55E00",
    "zhang": "#0072B2",
    "joint": "#009E73",
    "oracle": "#CC79A7",
    "measured": "#56B4E9",
}

WHOLE_PIXELS = "#7FCFB9"
"""The joint calibration with circles in whole pixels: a shade of its colour."""

SERIES = ("#332288", "#CC6677", "#117733", "#AA9933", "#88CCEE", "#882255")
"""Colours of series that are not methods: views, tilts, pegs, readings (from Paul Tol's muted palette)."""

# Colour, marker and line style of each circle detector: a solid line for ours, dotted lines for the votes of
# `find_circles`, each in its own colour, dashed lines for other packages, one colour for each of them.
DETECTORS = {
    "ours": ("#009E73", "o", "-"),
    "find_circles two-stage": ("#882255", "s", ":"),
    "find_circles phase-code": ("#AA9933", "^", ":"),
    "find_circles accumulator": ("#332288", "v", ":"),
    "HoughCircles GRADIENT": ("#0072B2", "s", "--"),
    "HoughCircles GRADIENT, smoothed": ("#0072B2", "^", "--"),
    "HoughCircles GRADIENT_ALT": ("#0072B2", "v", "--"),
    "skimage hough_circle": ("#E69F00", "D", "--"),
    "SimpleBlobDetector": ("#56B4E9", "P", "--"),
    "contours + fitEllipse": ("#CC79A7", "X", "--"),
    "EdgeDrawing": ("#D55E00", "*", "--"),
}

DPI = 150
"""Resolution of a saved figure, pixels per inch; a notebook shows it at the style's 100."""

STYLE = {
    "figure.dpi": 100,
    "figure.constrained_layout.use": True,
    "font.size": 10,
    "axes.titlesize": 10,
    **dict.fromkeys(("axes.spines.top", "axes.spines.right"), False),
    "legend.frameon": False,
    "image.cmap": "gray",
    "lines.linewidth": 1.5,
    "pdf.fonttype": 42,
}
