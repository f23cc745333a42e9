"""Commands in a process of their own."""

import os
import subprocess
import sys

from pegpose_lab.lab import environment

CHECKOUT = environment.CHECKOUT


# --- running notebooks --------------------------------------------------------------------------


WRITE = """import os
from pathlib import Path
folder = Path(os.environ["PEGPOSE_OUTPUT"])
"""


def _start(checkout, arguments, **variables):
    """Start a command in a process of its own, on a checkout that needs no set-up.

    A shell's background job ignores Ctrl-C, and so do its children: the command is given Python's own handler.
    """
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import sys; from pathlib import Path; from pegpose_lab import __main__ as commands\n"
        "from pegpose_lab.lab import environment\n"
        "environment.set_up, environment.VENV = bool, Path(sys.prefix)\n"
        f"commands.CHECKOUT = Path({str(checkout)!r})\n"
        f"sys.exit(commands.main({arguments!r}))"
    )
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=CHECKOUT,
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
