"""Every public name has an example in its docstring, and every example of the package runs."""

import doctest
import importlib
import inspect

import pytest

import pegpose_lab
from pegpose_lab.files import PROJECT_FOLDER

PACKAGE = PROJECT_FOLDER / "pegpose_lab"
FACES = (
    "calibration", "camera", "circles", "corners", "discs", "handeye", "insertion", "patterns", "pegs", "pose", "render",
    "segmentation", "servo", "targets", "paper", "study", "own_images",
)  # fmt: skip
MODULES = sorted(
    ".".join(path.relative_to(PROJECT_FOLDER).with_suffix("").parts).removesuffix(".__init__")
    for path in PACKAGE.rglob("*.py")
    if "tests" not in path.parts and path.stem != "__main__" and ">>>" in path.read_text(encoding="utf-8")
)


def public():
    """{name: function or class} of the package and of the faces, without constants."""
    found = {name: getattr(pegpose_lab, name) for name in pegpose_lab.__all__}
    for face in FACES:
        module = importlib.import_module(f"pegpose_lab.{face}")
        names = getattr(module, "__all__", [name for name in pegpose_lab._HOME if pegpose_lab._HOME[name] == face])
        found |= {f"{face}.{name}": getattr(module, name) for name in names}
    shown = {name: thing for name, thing in found.items() if not name.startswith("study.write_")}  # for `measure` alone
    return {name: thing for name, thing in shown.items() if inspect.isfunction(thing) or inspect.isclass(thing)}


def test_every_public_name_has_an_example():
    assert len(public()) > 40
    without = {name for name, thing in public().items() if "\n    Examples\n" not in (thing.__doc__ or "")}
    assert not without


@pytest.mark.parametrize("module", MODULES)
def test_examples_run(module):
    found = doctest.testmod(importlib.import_module(module))
    assert found.attempted and not found.failed
