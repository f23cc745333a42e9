"""Running the notebooks outside the tree, and moving what they wrote into place.

A notebook writes figures to ``figures/`` and tables to ``data/results/`` below the folder that the
environment variable ``PEGPOSE_OUTPUT`` names (the checkout where it is unset).  Here that folder is a
temporary one; its files are moved to their place when every notebook has run to its end, each in one
step, so that nothing half-written is ever seen there.  A file that says the same as the one in its place
(`agreement.files_agree`) is not moved: on another processor last digits differ, and nothing else.
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
READS = {"07": "06"}  # numbers of notebooks that read the results of another, and of that

_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


class NotebookError(RuntimeError):
    """A notebook did not run to its end; the message names it and shows the failing cell."""


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
        They run two at a time; one that reads another's results (`READS`) after that.
    output : Path
        The folder whose ``figures`` and ``data/results`` are written, after the last notebook.
    known_results : Path, optional
        Folder of results that are not made by these notebooks, for those that read them.
    known : str
        Pattern of the names of these results.
    cell_timeout : float
        The time that a single cell may take, in s.
    update : bool
        Store the outputs in the notebooks too, without what changes from run to run; then all figures and results
        are moved, for a notebook and the files that it made belong to one run.

    Raises
    ------
    NotebookError
        If a notebook fails; `output` and the notebooks are then as they were.
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
    """A temporary folder to be named by ``PEGPOSE_OUTPUT``, holding copies of known results of that pattern."""
    with tempfile.TemporaryDirectory(prefix="pegpose_", ignore_cleanup_errors=True) as folder:
        fill(Path(folder), known_results, known)
        yield Path(folder)


def output_variables(folder: Path) -> dict[str, str]:
    """The variables by which notebooks write into a folder, and are free of the settings of a user's IPython."""
    return {"PEGPOSE_OUTPUT": str(folder), "IPYTHONDIR": str(folder / "ipython")}


# --- execution ----------------------------------------------------------------------------------


def _execute_all(paths, scratch, cell_timeout):
    """Execute notebooks, those that are read first and readers last; return them in the order of `paths`."""
    notebooks = {path: nbformat.read(path, as_version=4) for path in paths}
    cells = sum(cell.cell_type == "code" for notebook in notebooks.values() for cell in notebook.cells)
    with tqdm(total=cells, unit="cell", desc="notebooks", disable=None) as bar:
        crew = _Crew(scratch, cell_timeout, bar)
        crew.run({path: notebooks[path] for path in sorted(paths, key=_turn)})
    return list(notebooks.values())


def _turn(path):
    """0 for notebooks whose results are read, 2 for those that read, 1 for all others."""
    return 0 if path.name[:2] in READS.values() else 2 if path.name[:2] in READS else 1


class _OwnPython(KernelSpecManager):
    """Kernels of this very Python, whatever kernels are registered elsewhere under its name."""

    def get_kernel_spec(self, kernel_name):
        return self.kernel_spec_class(resource_dir=RESOURCES, **get_kernel_dict())


class _Crew:
    """Executes notebooks in threads, a kernel each; the first failure ends them all."""

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
        """Execute one notebook, after `source`; raise NotebookError with all there is to say if it fails."""
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
        """The kernels' variables: where to write, and no settings of the user's IPython."""
        return os.environ | output_variables(self.scratch)

    def _check(self, **_):
        if self.stopped.is_set():
            raise RuntimeError("stopped with the others")

    def _count(self, **_):
        self.bar.update()

    def _stop(self):
        """End every kernel at once; their threads end when they notice."""
        self.stopped.set()
        for manager in self.managers:
            process = getattr(manager.provisioner, "process", None)
            if process is not None:
                with suppress(ProcessLookupError):
                    process.kill()


# --- results ------------------------------------------------------------------------------------


def changed_files(scratch: Path, output: Path) -> list[Path]:
    """Return the results and figures below `scratch` that say something else than those below `output`.

    Returns
    -------
    list of Path
        Relative to both folders, in order.  A PDF goes with the PNG of its name.
    """
    files = [path.relative_to(scratch) for path in _files(scratch)]
    compared = {path: path.with_suffix(".png") if path.suffix == ".pdf" else path for path in files}
    changed = {path: not files_agree(output / path, scratch / path) for path in set(compared.values())}
    return [path for path in files if changed[compared[path]] or not (output / path).is_file()]


def _files(folder):
    """All files of results and figures below a folder."""
    return [path for name in WRITTEN for path in sorted((folder / name).rglob("*")) if path.is_file()]


def _publish(scratch, output, *, all_files=False):
    """Copy the files that changed beside their place, then move them all there: each is whole at any time."""
    chosen = [path.relative_to(scratch) for path in _files(scratch)] if all_files else changed_files(scratch, output)
    with ExitStack() as moves:
        for name in chosen:
            part = moves.enter_context(replacing(output / name))
            shutil.copyfile(scratch / name, part)


def to_text(notebook: nbformat.NotebookNode) -> str:
    """A notebook's file, without what differs from run to run or machine to machine.

    Taken away are time stamps, versions and the models of widgets; a widget is stored as its text.
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
    """Take away, in place, what a widget can be shown from only while its kernel lives."""
    notebook.metadata.pop("widgets", None)
    for output in (output for cell in notebook.cells for output in cell.get("outputs", [])):
        output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)


def clean_before_save(model: dict[str, Any], path: str, **_: Any) -> None:
    """A ``pre_save_hook`` of Jupyter's contents manager: the project's notebooks are stored as `to_text` has them.

    Notebooks of anybody else keep their own kernel and metadata, and lose only the models of widgets.

    Parameters
    ----------
    model : dict
        What is about to be saved; changed in place.
    path : str
        Where, below the server's root folder.
    """
    if model.get("type") != "notebook" or not model.get("content"):
        return
    notebook = nbformat.from_dict(model["content"])
    if re.fullmatch(r"notebooks/\d\d_\w+\.ipynb", path.strip("/")):
        notebook = nbformat.reads(to_text(notebook), as_version=nbformat.NO_CONVERT)
    else:
        _drop_widgets(notebook)
    model["content"] = notebook
