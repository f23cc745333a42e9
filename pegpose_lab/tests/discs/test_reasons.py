"""Every reason that a fit can return is in the one table of them, and nothing else is."""

import ast
import re
from pathlib import Path

from pegpose_lab import discs
from pegpose_lab.discs import reasons


def _texts(node):
    return {part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)}


def _given(tree):
    """The texts that a module assigns to something called reasons, or hands to a fit."""
    given = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and any("reasons" in ast.unparse(target) for target in node.targets):
            given |= _texts(node.value)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "_Fit":
            given |= set().union(*map(_texts, node.args))
        elif isinstance(node, ast.keyword) and node.arg == "reason":
            given |= _texts(node.value)
    return given


def test_every_reason_that_is_given_is_in_the_vocabulary():
    sources = [path for path in Path(discs.__file__).parent.glob("*.py") if path.name != "reasons.py"]
    given = set().union(*(_given(ast.parse(path.read_text(encoding="utf-8"))) for path in sources))
    assert given - {""} == set(reasons.REASONS) and len(set(reasons.REASONS)) == len(reasons.REASONS)


def test_every_reason_is_explained():
    source = Path(reasons.__file__).read_text(encoding="utf-8")
    assert re.findall(r"^(\w[\w ]*?)  +(?:\* )?\w", source, re.MULTILINE) == list(reasons.REASONS)
