"""Files are replaced as a whole, and nobody meets half a file."""

import os
import stat

import pytest

from pegpose_lab import files


def test_replacing_writes_and_leaves_nothing_else(tmp_path):
    target = tmp_path / "new" / "file.csv"
    with files.replacing(target) as path:
        assert path.parent == target.parent and path.suffix == ".csv" and path != target
        path.write_text("whole")
        assert not target.exists()
    assert target.read_text() == "whole"
    assert os.listdir(target.parent) == ["file.csv"]


@pytest.fixture
def umask():
    """Set the umask; it is set back after the test."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


posix = pytest.mark.skipif(os.name == "nt", reason="Windows has no such modes, and links for administrators only")


@posix
@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_a_new_file_has_the_mode_of_the_umask(tmp_path, umask, mask, mode):
    umask(mask)
    with files.replacing(tmp_path / "new.csv") as path:
        path.write_text("x")
    assert stat.S_IMODE((tmp_path / "new.csv").stat().st_mode) == mode


@posix
@pytest.mark.parametrize("mode", [0o600, 0o444, 0o664, 0o755])
def test_a_replaced_file_keeps_its_mode_and_is_never_wider(tmp_path, mode):
    target = tmp_path / "file.csv"
    target.write_text("old")
    target.chmod(mode)
    with files.replacing(target) as path:
        assert not stat.S_IMODE(path.stat().st_mode) & ~(mode | stat.S_IWUSR)
        path.write_text("new")
    assert stat.S_IMODE(target.stat().st_mode) == mode and target.read_text() == "new"


@posix
@pytest.mark.parametrize("there", [True, False])
def test_a_link_goes_on_pointing_to_what_is_written(tmp_path, there):
    target, link = tmp_path / "elsewhere" / "file.csv", tmp_path / "link.csv"
    target.parent.mkdir()
    if there:
        target.write_text("old")
    link.symlink_to(target)
    with files.replacing(link) as path:
        path.write_text("new")
    assert link.is_symlink() and target.read_text() == link.read_text() == "new"
    assert os.listdir(target.parent) == ["file.csv"]


@posix
@pytest.mark.parametrize("there", [True, False])
def test_a_file_system_without_modes_will_do(tmp_path, monkeypatch, there):
    """As CIFS, S3 and some mounts of NTFS are: every file has one mode, and chmod is refused."""

    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    target = tmp_path / "file.csv"
    if there:
        target.write_text("old")
        target.chmod(0o600)
    monkeypatch.setattr(os, "chmod", refuse)
    monkeypatch.setattr(os, "chown", refuse)
    with files.replacing(target) as path:
        path.write_text("new")
    assert target.read_text() == "new" and os.listdir(tmp_path) == ["file.csv"]


@posix
def test_owner_and_group_are_given_back(tmp_path, monkeypatch):
    """As when root saves over a user's private file; who that is, is made up here."""
    given = []
    monkeypatch.setattr(os, "chown", lambda path, *owner: given.append(owner))
    target = tmp_path / "file.csv"
    target.write_text("old")
    before = target.stat()
    files._give_back(target, os.stat_result([*before[:4], before.st_uid + 1, before.st_gid, *before[6:10]]))
    assert given == [(before.st_uid + 1, before.st_gid)]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("before", [None, "old"])
def test_replacing_keeps_the_old_file_when_it_fails(tmp_path, error, before):
    target = tmp_path / "file.csv"
    if before is not None:
        target.write_text(before)
    with pytest.raises(error), files.replacing(target) as path:
        path.write_text("half")
        raise error
    assert os.listdir(tmp_path) == ([] if before is None else ["file.csv"])
    assert before is None or target.read_text() == before
