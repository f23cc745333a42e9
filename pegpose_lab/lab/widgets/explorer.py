"""Controls above an image that is updated when they change."""

from __future__ import annotations

import base64
import html
import time
from typing import TYPE_CHECKING

import cv2
import ipywidgets
from IPython.display import display

from ...checks import CalibrationError, DetectionError

if TYPE_CHECKING:
    from typing import Any

SHOWN_WIDTH = 800  # px, width of every image
SLOW = 0.3  # s; where an update took longer, a bar is shown during the next one
FONT = cv2.FONT_HERSHEY_SIMPLEX


class Explorer(ipywidgets.VBox):
    """Controls above an image that is updated when they change.

    Parameters
    ----------
    name : str
    backdrop : callable
        Takes the controls' values by name; returns the background of the results, a (height, width, 3) uint8 image
        in OpenCV's order of colours.
    draw : callable
        Takes that image and the values, draws the results into it and returns a text.  If it raises ValueError,
        DetectionError or CalibrationError, the dimmed backdrop is shown with the error's text.
    controls : dict
        Widgets with a ``value``, by name.

    Attributes
    ----------
    controls : dict
    picture : ipywidgets.Image
        Its ``value`` is the content of a PNG file.
    caption : ipywidgets.HTML
        `text`, above the image, so that it is seen while a control is moved.
    progress : ipywidgets.HTML
        A moving bar, seen while an update is computed after one that took longer than `SLOW`.
    text : str
    failed : bool
        Whether `text` is the message of an error.
    """

    def __init__(self, name, backdrop, draw, controls):
        self.name, self.controls, self._backdrop, self._draw = name, controls, backdrop, draw
        self.picture, self.caption = ipywidgets.Image(format="png", width=SHOWN_WIDTH), ipywidgets.HTML()
        bar = f'<progress style="width: {SHOWN_WIDTH}px; height: 6px" aria-label="computing"></progress>'
        self.progress = ipywidgets.HTML(bar, layout={"visibility": "hidden", "height": "8px"})
        self._slow = False
        self.refresh()
        for control in controls.values():
            control.observe(self.refresh, names="value")
        super().__init__([*controls.values(), self.caption, self.progress, self.picture])

    def refresh(self, _change: Any = None) -> None:
        """Compute the image from the controls' present values."""
        if self._slow:
            self.progress.layout.visibility = "visible"
        started = time.perf_counter()
        values = {name: control.value for name, control in self.controls.items()}
        picture = self._backdrop(**values).copy()
        try:
            self.text, self.failed = self._draw(picture, **values), False
        except (ValueError, DetectionError, CalibrationError) as error:
            picture = self._backdrop(**values) // 2
            self.text, self.failed = f"No result: {error}", True
        self.picture.value = _as_png(picture)
        self.caption.value = f'<pre style="white-space: pre-wrap">{html.escape(self.text)}</pre>'
        self._slow = time.perf_counter() - started > SLOW
        self.progress.layout.visibility = "hidden"

    def __repr__(self):
        """A short text that is the same in every run, because a notebook stores it with the widget."""
        settings = ", ".join(f"{name} {control.value}" for name, control in self.controls.items())
        return f"{self.name}: {settings}"


def show(explorer: Explorer) -> None:
    """Display an explorer; where no kernel runs, its first image and text in its place.

    All three are one output: JupyterLab shows the widget, and whoever only reads the notebook the image.
    """
    bundle = dict(explorer._repr_mimebundle_())
    bundle["image/png"] = base64.b64encode(explorer.picture.value).decode("ascii")
    bundle["text/plain"] = f"{explorer!r}\n{explorer.text}"
    display(bundle, metadata={"image/png": {"width": SHOWN_WIDTH}}, raw=True)


# ---- controls ----


def _look():
    return {"style": {"description_width": "12em"}, "layout": {"width": f"{SHOWN_WIDTH}px"}}


def _slider(kind, description, value, low, high, *, step=1, live=True):
    """A slider; a `live` one updates while the mouse moves, others when it is released."""
    limits = {"min": low, "max": high, "step": step}
    return kind(value=value, description=description, continuous_update=live, **limits, **_look())


# ---- images ----


def _as_png(picture):
    return cv2.imencode(".png", picture)[1].tobytes()
