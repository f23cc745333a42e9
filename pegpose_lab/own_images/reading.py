"""Any image file as 8-bit grey values on the sensor's own pixels, with what was done to it in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

DARKEST, BRIGHTEST = 0.1, 99.9  # percentiles of a 16-bit image that become 0 and 255
UNREAD = (".heic", ".heif", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raw")
"""Endings of a camera's files that OpenCV does not read."""

TAGGED = b"Exif"


@dataclass(frozen=True, eq=False)
class Picture:
    """An image as it is used.

    Attributes
    ----------
    image : (height, width) uint8 ndarray
    notes : tuple of str
        What was done to the file's pixels.

    Examples
    --------
    >>> Picture(np.zeros((4, 6), np.uint8)).size
    (6, 4)
    """

    image: NDArray[np.uint8]
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        height, width = self.image.shape
        return width, height


def read_picture(path: Path) -> Picture:
    """Read an image file: colour becomes grey, 16 bits become 8, and a rotation in the file's EXIF data is not applied.

    A camera's calibration holds for the pixels of its sensor: an image that was turned upright for viewing has another
    principal point.

    Raises
    ------
    ValueError
        If the file is no image that OpenCV can read; the message says so.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "deep.png")
    ...     _ = cv2.imwrite(str(path), np.linspace(0, 4095, 600).reshape(20, 30).astype(np.uint16))
    ...     picture = read_picture(path)
    >>> picture.size, picture.image.dtype, picture.notes
    ((30, 20), dtype('uint8'), ('16 bit, scaled to 8',))
    """
    if path.suffix.lower() in UNREAD:
        raise ValueError(f"files of the kind {path.suffix} are not read: convert it to PNG, TIFF or JPEG")
    content = np.fromfile(path, np.uint8)
    flags = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_GRAYSCALE
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        image = cv2.imdecode(content, flags | cv2.IMREAD_IGNORE_ORIENTATION) if content.size else None
        upright = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE) if image is not None and _may_be_turned(content) else None
    except cv2.error:
        image = None
    finally:
        cv2.utils.logging.setLogLevel(level)
    if image is None:
        raise ValueError("the file is empty" if not content.size else "the file is damaged, or of an unknown kind")
    notes = []
    if upright is not None and not _same(upright, image):
        notes.append("turned by EXIF: read as the sensor saw it")
    if image.dtype != np.uint8:
        notes.append("16 bit, scaled to 8" if image.dtype == np.uint16 else f"{image.dtype}, scaled to 8 bit")
        image = _to_8_bit(image)
    return Picture(image, tuple(notes))


def _may_be_turned(content):
    return TAGGED in content[:4096].tobytes()


def _same(upright, image):
    return upright.shape == image.shape and np.array_equal(upright[::16, ::16], _to_8_bit(image)[::16, ::16])


def _to_8_bit(image):
    if image.dtype == np.uint8:
        return image
    sample = image[:: max(1, image.shape[0] // 500), :: max(1, image.shape[1] // 500)].astype(float)
    low, high = (
        np.percentile(sample[np.isfinite(sample)], [DARKEST, BRIGHTEST]) if np.isfinite(sample).any() else (0, 1)
    )
    scaled = (image.astype(np.float32) - low) * (255 / max(high - low, 1e-9))
    return np.clip(np.rint(np.nan_to_num(scaled)), 0, 255).astype(np.uint8)
