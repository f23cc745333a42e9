"""A pytest plugin that lets nbval compare the outputs of notebooks with `agreement.texts_agree`.

pyproject.toml loads it (``-p pegpose_lab.lab.notebooks.testing``), so plain ``pytest --nbval`` compares like the
command ``test``.  The rest of nbval is unchanged: every output must exist, in the same order and of the same kind.
"""

from __future__ import annotations

import pytest

from .agreement import texts_agree


class PrintedText(str):
    """An output's text; two texts are equal if they agree (see `texts_agree`)."""

    __slots__ = ()
    __hash__ = None  # equality is not transitive

    def __eq__(self, other):
        return texts_agree(str(self), str(other)) if isinstance(other, str) else NotImplemented

    def __ne__(self, other):
        return not self == other


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker that `processors` uses."""
    config.addinivalue_line("markers", "digits: compares computed digits with stored ones; run on emulated processors")


@pytest.hookimpl(tryfirst=True)  # before -m selects tests by markers
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let nbval read the outputs of every notebook cell as `PrintedText`, and mark all cells as tests of digits."""
    for item in items:
        if hasattr(item, "sanitize") and hasattr(item, "compare_outputs"):
            item.sanitize = _as_printed(item.sanitize)
            item.add_marker("digits")


def _as_printed(sanitize):
    """nbval's own step before a comparison, followed by ours."""

    def sanitized(text):
        text = sanitize(text)
        return PrintedText(text) if isinstance(text, str) else text

    return sanitized
