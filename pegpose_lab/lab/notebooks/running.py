"""Runs the notebooks outside the checkout, and moves the files that they wrote into place.

A notebook writes figures to ``figures/`` and tables to ``data/results/`` below the folder in the environment variable
``PEGPOSE_OUTPUT`` (by default the checkout).  Here that folder is a temporary one.  When every notebook has finished,
its files are moved into place, each in one step, so that no half-written file is ever seen there.  A file that agrees
with the present one (`agreement.files_agree`) is not moved, because on another processor only last digits differ.
"""

from __future__ import annotations

import asyncio
import os
import re
import shutil
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager, suppress
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING

import nbformat
from ipykernel.kernelspec import RESOURCES, get_kernel_dict
from jupyter_client.kernelspec import KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
from tqdm import tqdm

from ...files import replacing
from .agreement import files_agree
from .exploring import WRITTEN, fill

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

WORKERS = 2
READS = {"07": "06"}  # number of a notebook that reads another's results: number of that other notebook

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


class NotebookError(RuntimeError):
    """A notebook did not finish; the message names it and shows the failing cell."""


def reproduce(
    notebooks: Sequence[Path],
    output: Path,
    *,
    known_results: Path | None = None,
    known: str = "*",
    cell_timeout: float = 600,
    update: bool = False,
) -> None:
    """Run notebooks and move the figures and results that are new below `output`.

    Parameters
    ----------
    notebooks : list of Path
        They run two at a time; a notebook that reads another's results (`READS`) runs after that one.
    output : Path
        The folder whose ``figures`` and ``data/results`` are written, after the last notebook.
    known_results : Path, optional
        Folder of results that these notebooks do not make but may read.
    known : str
        Pattern of the names of these results.
    cell_timeout : float
        Time limit for a single cell, s.
    update : bool
        Also store the outputs in the notebooks, without what changes from run to run.  Then all figures and results
        are moved, because a notebook and its files must come from the same run; of animations, which no notebook
        contains, only those that changed.

    Raises
    ------
    NotebookError
        If a notebook fails; `output` and the notebooks are then unchanged.
    """
    with scratch_output(known_results, known) as scratch:
        executed = _execute_all(notebooks, scratch, cell_timeout)
        _publish(scratch, Path(output), all_files=update)
    if update:
        for path, notebook in zip(notebooks, executed, strict=True):
            with replacing(path) as part:
                part.write_text(to_text(notebook), encoding="utf-8")


@contextmanager
def scratch_output(known_results: Path | None = None, known: str = "*") -> Iterator[Path]:
    """A temporary folder for ``PEGPOSE_OUTPUT``, with copies of the known results that match the pattern."""
    with tempfile.TemporaryDirectory(prefix="pegpose_", ignore_cleanup_errors=True) as folder:
        fill(Path(folder), known_results, known)
        yield Path(folder)


def output_variables(folder: Path) -> dict[str, str]:
    """The variables that let notebooks write into a folder and ignore the user's IPython settings."""
    return {"PEGPOSE_OUTPUT": str(folder), "IPYTHONDIR": str(folder / "ipython")}


# --- execution ----------------------------------------------------------------------------------


def _execute_all(paths, scratch, cell_timeout):
    """Execute notebooks and return them in the order of `paths`; those that read others' results run last."""
    notebooks = {path: nbformat.read(path, as_version=4) for path in paths}
    cells = sum(cell.cell_type == "code" for notebook in notebooks.values() for cell in notebook.cells)
    with tqdm(total=cells, unit="cell", desc="notebooks", disable=None) as bar:
        crew = _Crew(scratch, cell_timeout, bar)
        crew.run({path: notebooks[path] for path in sorted(paths, key=_turn)})
    return list(notebooks.values())


def _turn(path):
    """0 for notebooks whose results others read, 2 for those that read them, 1 for all others."""
    return 0 if path.name[:2] in READS.values() else 2 if path.name[:2] in READS else 1


class _OwnPython(KernelSpecManager):
    """Kernels of the running Python, even if other kernels are registered under its name."""

    def get_kernel_spec(self, kernel_name):
        return self.kernel_spec_class(resource_dir=RESOURCES, **get_kernel_dict())


