"""What all tests share: where they may write, where third-party data are, how hypothesis runs."""

import os
from contextlib import ExitStack
from pathlib import Path

import pytest
from hypothesis import settings

from pegpose_lab import __main__ as commands
from pegpose_lab.__main__ import FIXED_VARIABLES
from pegpose_lab.lab import environment
from pegpose_lab.lab.environment import CHECKOUT
from pegpose_lab.lab.notebooks import running

# No deadlines: a busy machine is no bug. On CI the same examples every time.
settings.register_profile("pegpose_lab", deadline=None, derandomize=bool(os.environ.get("CI")))
settings.load_profile("pegpose_lab")

# Modules of tests that compare computed digits with stored ones, or with an exact truth: they are run on every emulated
# processor (`pegpose_lab.lab.notebooks.processors`).
DIGITS = {
    "test_bundle", "test_calibration_files", "test_company", "test_genetic", "test_joint", "test_little_tilt",
    "test_many_views", "test_measured", "test_monte_carlo", "test_objective", "test_operators", "test_oracle", "test_pose",
    "test_pose_fit", "test_profile", "test_stages", "test_tsai", "test_unusable_views",
}  # fmt: skip


@pytest.hookimpl(tryfirst=True)  # before -m chooses by the marks
def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.stem in DIGITS:
            item.add_marker("digits")


def pytest_configure(config):
    """Give notebooks a folder to write into, with the results they read, unless the command has named one."""
    for name, value in FIXED_VARIABLES.items():
        os.environ.setdefault(name, value)
    if os.environ.get("PEGPOSE_OUTPUT"):
        return
    stack = ExitStack()
    output = stack.enter_context(running.scratch_output(CHECKOUT / "data" / "results"))
    os.environ["PEGPOSE_OUTPUT"] = str(output)
    config.add_cleanup(stack.close)


def data_folder(variables):
    """The folder of third-party data; skips the test where it is not named, and fails it on CI."""
    folder = variables.get("PEGPOSE_DATA")
    if folder:
        if not Path(folder).is_dir():
            pytest.fail(f"PEGPOSE_DATA names {folder!r}, which is no folder")
        return Path(folder)
    if variables.get("CI"):
        pytest.fail("PEGPOSE_DATA is not set: on CI tests of third-party data are never skipped")
    pytest.skip("PEGPOSE_DATA does not name a folder of third-party data")


@pytest.fixture(scope="session")
def pegpose_data():
    """The folder of third-party data (Path)."""
    return data_folder(os.environ)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout with a lock only."""
    (tmp_path / "environment.txt").write_text("numpy==2.4.6\n")
    monkeypatch.setattr(commands, "CHECKOUT", tmp_path)
    monkeypatch.setattr(environment, "CHECKOUT", tmp_path)
    monkeypatch.setattr(environment, "LOCK", tmp_path / "environment.txt")
    monkeypatch.setattr(environment, "VENV", tmp_path / ".venv")
    return tmp_path
