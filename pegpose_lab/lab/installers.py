"""The tools that make an environment and install into it; standard library only."""

import re
import shutil
import subprocess
from importlib import metadata


class SetUpError(SystemExit):
    """The environment cannot be made; the message says why and what to do."""


def _venv_commands(base, folder, has_venv):
    """The commands that can make an environment for the Python `base`: uv, the module venv, virtualenv, if present."""
    uv, virtualenv = shutil.which("uv"), shutil.which("virtualenv")
    commands = []
    if uv:
        commands.append([uv, "venv", "--quiet", "--seed", "--allow-existing", "--python", base, folder])
    if has_venv:
        commands.append([base, "-m", "venv", folder])
    if virtualenv:
        commands.append([virtualenv, "--quiet", "--python", base, folder])
    return commands


def _has_package(requirement):
    """Whether the running Python has the package of a requirement, in any version."""
    try:
        return bool(metadata.version(re.match(r"[\w.-]+", requirement).group()))
    except metadata.PackageNotFoundError:
        return False


def _run_first(commands, task, run=None):
    """Run commands until one succeeds; `run` runs one and returns its exit code (default: `subprocess.call`)."""
    if all((run or subprocess.call)(command) for command in commands):
        raise SetUpError(f"{task} failed; the lines above say why. Once that is fixed, run the command again.")
