"""What is packaged, and the rules of style that every file passes."""

import fnmatch
import importlib.util
import json
import re
import subprocess
import sys
import tomllib

import pytest

import pegpose_lab
from pegpose_lab.files import PROJECT_FOLDER

PACKAGE = PROJECT_FOLDER / "pegpose_lab"
SETTINGS = tomllib.loads((PROJECT_FOLDER / "pyproject.toml").read_text(encoding="utf-8"))


def test_every_folder_with_code_is_packaged():
    """setuptools finds every folder whose name the settings include; outside of the tests each has a docstring."""
    folders = {path.parent for path in PACKAGE.rglob("*.py")}
    names = {".".join(folder.relative_to(PROJECT_FOLDER).parts) for folder in folders}
    rooms = [folder for folder in folders if "tests" not in folder.parts]
    assert [str(folder) for folder in rooms if not (folder / "__init__.py").exists()] == []
    assert SETTINGS["tool"]["setuptools"]["packages"]["find"].get("namespaces", True)
    patterns = SETTINGS["tool"]["setuptools"]["packages"]["find"]["include"]
    assert [name for name in names if not any(fnmatch.fnmatch(name, pattern) for pattern in patterns)] == []


def test_files_other_than_code_are_packaged():
    data = SETTINGS["tool"]["setuptools"]["package-data"]
    for path in PACKAGE.rglob("*"):
        if path.is_file() and path.suffix not in (".py", ".pyc") and "__pycache__" not in path.parts:
            listed = {
                found
                for package, patterns in data.items()
                for pattern in patterns
                for found in PROJECT_FOLDER.joinpath(*package.split(".")).glob(pattern)
            }
            assert path in listed, path


def test_the_version_is_stated_once_more():
    citation = (PROJECT_FOLDER / "CITATION.cff").read_text(encoding="utf-8")
    changes = (PROJECT_FOLDER / ".github" / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^version: (.*)$", citation, re.MULTILINE)[1] == pegpose_lab.__version__
    assert re.search(r"^## (.*)$", changes, re.MULTILINE)[1] == pegpose_lab.__version__


def test_files_are_short():
    sources = [path for path in PACKAGE.rglob("*.py") if "tests" not in path.parts]
    lengths = {path.name: len(path.read_text(encoding="utf-8").splitlines()) for path in sources}
    assert {name: length for name, length in lengths.items() if length >= 300} == {}


@pytest.mark.parametrize("arguments", [("check", "--output-format", "concise"), ("format", "--check")])
def test_ruff_finds_nothing(arguments):
    if importlib.util.find_spec("ruff") is None:
        pytest.skip("ruff is not installed; it is in the extra dev")
    command = [sys.executable, "-m", "ruff", *arguments, "--no-cache", "pegpose_lab"]
    run = subprocess.run(command, cwd=PROJECT_FOLDER, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def test_containers_use_the_pinned_packages():
    """`.binder` and `.devcontainer` install what `environment.txt` pins, by files that are there."""
    binder = PROJECT_FOLDER / ".binder"
    (line,) = (binder / "requirements.txt").read_text().split("\n")[:-1]
    assert (binder / line.removeprefix("-r ")).resolve() == PROJECT_FOLDER / "environment.txt"
    assert (binder / "postBuild").stat().st_mode & 0o111
    container = json.loads((PROJECT_FOLDER / ".devcontainer" / "devcontainer.json").read_text())
    assert container["postCreateCommand"] == "python3 -m pegpose_lab setup"
    for file in (binder / "runtime.txt").read_text().strip(), container["image"]:
        assert file.endswith("3.11")  # the oldest Python that is supported, as environment.txt is compiled for
