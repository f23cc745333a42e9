"""JupyterLab on the notebooks: what it writes where, what it is told, and how a changed notebook is restored."""

import asyncio
import json
import os
import subprocess
from pathlib import Path

import nbformat
import pytest
from jupyter_server.services.contents.largefilemanager import AsyncLargeFileManager
from jupyterlab.labapp import LabApp
from nbformat.v4 import new_code_cell, new_notebook, new_output

from pegpose_lab import __main__ as commands
from pegpose_lab.lab import environment
from pegpose_lab.lab.notebooks import exploring, running

VIEW = "application/vnd.jupyter.widget-view+json"


# --- where notebooks write ----------------------------------------------------------------------


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout with two notebooks and a result, of which git knows, and nothing that needs set-up."""
    folder = tmp_path / "checkout"
    for name, text in {
        "notebooks/01_a.ipynb": "first\n",
        "notebooks/02_b.ipynb": "second\n",
        "data/results/01_known.csv": "x\n1\n",
        ".gitignore": "notebooks/scratch/\n",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    _git(folder, "init", "-q")
    _git(folder, "add", "-A")
    _git(folder, "-c", "user.name=x", "-c", "user.email=x", "-c", "commit.gpgsign=false", "commit", "-qm", "x")
    monkeypatch.setattr(commands, "CHECKOUT", folder)
    return folder


def _git(folder, *arguments):
    return subprocess.run(
        ["git", "-C", str(folder), *arguments], check=True, capture_output=True, encoding="utf-8"
    ).stdout


def test_scratch_folder_holds_the_known_results_and_git_does_not_see_it(checkout):
    scratch = exploring.scratch_folder(checkout)
    assert (scratch / "data" / "results" / "01_known.csv").read_text() == "x\n1\n"
    (scratch / "figures" / "a.png").write_text("drawn")
    (scratch / "data" / "results" / "01_known.csv").write_text("changed")
    assert _git(checkout, "status", "--short") == ""
    assert (checkout / "data" / "results" / "01_known.csv").read_text() == "x\n1\n"


def test_every_start_begins_with_the_known_results(checkout):
    scratch = exploring.scratch_folder(checkout)
    (scratch / "data" / "results" / "01_old_values.csv").write_text("id,ours\n")
    (scratch / "figures" / "old.png").write_text("drawn")
    (scratch / "note.txt").write_text("mine")
    assert exploring.scratch_folder(checkout) == scratch
    names = {path.relative_to(scratch).as_posix() for path in scratch.rglob("*") if path.is_file()}
    assert names == {"data/results/01_known.csv", "note.txt"}


def test_where_the_checkout_cannot_be_written_another_folder_will_do(checkout, monkeypatch):
    make = Path.mkdir

    def refuse(path, *arguments, **options):
        if checkout in path.parents:
            raise PermissionError(13, "Permission denied", str(path))
        make(path, *arguments, **options)

    monkeypatch.setattr(Path, "mkdir", refuse)
    scratch = exploring.scratch_folder(checkout)
    assert checkout not in scratch.parents
    assert (scratch / "data" / "results" / "01_known.csv").is_file() and (scratch / "figures").is_dir()


# --- the command line ---------------------------------------------------------------------------


@pytest.fixture
def started(checkout, monkeypatch):
    """Run ``lab`` with arguments, as a user whose id is 1000; returns what it becomes."""
    monkeypatch.setattr(os, "environ", dict(os.environ))
    monkeypatch.setattr(os, "geteuid", lambda: 1000, raising=False)
    monkeypatch.setattr(commands.signal, "signal", lambda *_: None)
    monkeypatch.setattr(environment, "set_up", bool)
    monkeypatch.setattr(environment, "is_active", lambda: True)
    became = []
    monkeypatch.setattr(commands, "_become", lambda command: became.append(command) or 0)

    def run(*arguments):
        assert commands.main(["lab", *arguments]) == 0
        return became[-1][1:]

    return run


def test_lab_starts_jupyterlab_with_a_scratch_output_and_says_where(started, checkout, capsys):
    command = started()
    assert command[:3] == ["-m", "jupyterlab", f"--ServerApp.root_dir={checkout}"]
    scratch = os.environ["PEGPOSE_OUTPUT"]
    assert scratch == str(checkout / "notebooks" / "scratch") and scratch in capsys.readouterr().out


@pytest.mark.parametrize(
    "line", ["--no-browser --port 9999 --ip 0.0.0.0 --allow-root", "--ip=0.0.0.0 --port=9999 --allow-root --no-browser"]
)
def test_lab_takes_the_usual_options_of_jupyterlab(started, line):
    assert started(*line.split())[-4:] == ["--no-browser", "--allow-root", "--ip=0.0.0.0", "--port=9999"]


def test_arguments_after_the_dashes_come_last(started):
    command = started("--port", "9999", "--", "--port=8000", "--debug")
    assert command[-3:] == ["--port=9999", "--port=8000", "--debug"]
    assert not {"--no-browser", "--allow-root"} & set(command)


def test_jupyterlab_understands_what_it_is_told(checkout):
    """The traits exist and have taken the values: a misspelt one would be ignored with a warning."""
    options = commands._parse(["lab", "--no-browser", "--port", "9999", "--ip", "0.0.0.0"])
    arguments = exploring.jupyterlab_arguments(options, checkout)
    app = LabApp()
    app.parse_command_line([argument for argument in arguments if argument.startswith("--LabApp")])
    assert Path(app.app_settings_dir) == exploring.SETTINGS
    hook = next(argument for argument in arguments if "pre_save_hook" in argument).split("=")[1]
    assert AsyncLargeFileManager(pre_save_hook=hook).pre_save_hook is running.clean_before_save


def test_settings_name_what_jupyterlab_knows():
    """No autosave, no question about news, whole names of files: as the schemas of the pinned JupyterLab call it."""
    overrides = json.loads((exploring.SETTINGS / "overrides.json").read_text(encoding="utf-8"))
    schemas = Path(environment.sys.prefix, "share", "jupyter", "lab", "schemas")
    wanted = {"autosave": False, "fetchNews": "false", "checkForUpdates": False}
    wanted |= {"showLastModifiedColumn": False}
    assert {key: value for plugin in overrides.values() for key, value in plugin.items()} == wanted
    for plugin, values in overrides.items():
        package, name = plugin.split(":")
        known = json.loads((schemas / package / f"{name}.json").read_text(encoding="utf-8"))["properties"]
        for key, value in values.items():
            assert key in known and known[key]["default"] != value
            choices = [choice["const"] for choice in known[key].get("oneOf", []) if "const" in choice]
            assert not choices or value in choices


def test_root_is_told_in_one_sentence_before_any_set_up(started, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 0, raising=False)
    with monkeypatch.context() as patch, pytest.raises(SystemExit, match="add --allow-root") as told:
        patch.setattr(environment, "set_up", lambda: pytest.fail("set-up has begun"))
        started("--no-browser")
    assert "\n" not in str(told.value)
    assert "--allow-root" in started("--allow-root")
    assert "--allow-root" in started("--", "--allow-root")


# --- restoring ----------------------------------------------------------------------------------


def test_reset_restores_what_was_changed_deleted_or_staged_and_nothing_else(checkout, capsys):
    (checkout / "notebooks" / "01_a.ipynb").write_text("changed")
    (checkout / "notebooks" / "02_b.ipynb").write_text("changed, too")
    (checkout / "data" / "results" / "01_known.csv").write_text("mine")
    assert commands.main(["lab", "--reset", "01"]) == 0
    assert "notebooks/01_a.ipynb is as in git's last commit again" in capsys.readouterr().out
    assert (checkout / "notebooks" / "01_a.ipynb").read_text() == "first\n"
    assert (checkout / "notebooks" / "02_b.ipynb").read_text() == "changed, too"
    _git(checkout, "add", "-A")
    (checkout / "notebooks" / "01_a.ipynb").unlink()
    assert exploring.restore(["01_a.ipynb", "02_b"], checkout) == ["notebooks/01_a.ipynb", "notebooks/02_b.ipynb"]
    assert _git(checkout, "status", "--short") == "M  data/results/01_known.csv\n"


def test_reset_of_an_unchanged_notebook_says_so(checkout, capsys):
    assert commands.main(["lab", "--reset", "01", "02"]) == 0
    assert capsys.readouterr().out.startswith("Nothing to do")


def test_reset_works_below_the_folder_of_a_repository_with_any_name(checkout):
    folder = checkout / "für Prüfstand"
    (folder / "notebooks").mkdir(parents=True)
    (folder / "notebooks" / "03_c.ipynb").write_text("third\n")
    _git(checkout, "add", "-A")
    _git(checkout, "-c", "user.name=x", "-c", "user.email=x", "-c", "commit.gpgsign=false", "commit", "-qm", "y")
    (folder / "notebooks" / "03_c.ipynb").write_text("changed")
    assert exploring.restore(["03"], folder) == ["notebooks/03_c.ipynb"]
    assert (folder / "notebooks" / "03_c.ipynb").read_text() == "third\n"


def test_reset_refuses_an_unknown_name_and_changes_nothing(checkout):
    (checkout / "notebooks" / "01_a.ipynb").write_text("changed")
    with pytest.raises(SystemExit, match="'07'; there are: 01_a, 02_b"):
        exploring.restore(["01", "07"], checkout)
    assert (checkout / "notebooks" / "01_a.ipynb").read_text() == "changed"


def test_reset_without_git_says_so(checkout, tmp_path, monkeypatch):
    with pytest.raises(SystemExit, match="is not in order for it: git says .*not a git repository"):
        monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
        exploring.restore(["01"], tmp_path)
    monkeypatch.setattr(exploring.shutil, "which", lambda _: None)
    with pytest.raises(SystemExit, match="git is not installed"):
        exploring.restore(["01"], checkout)


# --- saving -------------------------------------------------------------------------------------


def _run_notebook():
    """A notebook as JupyterLab has it after a run: time stamps, a widget with its state, the kernel's version."""
    data = {"text/plain": "IntSlider()", VIEW: {"model_id": "4f2a", "version_major": 2}}
    cell = new_code_cell("slider", id="a", execution_count=1, outputs=[new_output("display_data", data)])
    cell.metadata = {"execution": {"iopub.execute_input": "2026"}, "trusted": True, "tags": ["kept"]}
    notebook = new_notebook(cells=[cell])
    notebook.metadata = {
        "kernelspec": {"display_name": "ours", "language": "python", "name": "python3"},
        "language_info": {"name": "python", "version": "3.13.0"},
        "widgets": {"application/vnd.jupyter.widget-state+json": {"state": {"4f2a": {}}}},
        "title": "mine",
    }
    return notebook


