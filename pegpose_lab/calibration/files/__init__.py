"""Calibrations as files: OpenCV's FileStorage with everything, ROS's camera_info and other tools' files with the camera only.

A file's content tells its form, whatever its name.  Only numbers and text are read, and nothing in a file is executed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2

from ...checks import as_choice
from ...files import replacing
from .camera_info import as_camera_info, from_camera_info
from .storage import Nodes, as_storage, from_storage

if TYPE_CHECKING:
    from os import PathLike
    from typing import Any

    from ..result import Calibration

__all__ = ["read_calibration", "write_calibration"]


def write_calibration(path: str | PathLike[str], calibration: Calibration, form: str) -> None:
    """Write a calibration as `Calibration.save` documents."""
    form = as_choice(form, "form", ("opencv", "ros"))
    text = as_storage(calibration) if form == "opencv" else as_camera_info(calibration.camera)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_calibration(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the fields of a file's `Calibration` as a dictionary; raises as `Calibration.load` documents."""
    with open(path, encoding="utf-8-sig", errors="replace") as file:  # some editors begin a file with a byte-order mark
        text = file.read()
    try:
        return from_storage(_opened(text)) if _is_storage(text) else from_camera_info(text)
    except (cv2.error, SystemError, RecursionError) as error:
        raise ValueError(
            f"{path} is not a calibration: OpenCV cannot read it; it is damaged, or no such file"
        ) from error
    except (KeyError, TypeError, ValueError) as error:
        reason = error.args[0] if error.args else error  # a KeyError's own text has quotes
        raise ValueError(f"{path} is not a calibration that Calibration.save, OpenCV or ROS wrote: {reason}") from error


def _is_storage(text):
    """Whether it is OpenCV's FileStorage: XML, or YAML or JSON with matrices of its own type or the format we write."""
    begin = text.lstrip()[:200]
    if begin.startswith("<"):
        return True
    return begin.startswith(("%YAML", "{")) and ("opencv-matrix" in text or "\nformat:" in text or '"format"' in text)


def _opened(text):
    nodes = Nodes(text.lstrip())
    if not nodes.is_open:
        raise ValueError("it is XML, but not OpenCV's" if text.lstrip().startswith("<") else "OpenCV cannot read it")
    return nodes
