"""The command line: the arguments of ``python3 -m pegpose_lab`` and the text of its ``--help``.

Like ``__main__.py``, this file must run on a bare Python, so it imports only the standard library.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from . import measuring


def parse(arguments: list[str], checkout: Path) -> argparse.Namespace:
    """Parse the command line; arguments after ``--`` are kept unchanged in the option ``extra``."""
    parser = _parser(checkout)
    dashes = arguments.index("--") if "--" in arguments else len(arguments)
    options = parser.parse_args(arguments[:dashes])
    options.extra = arguments[dashes + 1 :]
    if options.extra and options.command not in ("test", "lab"):
        parser.error(f"{options.command} takes no arguments after --")
    return options


def _parser(checkout):
    """The parser; commands write into the checkout unless another folder is given."""
    parser = argparse.ArgumentParser(
        prog="python3 -m pegpose_lab",
        description="Reproduce the paper, and test that it is reproduced. Each command first makes .venv in the "
        "checkout with the packages pinned in environment.txt, or finds it current.",
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    commands.add_parser("setup", help="make or update .venv only")

    reproduce = commands.add_parser(
        "reproduce",
        help="run the notebooks, write figures and results, print the claims table",
        description="Run the notebooks outside the tree, two at a time. Once all of them have succeeded, move "
        "their figures and results into place and print each of the paper's numbers beside ours.",
    )
    _add_output(reproduce, checkout, "write DIR/figures and DIR/data/results (default: the checkout)")
    reproduce.add_argument(
        "--notebooks",
        nargs="+",
        metavar="NAME",
        help="run these only: names, beginnings of names (03) or patterns (0[1-3]*); "
        "the existing results of the others are used",
    )
    reproduce.add_argument(
        "--update-notebooks",
        action="store_true",
        help="also store the outputs in the notebooks: the way in which committed outputs are made",
    )

    test = commands.add_parser(
        "test",
        help="run the unit tests, and the notebooks against their stored outputs",
        epilog="Arguments after -- go to pytest:  test -- -k camera",
    )
    test.add_argument(
        "--processors",
        nargs="*",
        metavar="NAME",
        help="run the notebooks and the tests of digits as on other processors (emulated), with two threads and under "
        "the other Pythons that are found, instead of all tests here; with NAMEs, such as Nehalem or 'Python 3.12', "
        "on these machines only",
    )

    bench = commands.add_parser(
        "bench",
        help="measure circle detection beside its peers and the physical limit",
        description="Render frames with exact truth and give them to our circle measurement and to its peers: "
        "time, detection, and errors over the bound; about a quarter of an hour on two idle cores. Installs the "
        "peers into .venv first (the optional group bench, opencv-contrib in a folder of its own, and 0.7 GB of other "
        "calibration tools in environments of their own); one that "
        "cannot be installed is left out and named. Writes data/results/bench_*.csv and the README's table.",
    )
    _add_output(bench, checkout, "write DIR/data/results (default: the checkout, and its README)")
    bench.add_argument("--quick", action="store_true", help="a few frames, some seconds; writes nothing")

    measure = commands.add_parser(
        "measure",
        help="make the tables of data/measured again",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Make the tables of data/measured again, which notebooks read: only those with a given NAME, or\n"
        "without a NAME all that can be made. Tables of photographs need PEGPOSE_DATA, the folder of the photographs.",
        epilog=measuring.listed(),
    )
    measure.add_argument("names", nargs="*", type=measuring.known, metavar="NAME", help="one of the names below")
    _add_output(measure, checkout, "write DIR/data/measured (default: the checkout)")

    run = commands.add_parser(
        "run",
        help="calibrate from your own images, find your part in them, and write a report",
        description="Find the board in the images of a folder, calibrate the camera, find the part in its frames, and "
        "write calibration (OpenCV, ROS), poses (CSV, ROS) and one HTML report into FOLDER/pegpose. FOLDER/pegpose.yaml "
        "describes board and part (keys: notebook 13); images are in FOLDER/boards and FOLDER/frames. Without FOLDER, "
        "sample images are rendered into ./pegpose_sample and used. "
        "A run that was interrupted goes on where it stopped.",
    )
    run.add_argument("folder", nargs="?", type=_folder, metavar="FOLDER", help="images and pegpose.yaml")
    run.add_argument("--output", type=_folder, metavar="DIR", help="where to write (default: FOLDER/pegpose)")

    lab = commands.add_parser(
        "lab",
        help="open JupyterLab on the notebooks",
        description="Open JupyterLab on the notebooks. What they write goes to notebooks/scratch, which git ignores; "
        "nothing is saved by itself.",
        epilog="Arguments after -- go to JupyterLab:  lab -- --ServerApp.password=''",
    )
    lab.add_argument("--no-browser", action="store_true", help="open no browser; the address is printed")
    lab.add_argument(
        "--port", type=int, metavar="N", help="the port to serve on (default: 8888, or the next that is free)"
    )
    lab.add_argument("--ip", metavar="ADDRESS", help="the address to serve on (default: localhost; 0.0.0.0 for all)")
    lab.add_argument("--allow-root", action="store_true", help="start though root runs it, as in a container")
    lab.add_argument(
        "--reset",
        nargs="+",
        metavar="NAME",
        help="open nothing: set these notebooks back to git's last commit, without asking; names as for reproduce",
    )
    return parser


def _add_output(parser, checkout, what):
    """The option --output."""
    parser.add_argument("--output", type=_folder, default=checkout, metavar="DIR", help=what)


def _folder(text):
    """A typed folder as an absolute path."""
    return Path(text).resolve()
