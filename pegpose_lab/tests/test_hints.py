"""Type hints: on every public function of the package, and good enough for the README's script under mypy --strict."""

import ast
import importlib.util
import re
import subprocess
import sys

import pytest

from pegpose_lab.files import PROJECT_FOLDER

PACKAGE = PROJECT_FOLDER / "pegpose_lab"
FILES = sorted(path for path in PACKAGE.rglob("*.py") if "tests" not in path.relative_to(PACKAGE).parts)


def functions(path):
    """The public functions of a file and the public methods of its public classes, with their names."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if getattr(node, "name", "_").startswith("_"):
            continue
        if isinstance(node, ast.FunctionDef):
            yield node.name, node
        for inner in node.body if isinstance(node, ast.ClassDef) else ():
            if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_"):
                yield f"{node.name}.{inner.name}", inner


def without_hint(function):
    """Arguments without a hint, and "return"."""
    arguments = function.args
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    own = ("self", "cls")
    bare = [argument.arg for argument in every if argument and argument.annotation is None and argument.arg not in own]
    return bare + ["return"] * (function.returns is None)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_public_functions_have_hints(path):
    bare = {name: without_hint(node) for name, node in functions(path)}
    assert {name: missing for name, missing in bare.items() if missing} == {}


def test_public_functions_are_found():
    assert sum(len(list(functions(path))) for path in FILES) > 300


def test_the_script_of_the_readme_passes_mypy(tmp_path):
    if importlib.util.find_spec("mypy") is None:
        pytest.skip("mypy is not installed; it is in the extra dev")
    readme = (PROJECT_FOLDER / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    (tmp_path / "script.py").write_text(code, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", f"--cache-dir={tmp_path / 'cache'}", "--no-error-summary"]
    run = subprocess.run([*command, str(tmp_path / "script.py")], cwd=PROJECT_FOLDER, capture_output=True, text=True)
    assert not run.stderr
    assert [line for line in run.stdout.splitlines() if "error" in line] == []
