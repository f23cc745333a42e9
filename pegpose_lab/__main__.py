"""The commands of the laboratory: ``python3 -m pegpose_lab COMMAND``.

A bare Python can start this file: it and `environment` import the standard library only.  Every command
first makes ``.venv`` in the checkout (or finds it current) and then runs itself again with that folder's
Python, where the packages pinned in ``environment.txt`` are.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from .files import results_folder
from .lab import calibrators, command_line, environment
from .lab.environment import CHECKOUT
from .lab.notebooks import exploring

OLDEST_PYTHON = (3, 11)
CELL_TIMEOUT = 600  # s; a notebook's slowest cell takes a small part of it

# The same bytes in every run on one machine: one thread in each linear-algebra library (small systems are also
# solved several times faster so), sets in one order, and the kernels of .venv before those that a user has
# registered.  Another processor rounds the last bits another way; that is what `agreement` allows for.
FIXED_VARIABLES = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
    "JUPYTER_PREFER_ENV_PATH": "1",
}
ROOT_REFUSED = (
    "JupyterLab does not start for root, since notebooks may do what root may: run this command as yourself, "
    "or, where root is meant (in a container), add --allow-root."
)

# What would put other packages, other kernels or another plotting backend before the pinned ones.
DROPPED_VARIABLES = ("PYTHONPATH", "PYTHONHOME", "JUPYTER_PATH", "MPLBACKEND")


# --- commands -----------------------------------------------------------------------------------


def _setup(options):
    if not environment.set_up():
        print(f"{environment.VENV} is current.")
    return 0


def _reproduce(options):
    """Run the notebooks, move what they wrote into place, and compare it with the paper."""
    from .lab.notebooks import running

    _check_writable(options.output)
    notebooks = _choose(options.notebooks)
    try:
        running.reproduce(
            notebooks,
            options.output,
            known_results=results_folder(CHECKOUT),
            known="*" if options.notebooks else "bench_*",  # no notebook makes those of the benchmark
            cell_timeout=CELL_TIMEOUT,
            update=options.update_notebooks,
        )
    except running.NotebookError as error:
        print(f"\n{error}\n\nNothing was written to {options.output}.", file=sys.stderr)
        return 1
    return _report(options)


def _check_writable(folder):
    """End now, in one sentence, if results cannot be written to a folder once they are there."""
    place = next(path for path in (folder, *folder.parents) if path.exists())
    if not place.is_dir() or not os.access(place, os.W_OK | os.X_OK):
        why = "cannot be written" if place.is_dir() else "is no folder"
        raise SystemExit(f"The results are to go to {folder}, and {place} {why}: name another folder with --output.")


def _choose(patterns):
    """The notebooks whose names begin with one of the patterns, all without any; in order."""
    notebooks = sorted((CHECKOUT / "notebooks").glob("[0-9]*.ipynb"))
    return sorted({path for pattern in patterns or ["*"] for path in exploring.choose(notebooks, pattern)})


def _report(options):
    """Compare the results with the paper, in claims.csv, in the two READMEs and on the screen."""
    from .lab import front_page
    from .lab.page import write_page
    from .paper import claims

    table = claims.write_claims(results_folder(options.output))
    if options.output == CHECKOUT:
        claims.update_readme(results_folder(CHECKOUT) / "README.md", table)
        front_page.write(CHECKOUT / "README.md", results_folder(CHECKOUT))
        write_page(CHECKOUT)
    print(claims.format_table(table))
    return 0


def _test(options):
    """Run the unit tests, and every notebook against its stored outputs; here, or on emulated machines."""
    import pytest

    from .lab.notebooks import running

    os.chdir(CHECKOUT)
    if options.processors is not None:
        return _test_processors(options.processors, options.extra)
    with running.scratch_output(results_folder(CHECKOUT)) as output:
        os.environ.update(running.output_variables(output))
        code = int(pytest.main(_notebook_testing() + options.extra))
        changed = running.changed_files(output, CHECKOUT)
    for path in changed:
        print(f"{path} is not what the notebooks make: run  python3 -m pegpose_lab reproduce", file=sys.stderr)
    return code or int(bool(changed))


def _notebook_testing():
    """pytest's arguments for running and comparing notebooks."""
    from .lab.notebooks import running

    return [
        *("-n", str(running.WORKERS), "--dist", "loadscope"),
        *("--nbval", "--nbval-current-env", "--nbval-cell-timeout", str(CELL_TIMEOUT)),
        *("--nbval-sanitize-with", str(CHECKOUT / "pegpose_lab" / "tests" / "nbval_sanitize.cfg")),
    ]


def _test_processors(names, extra):
    """Run the notebooks and the tests of digits on emulated machines; print a table."""
    from .lab.notebooks import processors

    outcomes = []
    for machine in processors.choose_machines(names):
        print(f"\n--- {machine.name} ---", flush=True)
        outcomes.append(processors.run_on(machine, CHECKOUT, _notebook_testing() + extra))
        for path in outcomes[-1].changed:
            print(f"reproduce would rewrite {path}", flush=True)
    print(f"\n{processors.table(outcomes)}")
    return 0 if all(outcome.passed for outcome in outcomes) else 1


