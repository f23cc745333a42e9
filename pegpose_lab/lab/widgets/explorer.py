"""Controls over a picture that follows them."""

import textwrap

import cv2
import ipywidgets
import numpy as np
from IPython.display import Image, display

from ...checks import CalibrationError, DetectionError

SHOWN_WIDTH = 800  # px, of every picture
FONT, LINE_HEIGHT, TEXT_LINES, LINE_LENGTH = cv2.FONT_HERSHEY_SIMPLEX, 22, 3, 88


class Explorer(ipywidgets.VBox):
    """Controls over a picture that follows them.

    Parameters
    ----------
    name : str
    backdrop : callable
        Takes the controls' values by name; returns the (height, width, 3) uint8 picture, in OpenCV's order of
        colours, on which results are drawn.
    draw : callable
        Takes that picture and the values, draws the results into it and returns a text.  It may raise
        ValueError, DetectionError or CalibrationError: then the dimmed backdrop is shown with the error's text.
    controls : dict
        Name -> widget with a ``value``.

    Attributes
    ----------
    controls : dict
    picture : ipywidgets.Image
        Its ``value`` are the bytes of a PNG file.
    text : str
        What is written under the picture.
    failed : bool
        Whether `text` is an error's.
    """

    def __init__(self, name, backdrop, draw, controls):
        self.name, self.controls, self._backdrop, self._draw = name, controls, backdrop, draw
        self.picture = ipywidgets.Image(format="png", width=SHOWN_WIDTH)
        self.refresh()
        for control in controls.values():
            control.observe(self.refresh, names="value")
        super().__init__([*controls.values(), self.picture])

    def refresh(self, _change=None):
        """Compute the picture from the controls' present values."""
        values = {name: control.value for name, control in self.controls.items()}
        picture = self._backdrop(**values).copy()
        try:
            self.text, self.failed = self._draw(picture, **values), False
        except (ValueError, DetectionError, CalibrationError) as error:
            picture = self._backdrop(**values) // 2
            self.text, self.failed = f"No result: {error}", True
        self.picture.value = _as_png(np.vstack([picture, _text_strip(self.text, picture.shape[1])]))

    def __repr__(self):
        """Short and the same in every run: a notebook stores it beside the widget."""
        settings = ", ".join(f"{name} {control.value}" for name, control in self.controls.items())
        return f"{self.name}: {settings}"


def show(explorer):
    """Display an explorer, then its present picture as a PNG, and print its text.

    The picture and the text are stored in the notebook, so that they can be read without a kernel.
    """
    display(explorer)
    display(Image(data=bytes(explorer.picture.value), format="png", width=SHOWN_WIDTH))
    print(explorer.text)


# ---- controls ----


def _look():
    return {"style": {"description_width": "12em"}, "layout": {"width": f"{SHOWN_WIDTH}px"}}


def _slider(kind, description, value, low, high, *, step=1, live=True):
    """A slider; `live` ones follow the mouse, the others wait until it is released."""
    limits = {"min": low, "max": high, "step": step}
    return kind(value=value, description=description, continuous_update=live, **limits, **_look())


# ---- pictures; (x, y) px of the full image lies at scale * (x + 0.5) - 0.5 in the shown one ----


def _as_png(picture):
    return cv2.imencode(".png", picture)[1].tobytes()


def _text_strip(text, width):
    """A white strip with up to `TEXT_LINES` lines of text."""
    strip = np.full((TEXT_LINES * LINE_HEIGHT + 8, width, 3), 255, np.uint8)
    lines = [part for line in text.splitlines() for part in textwrap.wrap(line, LINE_LENGTH)]
    if len(lines) > TEXT_LINES:
        rest = " ".join(lines[TEXT_LINES - 1 :])
        lines = [*lines[: TEXT_LINES - 1], textwrap.shorten(rest, LINE_LENGTH, placeholder=" ...")]
    for number, line in enumerate(lines, 1):
        printable = line.encode("ascii", "replace").decode()
        cv2.putText(strip, printable, (8, number * LINE_HEIGHT), FONT, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return strip
