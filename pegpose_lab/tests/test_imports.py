"""The import rule of the house, read from the imports, and that the method needs numpy, scipy and OpenCV only."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import pegpose_lab

PACKAGE = Path(pegpose_lab.__file__).parent

# A room may import from rooms of earlier rows, and from those of its own row where there is no cycle.
ORDER = (
    ("checks", "files", "flags"),
    ("camera", "targets", "patterns"),
    ("render",),
    ("segmentation", "corners", "circles", "discs"),
    ("pegs", "calibration", "pose", "handeye"),
    ("insertion", "servo"),
    (
        "lab.calibrators",
        "lab.environment",
        "lab.installers",
        "lab.progress",
        "lab.results",
        "lab.figure_digest",
        "lab.style",
        "lab.image_plots",
        "lab.plotting",
        "lab.animation",
        "lab.maps",
    ),
    ("paper", "paper.claims", "paper.diagrams"),
    ("study",),
    ("bench", "own_images"),
    ("lab.figures",),
    ("lab.widgets", "lab.front_page", "lab.notebooks.contents"),
    ("lab.page",),
    ("lab.notebooks.agreement", "lab.notebooks.testing", "lab.notebooks.exploring"),
    ("lab.notebooks.running", "lab.notebooks.processors", "lab.measuring"),
    ("lab.command_line",),
    ("__main__",),
)
RANK = {room: rank for rank, rooms in enumerate(ORDER) for room in rooms}
METHOD = [room for rooms in ORDER[:6] for room in rooms]

# Folders without a face: what is in them is imported by its own name, since some of it starts on a bare Python.
CORRIDORS = ("lab", "lab.notebooks")
BARE = (
    "files", "lab", "lab.calibrators", "lab.environment", "lab.installers", "lab.progress", "lab.notebooks",
    "lab.notebooks.exploring", "lab.measuring", "lab.command_line", "__main__",
)  # fmt: skip
LIBRARIES = {"numpy", "scipy", "cv2"}


def modules(package):
    """{dotted name below the package: its tree}, without tests; a package has the name of its folder."""
    trees = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        if parts[0] != "tests":
            name = ".".join(part for part in parts if part != "__init__")
            trees[name] = (path.name == "__init__.py", ast.parse(path.read_text(encoding="utf-8")))
    return trees


def room_of(name):
    """The room of a module: the longest room's name that it begins with, or None for a corridor and the package."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        room = ".".join(parts[:end])
        if room in RANK:
            return room
    return None


