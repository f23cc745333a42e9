"""nbval with numbers: a pytest plugin that compares the outputs of notebooks as `agreement.texts_agree` does.

pyproject.toml loads it (``-p pegpose_lab.lab.notebooks.testing``), so that plain ``pytest --nbval`` compares like the
command ``test``.  Nothing else of nbval changes: every output has to be there, in its order, of its kind.
"""

from __future__ import annotations

import pytest

from .agreement import texts_agree


class PrintedText(str):
    """An output's text; two are equal if they say the same."""

    __slots__ = ()
    __hash__ = None  # equality is not transitive

    def __eq__(self, other):
        return texts_agree(str(self), str(other)) if isinstance(other, str) else NotImplemented

    def __ne__(self, other):
        return not self == other


def pytest_configure(config: pytest.Config) -> None:
    """Make the mark known that `processors` asks for."""
    config.addinivalue_line("markers", "digits: compares computed digits with stored ones; run on emulated processors")


@pytest.hookimpl(tryfirst=True)  # before -m chooses by the marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let nbval read the outputs of every notebook cell as `PrintedText`; all cells are tests of digits."""
    for item in items:
        if hasattr(item, "sanitize") and hasattr(item, "compare_outputs"):
            item.sanitize = _as_printed(item.sanitize)
            item.add_marker("digits")


def _as_printed(sanitize):
    """nbval's own step before it compares a text, followed by ours."""

    def sanitized(text):
        text = sanitize(text)
        return PrintedText(text) if isinstance(text, str) else text

    return sanitized
