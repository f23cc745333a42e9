"""Whether two runs say the same: words to the letter, numbers to one unit of their last printed digit.

Another processor adds in another order, so the last digit that is printed may be rounded the other way.  Numbers
of which one text prints a decimal point or an exponent are therefore compared as numbers; whole numbers are counts, and
have to be equal like all other text.  The notebooks' tests (`testing`) and ``reproduce`` (`running`) both ask here.
"""

from __future__ import annotations

import re
from decimal import Decimal
from pathlib import Path

import numpy as np

IMAGE_TOLERANCE = 6.0
"""Largest root mean square difference of two renderings of one figure, in grey levels of 255.

Some last digits in the titles of a small figure stay below it, a curve or a label that is missing does not (both in
`test_agreement`); what data, labels and colours a figure has is compared by its digest.
"""

_NUMBER = re.compile(r"(?<![\w.])[-+\u2212]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\d.]*\.?\d)")
_SPACES = re.compile(r"[ \t]+")


def texts_agree(stored: str, fresh: str) -> bool:
    """Return whether two texts say the same.

    Parameters
    ----------
    stored, fresh : str
        Plain text, HTML, CSV, LaTeX or Markdown.

    Returns
    -------
    bool
        True if all words, signs and whole numbers are equal, and every other number differs by no more than one unit
        of the last digit that either text prints.  The width of white space does not count: columns of a table
        widen with a sign or a digit.

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
    """Text between two numbers, with white space of one width."""
    return _SPACES.sub(" ", text)


def _numbers_agree(stored, fresh):
    """Whether two printed numbers differ by at most one unit of the last digit of the finer one; whole numbers by none."""
    pair = [Decimal(text.replace("\u2212", "-")) for text in (stored, fresh)]
    whole = all(text.lstrip("-+\u2212").isdigit() for text in (stored, fresh))
    unit = 0 if whole else Decimal(1).scaleb(min(number.as_tuple().exponent for number in pair))
    return abs(pair[0] - pair[1]) <= unit


def files_agree(stored: Path, fresh: Path) -> bool:
    """Return whether two files of results say the same.

    Parameters
    ----------
    stored, fresh : Path
        Two tables or texts, two figures (PNG: what they draw, see `figure_digest`, and their pixels), or two files
        of any other kind, which have to be equal byte by byte.  A missing file agrees with none.
    """
    stored, fresh = Path(stored), Path(fresh)
    if not (stored.is_file() and fresh.is_file()):
        return False
    contents = [path.read_bytes() for path in (stored, fresh)]
    if contents[0] == contents[1]:
        return True
    if stored.suffix == ".png":
        return _images_agree(stored, fresh)
    if stored.suffix in (".csv", ".tex", ".md"):
        return texts_agree(*(content.decode("utf-8") for content in contents))
    return False


def _images_agree(stored, fresh):
    """Whether two figures draw the same, by the digests that they carry and by their pixels."""
    from PIL import Image  # matplotlib's own reader, which keeps the text in a file

    try:
        with Image.open(stored) as one, Image.open(fresh) as other:
            digests = [image.info.get("Description", "") for image in (one, other)]
            pixels = [np.asarray(image.convert("RGB"), dtype=float) for image in (one, other)]
    except OSError:  # one of them is no image, or damaged
        return False
    if pixels[0].shape != pixels[1].shape or not texts_agree(*digests):
        return False
    return bool(np.sqrt(np.mean(np.square(pixels[0] - pixels[1]))) <= IMAGE_TOLERANCE)