def imports(name, is_package, tree):
    """Ours as (name below the package, what is imported from it, whether at once), others as (top name, at once)."""
    ours, others = [], []
    late = {id(inner) for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) for inner in ast.walk(node)}
    late |= {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    here = name.split(".") if is_package else name.split(".")[:-1]
    here = [part for part in here if part]
    for node in ast.walk(tree):
        at_once = id(node) not in late
        if isinstance(node, ast.Import):
            for alias in node.names:
                top, _, below = alias.name.partition(".")
                if top == "pegpose_lab":
                    ours.append((below, (), at_once))
                else:
                    others.append((top, at_once))
        elif isinstance(node, ast.ImportFrom):
            source = (node.module or "").split(".") if node.module else []
            if node.level:
                source = here[: len(here) - node.level + 1] + source
            elif source[0] == "pegpose_lab":
                source = source[1:]
            else:
                others.append((source[0], at_once))
                continue
            ours.append((".".join(source), tuple(alias.name for alias in node.names), at_once))
    return ours, others


def targets(source, names, trees):
    """The modules that ``from source import names`` reaches."""
    inner = [f"{source}.{name}".strip(".") for name in names]
    found = [name for name in inner if name in trees]
    return found + ([source] if len(found) < len(names) or not names else [])


def faults(package):
    """What breaks the rule, in words."""
    trees = modules(package)
    found, graph = [], {}
    for name, (is_package, tree) in trees.items():
        ours, others = imports(name, is_package, tree)
        room = room_of(name)
        for top, at_once in others:
            standard = top in sys.stdlib_module_names
            if name in (*BARE, "") and at_once and not standard:
                found.append(f"{name} imports {top}: it has to start on a bare Python")
            if room in METHOD and at_once and not standard and top not in LIBRARIES:
                found.append(f"{name} imports {top}: the method needs {', '.join(sorted(LIBRARIES))} only")
        for source, names, at_once in ours:
            for target in targets(source, names, trees):
                there = room_of(target)
                if at_once and target:
                    graph.setdefault(name, set()).add(target)
                if name == "" or target == "":
                    continue
                if room is None or there is None:
                    if target not in CORRIDORS or names:
                        found.append(f"{name} imports {target}: a corridor holds nothing and imports nothing")
                elif there != room and target != there:
                    found.append(f"{name} imports {target}: across packages only the face {there} is imported")
                elif there != room and RANK[there] > RANK[room]:
                    found.append(f"{name} imports {target}: {there} comes after {room}")
    return found + [f"a cycle: {' -> '.join(cycle)}" for cycle in cycles(graph)]


def cycles(graph):
    """The import cycles; that a package's face runs before its files does not count."""
    found, done = [], set()

    def visit(name, path):
        if name in path:
            found.append([*path[path.index(name) :], name])
        elif name not in done:
            for target in sorted(graph.get(name, ())):
                visit(target, [*path, name])
            done.add(name)

    for name in sorted(graph):
        visit(name, [])
    return found


def test_the_house_keeps_its_rule():
    assert faults(PACKAGE) == []


def test_every_module_stands_in_a_room():
    names = set(modules(PACKAGE)) - {"", *CORRIDORS}
    assert [name for name in names if room_of(name) is None] == []


HOUSE = {
    "__init__.py": "",
    "checks.py": "import numpy as np",
    "files.py": "import os",
    "camera/__init__.py": "from .tsai import TsaiCamera",
    "camera/radial.py": "import cv2",
    "camera/tsai.py": "from ..checks import as_number\nfrom .radial import distort_radius",
    "circles/__init__.py": "from .find import find_circles",
    "circles/find.py": "from ..checks import as_image",
    "calibration/__init__.py": "from .joint.calibrate import calibrate_joint",
    "calibration/joint/__init__.py": "",
    "calibration/joint/calibrate.py": "from ...camera import TsaiCamera\nfrom ..planes import is_planar",
    "calibration/planes.py": "",
    "lab/__init__.py": "",
    "lab/environment.py": "import os\nfrom . import progress",
    "lab/progress.py": "import sys",
    "lab/results.py": "import pandas as pd\nfrom ..files import replacing",
    "paper/__init__.py": "from .numbers import printed",
    "paper/numbers.py": "from ..lab import results",
    "study/__init__.py": "from .trials import monte_carlo",
    "study/trials.py": "from .. import paper\nfrom ..calibration import calibrate_joint",
    "__main__.py": "from .lab import environment\ndef main():\n    from . import study",
}


def house(folder, **changes):
    for name, text in {**HOUSE, **changes}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_a_good_house_is_accepted(tmp_path):
    assert faults(house(tmp_path)) == []


@pytest.mark.parametrize(
    ("name", "line", "fault"),
    [
        ("circles/find.py", "from ..camera.tsai import TsaiCamera", "only the face camera"),
        ("circles/find.py", "from ..camera import tsai", "only the face camera"),
        ("circles/find.py", "from pegpose_lab.camera.tsai import TsaiCamera", "only the face camera"),
        ("circles/find.py", "import pegpose_lab.camera.tsai", "only the face camera"),
        ("circles/find.py", "def f():\n    from ..camera.tsai import TsaiCamera", "only the face camera"),
        ("calibration/joint/calibrate.py", "from ...camera.radial import distort_radius", "only the face camera"),
        ("study/trials.py", "from ..calibration.joint.calibrate import calibrate_joint", "only the face calibration"),
        ("camera/radial.py", "from ..circles import find_circles", "circles comes after camera"),
        ("checks.py", "from .camera import TsaiCamera", "camera comes after checks"),
        ("circles/find.py", "def f():\n    from ..study import monte_carlo", "study comes after circles"),
        ("circles/find.py", "from ..lab import results", "lab.results comes after circles"),
        ("circles/find.py", "from ..paper import printed", "paper comes after circles"),
        ("paper/numbers.py", "from ..study import monte_carlo", "study comes after paper"),
        ("lab/results.py", "from ..paper import printed", "paper comes after lab.results"),
        ("circles/find.py", "import pandas as pd", "the method needs cv2, numpy, scipy only"),
        ("camera/radial.py", "from matplotlib import pyplot", "the method needs cv2, numpy, scipy only"),
        ("files.py", "import numpy as np", "has to start on a bare Python"),
        ("lab/environment.py", "import pandas", "has to start on a bare Python"),
        ("lab/__init__.py", "import numpy", "has to start on a bare Python"),
        ("lab/__init__.py", "from . import results", "a corridor holds nothing"),
        ("__init__.py", "import numpy", "has to start on a bare Python"),
        ("camera/radial.py", "from .tsai import TsaiCamera", "a cycle: camera.tsai -> camera.radial -> camera.tsai"),
    ],
)
def test_a_broken_rule_is_told(tmp_path, name, line, fault):
    found = faults(house(tmp_path, **{name: f"{HOUSE[name]}\n{line}"}))
    assert any(fault in text for text in found), found


BLOCKED = ("pandas", "matplotlib", "ipywidgets", "IPython", "joblib", "tqdm", "yaml", "pooch")


def test_the_method_is_imported_without_the_laboratory():
    code = (
        "import importlib, sys\n"
        f"sys.modules.update(dict.fromkeys({BLOCKED!r}))\n"
        f"for room in {METHOD!r}:\n"
        "    importlib.import_module('pegpose_lab.' + room)\n"
        "import pegpose_lab\n"
        "for name in pegpose_lab.__all__:\n"
        "    getattr(pegpose_lab, name)\n"
        "print([name for name in sys.modules if name.startswith(('pegpose_lab.lab', 'pegpose_lab.study'))])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=PACKAGE.parent)
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == "[]"
