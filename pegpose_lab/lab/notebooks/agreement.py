"""Compares the outputs of two runs: words exactly, numbers to one unit of their last printed digit.

Another processor adds in another order, so the last printed digit may be rounded differently.  Numbers that have a
decimal point or an exponent in one of the texts are therefore compared as numbers.  Whole numbers are counts and
must be equal, like all other text.  The notebooks' tests (`testing`) and ``reproduce`` (`running`) both use this.
"""

from __future__ import annotations

import re
from decimal import Decimal
from pathlib import Path

import numpy as np

IMAGE_TOLERANCE = 6.0
"""Largest root mean square difference of two renderings of the same figure, in grey levels of 255.

A few different last digits in the titles of a small figure stay below it; a missing curve or label does not
(`test_agreement` tests both).  Data, labels and colours of a figure are compared by its digest.
"""

_NUMBER = re.compile(r"(?<![\w.])[-+\u2212]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\d.]*\.?\d)")
_SPACES = re.compile(r"[ \t]+")


def texts_agree(stored: str, fresh: str) -> bool:
    """Return whether two texts agree.

    Parameters
    ----------
    stored, fresh : str
        Plain text, HTML, CSV, LaTeX or Markdown.

    Returns
    -------
    bool
        True if all words, signs and whole numbers are equal, and every other number differs by at most one unit
        of the last digit in either text.  The width of white space is ignored, because table columns become wider
        with a sign or a digit.

    Examples
    --------
    >>> texts_agree("f = 47.95 mm from 3 views", "f = 47.96 mm from 3 views")
    True
    >>> texts_agree("f = 47.95 mm from 3 views", "f = 47.97 mm from 3 views")
    False
    >>> texts_agree("f = 47.95 mm from 3 views", "f = 47.95 mm from 4 views")
    False
    """
    if stored == fresh:
        return True
    if [_words(text) for text in _NUMBER.split(stored)] != [_words(text) for text in _NUMBER.split(fresh)]:
        return False
    return all(map(_numbers_agree, _NUMBER.findall(stored), _NUMBER.findall(fresh)))


def _words(text):
    """Text between two numbers, with white space reduced to single blanks."""
    return _SPACES.sub(" ", text)


def _numbers_agree(stored, fresh):
    """Whether two whole numbers are equal, or two other numbers differ by at most one unit of the finer last digit."""
    pair = [Decimal(text.replace("\u2212", "-")) for text in (stored, fresh)]
    whole = all(text.lstrip("-+\u2212").isdigit() for text in (stored, fresh))
    unit = 0 if whole else Decimal(1).scaleb(min(number.as_tuple().exponent for number in pair))
    return abs(pair[0] - pair[1]) <= unit


def files_agree(stored: Path, fresh: Path) -> bool:
    """Return whether two files of results agree.

    Parameters
    ----------
    stored, fresh : Path
        Two tables or texts, two figures (PNG, compared by `figure_digest` and by pixels), two animations (GIF, compared
        by their descriptions, times and pixels), or two files of any other kind, which must be equal byte by byte.  A
        missing file does not agree with any file.
    """
    stored, fresh = Path(stored), Path(fresh)
    if not (stored.is_file() and fresh.is_file()):
        return False
    contents = [path.read_bytes() for path in (stored, fresh)]
    if contents[0] == contents[1]:
        return True
    if stored.suffix == ".png":
        return _images_agree(stored, fresh)
    if stored.suffix == ".gif":
        return _animations_agree(stored, fresh)
    if stored.suffix in (".csv", ".tex", ".md"):
        return texts_agree(*(content.decode("utf-8") for content in contents))
    return False


def _images_agree(stored, fresh):
    """Whether two figures agree, by the digests stored in them and by their pixels."""
    from PIL import Image  # Pillow keeps the text stored in a PNG file

    try:
        with Image.open(stored) as one, Image.open(fresh) as other:
            digests = [image.info.get("Description", "") for image in (one, other)]
            pixels = [np.asarray(image.convert("RGB"), dtype=float) for image in (one, other)]
    except OSError:  # one of them is not an image, or is damaged
        return False
    return texts_agree(*digests) and _pixels_agree(*pixels)


def _animations_agree(stored, fresh):
    """Whether two animations agree, by their descriptions and times, and by the pixels of each frame."""
    from PIL import Image, ImageSequence

    try:
        with Image.open(stored) as one, Image.open(fresh) as other:
            if not texts_agree(*(image.info.get("comment", b"").decode("utf-8") for image in (one, other))):
                return False
            pairs = zip(ImageSequence.Iterator(one), ImageSequence.Iterator(other), strict=True)
            return all(
                frames[0].info.get("duration") == frames[1].info.get("duration")
                and _pixels_agree(*(np.asarray(frame.convert("RGB"), dtype=float) for frame in frames))
                for frames in pairs
            )
    except (OSError, ValueError, IndexError):  # damaged, or of different lengths
        return False


def _pixels_agree(stored, fresh):
    """Whether two images have one size and differ by no more than the tolerance."""
    return stored.shape == fresh.shape and bool(np.sqrt(np.mean(np.square(stored - fresh))) <= IMAGE_TOLERANCE)