class _Crew:
    """Executes notebooks in threads, with one kernel each; the first failure ends all of them."""

    def __init__(self, scratch, cell_timeout, bar):
        self.scratch = scratch
        self.cell_timeout = cell_timeout
        self.bar = bar
        self.stopped = threading.Event()
        self.managers = []

    def run(self, notebooks):
        """Execute ``{path: notebook}`` in place, in this order."""
        with ThreadPoolExecutor(WORKERS) as pool:
            jobs = {}
            for path, notebook in notebooks.items():
                jobs[path.name[:2]] = pool.submit(self._execute, path, notebook, jobs.get(READS.get(path.name[:2])))
            try:
                for job in as_completed(jobs.values()):
                    job.result()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                self._stop()
                raise

    def _execute(self, path, notebook, source=None):
        """Execute one notebook after `source` has finished; NotebookError if it fails."""
        if source is not None:
            source.result()
        manager = AsyncKernelManager(kernel_spec_manager=_OwnPython())
        self.managers.append(manager)
        client = NotebookClient(
            notebook,
            km=manager,
            resources={"metadata": {"path": str(self.scratch)}},
            timeout=self.cell_timeout,
            startup_timeout=120,
            iopub_timeout=60,
            raise_on_iopub_timeout=True,
            record_timing=False,
            store_widget_state=False,
            coalesce_streams=True,
            extra_arguments=["--log-level=ERROR"],
            on_cell_execute=self._check,
            on_cell_executed=self._count,
        )
        start = time.monotonic()
        try:
            asyncio.run(client.async_execute(cleanup_kc=True, env=self._environment()))
        except (CellExecutionError, CellTimeoutError, DeadKernelError, RuntimeError) as error:
            reason = _COLOUR.sub("", str(error)).strip()
            raise NotebookError(f"{path.name}, code cell {client.code_cells_executed}: {reason}") from error
        self.bar.write(f"{path.name:<32}{time.monotonic() - start:6.1f} s")

    def _environment(self):
        """The kernels' environment variables: the output folder, and no settings of the user's IPython."""
        return os.environ | output_variables(self.scratch)

    def _check(self, **_):
        if self.stopped.is_set():
            raise RuntimeError("stopped with the others")

    def _count(self, **_):
        self.bar.update()

    def _stop(self):
        """End every kernel at once; the threads end when they notice it."""
        self.stopped.set()
        for manager in self.managers:
            process = getattr(manager.provisioner, "process", None)
            if process is not None:
                with suppress(ProcessLookupError):
                    process.kill()


# --- results ------------------------------------------------------------------------------------


def changed_files(scratch: Path, output: Path) -> list[Path]:
    """Return the results and figures below `scratch` that differ from those below `output`.

    Returns
    -------
    list of Path
        Relative to both folders, in order.  A PDF counts as changed if the PNG of the same name has changed.
    """
    files = [path.relative_to(scratch) for path in _files(scratch)]
    compared = {path: path.with_suffix(".png") if path.suffix == ".pdf" else path for path in files}
    changed = {path: not files_agree(output / path, scratch / path) for path in set(compared.values())}
    return [path for path in files if changed[compared[path]] or not (output / path).is_file()]


def _files(folder):
    """All files of results and figures below a folder."""
    return [path for name in WRITTEN for path in sorted((folder / name).rglob("*")) if path.is_file()]


def _publish(scratch, output, *, all_files=False):
    """Copy the changed files next to their destinations, then move all of them, so that none is ever incomplete."""
    chosen = changed_files(scratch, output)
    if all_files:
        files = [path.relative_to(scratch) for path in _files(scratch)]
        chosen = [path for path in files if path in chosen or path.suffix != ".gif"]
    with ExitStack() as moves:
        for name in chosen:
            part = moves.enter_context(replacing(output / name))
            shutil.copyfile(scratch / name, part)


def to_text(notebook: nbformat.NotebookNode) -> str:
    """The text of a notebook's file, without what differs between runs or machines.

    Time stamps, versions and the models of widgets are removed; a widget is stored as its text.
    """
    notebook = deepcopy(notebook)
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
    _drop_widgets(notebook)
    return nbformat.writes(notebook) + "\n"


def _drop_widgets(notebook):
    """Remove, in place, the data of widgets that are of use only while the kernel runs."""
    notebook.metadata.pop("widgets", None)
    for output in (output for cell in notebook.cells for output in cell.get("outputs", [])):
        output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)


def clean_before_save(model: dict[str, Any], path: str, **_: Any) -> None:
    """A ``pre_save_hook`` of Jupyter's contents manager, which stores the project's notebooks as `to_text` does.

    Other notebooks keep their kernel and metadata and lose only the models of widgets.

    Parameters
    ----------
    model : dict
        The file to be saved; changed in place.
    path : str
        Its path below the server's root folder.
    """
    if model.get("type") != "notebook" or not model.get("content"):
        return
    notebook = nbformat.from_dict(model["content"])
    if re.fullmatch(r"notebooks/\d\d_\w+\.ipynb", path.strip("/")):
        notebook = nbformat.reads(to_text(notebook), as_version=nbformat.NO_CONVERT)
    else:
        _drop_widgets(notebook)
    model["content"] = notebook