def _bench(options):
    """Measure circle detection beside its peers and its bound; a full run is written into place."""
    if not options.quick:
        _check_writable(options.output)
    environment.add_bench_packages()
    calibrators.add_calibrators()
    from . import bench
    from .lab import front_page, results

    readme = results_folder(CHECKOUT) / "README.md" if options.output == CHECKOUT and not options.quick else None
    if readme:
        results.block_is_current(readme, "bench", "")  # raises now, not after the run, if there is no place for it
    report = bench.run(bench.QUICK if options.quick else bench.FULL)
    if not options.quick:
        bench.write(report, results_folder(options.output), readme)
    if readme:
        front_page.write(CHECKOUT / "README.md", results_folder(CHECKOUT))
    print(bench.to_text(report))
    if options.quick:
        print("A quick run: it shows that everything works; one frame of each scene says nothing of the aims.")
    return 0


def _lab(options):
    """Open JupyterLab on the notebooks; what they write goes to a scratch folder."""
    scratch = exploring.scratch_folder(CHECKOUT)
    os.environ["PEGPOSE_OUTPUT"] = str(scratch)
    print(
        f"Figures and tables that you make go to {scratch}, emptied at the next start; the project's own stay as they "
        "are. A notebook is saved when you save it; lab --reset NAME takes it back.",
        flush=True,
    )
    return _become([sys.executable, "-m", "jupyterlab", *exploring.jupyterlab_arguments(options, CHECKOUT)])


def _reset(options):
    """Set notebooks back to git's last commit, and say which."""
    restored = exploring.restore(options.reset, CHECKOUT)
    for path in restored:
        print(f"{path} is as in git's last commit again; the changes to it are gone.")
    if not restored:
        print("Nothing to do: the files are as in git's last commit.")
    return 0


def _measure(options):
    """Make the tables of data/measured again."""
    from .lab import measuring

    folder = options.output / "data" / "measured"
    _check_writable(folder)
    if not options.names or {"peer_settings", "peer_counts"} & set(options.names):
        environment.add_bench_packages()
    return measuring.measure(options.names, folder)


def _run(options):
    """Calibrate from a folder of images and find the part in it; without a folder, from rendered sample images."""
    from pathlib import Path

    from .own_images import run_folder, write_sample

    folder = options.folder
    if folder is None:
        folder = Path.cwd() / "pegpose_sample"
        if not (folder / "pegpose.yaml").exists():  # which may have been changed
            print(f"Rendering sample images into {folder}.", flush=True)
            write_sample(folder)
    try:
        found = run_folder(folder, output=options.output)
    except (ValueError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    print(found.summary())
    print("\nwritten:", *found.files, sep="\n  ")
    return 0 if found.calibration is not None else 1


# --- command line -------------------------------------------------------------------------------

COMMANDS = {
    "setup": _setup,
    "reproduce": _reproduce,
    "test": _test,
    "bench": _bench,
    "measure": _measure,
    "run": _run,
    "lab": _lab,
}


def _parse(arguments):
    """The options of a command line, with the function that runs its command."""
    options = command_line.parse(arguments, CHECKOUT)
    options.run = COMMANDS[options.command]
    return options


def _become(command):
    """Go on as another program; where the system cannot (Windows), run it and return its exit code."""
    sys.stdout.flush()
    if os.name != "nt":
        os.execv(command[0], command)
    return subprocess.call(command)


def main(arguments: list[str] | None = None) -> int:
    """Run one command; return the exit code (0 done, 1 failed, 2 wrong command line, 130 interrupted)."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if sys.version_info < OLDEST_PYTHON:
        wanted, found = (".".join(map(str, version[:2])) for version in (OLDEST_PYTHON, sys.version_info))
        raise SystemExit(f"pegpose_lab needs Python {wanted} or newer; this is Python {found} ({sys.executable}).")
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # a path or a unit beyond the locale's letters is no error
    options = _parse(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # clean up as on Ctrl-C
    for name in DROPPED_VARIABLES:
        os.environ.pop(name, None)
    os.environ.update(FIXED_VARIABLES)
    try:
        if options.run is _setup:
            return _setup(options)
        if options.run is _lab and options.reset:
            return _reset(options)
        if options.run is _lab and exploring.root_refused(options):
            raise SystemExit(ROOT_REFUSED)
        environment.set_up()
        if not environment.is_active():
            return _become([str(environment.python()), "-m", "pegpose_lab", *arguments])
        return options.run(options)
    except KeyboardInterrupt:
        print(
            "\nInterrupted: nothing half-written was left behind; `run` and `measure` continue when they are called again.",
            file=sys.stderr,
        )
        return 128 + signal.SIGINT


if __name__ == "__main__":
    sys.exit(main())
