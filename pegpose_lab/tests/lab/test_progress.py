"""What is shown while packages are installed."""

import sys

import pytest

from pegpose_lab.lab import progress

PIP = """Ignoring colorama: markers 'sys_platform == "win32"' don't match your environment
Collecting anyio==4.16.0 (from -r environment.txt (line 3))
  Downloading anyio-4.16.0-py3-none-any.whl (134 kB)
Processing /wheels/attrs-26.1.0-py3-none-any.whl (from -r environment.txt (line 9))
Requirement already satisfied: pip in lib
Installing collected packages: anyio, attrs
"""
UV = """Resolved 4 packages in 1.20s
Downloading numpy (16.1MiB)
 Downloaded numpy
"""


@pytest.mark.parametrize(
    ("said", "total", "fetched"),
    [(PIP, 4, 3), (UV, 4, 1), (UV + "Prepared 4 packages in 2.16s\n", 4, 4), ("", 5, 0)],
)
def test_lines_of_the_installers_are_counted(said, total, fetched):
    count = progress.Count(5)
    for line in said.splitlines():
        count.read(line)
    assert (count.total, count.fetched) == (total, fetched)


def _installer(folder, end):
    """A program that says what pip says, and installs one package."""
    said = "\n".join(f"Collecting package-{number}" for number in range(3))
    code = (
        f"import pathlib, sys, time; print({said!r}, flush=True); pathlib.Path({str(folder)!r}, 'a.dist-info').mkdir();"
        f"time.sleep(1); print('ERROR: the network is down', file=sys.stderr); sys.exit({end})"
    )
    return [sys.executable, "-c", code]


def test_progress_is_shown_and_nothing_else(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(progress, "INTERVAL", 0.3)
    assert progress.run(_installer(tmp_path, 0), tmp_path, 7) == 0
    shown = capfd.readouterr()
    assert "3 of 7 packages fetched, 1 installed" in shown.out
    assert "Collecting" not in shown.out + shown.err and "ERROR" not in shown.err


def test_a_failing_installer_is_quoted(tmp_path, capfd):
    assert progress.run(_installer(tmp_path, 3), tmp_path, 7) == 3
    assert "ERROR: the network is down" in capfd.readouterr().err


def test_a_terminal_has_one_line_written_over(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    progress.run(_installer(tmp_path, 0), tmp_path, 7)
    shown = capsys.readouterr().out
    assert shown.count("\n") == 0 and shown.startswith("\r") and shown.endswith("\r\x1b[K")
