"""Flags as texts that OpenCV's FileStorage gives back unchanged."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from urllib.parse import quote, unquote

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

UNSAFE = re.compile(r"""%(?=[0-9A-Fa-f]{2}|\Z)|[^ -~]|["\\]|\A[ ']| \Z""")
"""Characters that FileStorage does not read back as they were, or that would look like an escape: written as %XX."""

LONGEST_TEXT = 1000
"""Longest piece of a text: FileStorage cuts texts at 4096 characters, so longer ones are written in pieces, and each
piece except the last ends with %."""


def as_texts(flags: Iterable[str]) -> Iterator[str]:
    """Flags as texts that FileStorage reads back unchanged (see `UNSAFE` and `LONGEST_TEXT`)."""
    for flag in flags:
        text = UNSAFE.sub(lambda found: quote(found[0], safe="", errors="surrogatepass"), flag)
        while len(text) > LONGEST_TEXT:
            yield text[:LONGEST_TEXT] + "%"
            text = text[LONGEST_TEXT:]
        yield text


def from_texts(texts: Iterable[str]) -> tuple[str, ...]:
    """The flags that `as_texts` wrote."""
    flags, begun = [], ""
    for text in texts:
        if text.endswith("%"):
            begun += text[:-1]
        else:
            flags.append(unquote(begun + text, errors="surrogatepass"))
            begun = ""
    return tuple(flags)