@pytest.mark.parametrize("path", ["notebooks/01_a.ipynb", "notebooks/my own.ipynb"])
def test_saved_notebooks_hold_no_models_of_widgets(tmp_path, path):
    """Saved by the contents manager of Jupyter's server itself, with the hook by its name."""
    manager = AsyncLargeFileManager(
        root_dir=str(tmp_path), pre_save_hook="pegpose_lab.lab.notebooks.running.clean_before_save"
    )
    manager.notary.db_file = ":memory:"  # of signatures; the user's own is none of a test's business
    (tmp_path / "notebooks").mkdir()
    content = json.loads(nbformat.writes(_run_notebook()))
    asyncio.run(manager.save({"type": "notebook", "format": "json", "content": content}, path))
    manager.notary.store.close()
    text = (tmp_path / path).read_text(encoding="utf-8")
    assert "widget-" not in text and "4f2a" not in text and "IntSlider()" in text
    saved = nbformat.reads(text, as_version=4)
    assert saved.cells[0].metadata["tags"] == ["kept"]
    if path.endswith("01_a.ipynb"):
        assert text == running.to_text(saved) == running.to_text(_without_trust(_run_notebook()))
    else:
        assert saved.metadata["title"] == "mine" and saved.metadata.kernelspec.display_name == "ours"


def _without_trust(notebook):
    """What nbformat leaves out when it writes a file."""
    notebook.cells[0].metadata.pop("trusted")
    return notebook


def test_other_files_are_saved_as_they_are():
    model = {"type": "file", "content": "notebooks"}
    running.clean_before_save(model=model, path="notebooks/01_a.ipynb", contents_manager=None)
    assert model == {"type": "file", "content": "notebooks"}
