"""Controls over a picture that follows them."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import cv2
import ipywidgets
from IPython.display import Image, display

from ...checks import CalibrationError, DetectionError

if TYPE_CHECKING:
    from typing import Any

SHOWN_WIDTH = 800  # px, of every picture
FONT = cv2.FONT_HERSHEY_SIMPLEX


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
    caption : ipywidgets.HTML
        `text`, under the picture.
    text : str
    failed : bool
        Whether `text` is an error's.
    """

    def __init__(self, name, backdrop, draw, controls):
        self.name, self.controls, self._backdrop, self._draw = name, controls, backdrop, draw
        self.picture, self.caption = ipywidgets.Image(format="png", width=SHOWN_WIDTH), ipywidgets.HTML()
        self.refresh()
        for control in controls.values():
            control.observe(self.refresh, names="value")
        super().__init__([*controls.values(), self.picture, self.caption])

    def refresh(self, _change: Any = None) -> None:
        """Compute the picture from the controls' present values."""
        values = {name: control.value for name, control in self.controls.items()}
        picture = self._backdrop(**values).copy()
        try:
            self.text, self.failed = self._draw(picture, **values), False
        except (ValueError, DetectionError, CalibrationError) as error:
            picture = self._backdrop(**values) // 2
            self.text, self.failed = f"No result: {error}", True
        self.picture.value = _as_png(picture)
        self.caption.value = f'<pre style="white-space: pre-wrap">{html.escape(self.text)}</pre>'

    def __repr__(self):
        """Short and the same in every run: a notebook stores it beside the widget."""
        settings = ", ".join(f"{name} {control.value}" for name, control in self.controls.items())
        return f"{self.name}: {settings}"


def show(explorer: Explorer) -> None:
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
