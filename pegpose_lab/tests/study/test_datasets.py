"""Third-party data: found, downloaded from a server on this machine, or refused with a reason."""

import functools
import hashlib
import http.server
import os
import threading

import numpy as np
import pandas as pd
import pytest

from pegpose_lab.study import datasets

PHOTOGRAPH = bytes(range(256)) * 4
needs_data = pytest.mark.skipif(not os.environ.get("PEGPOSE_DATA"), reason="PEGPOSE_DATA is not set")


class Server(http.server.SimpleHTTPRequestHandler):
    """Serves a folder and counts the requests."""

    def do_GET(self):
        self.server.requested.append(self.path)
        super().do_GET()

    def log_message(self, *args):
        """Keep the tests' output quiet."""


@pytest.fixture
def server(tmp_path):
    """A folder `files` with two files, served on 127.0.0.1."""
    folder = tmp_path / "files"
    folder.mkdir()
    (folder / "one.jpg").write_bytes(PHOTOGRAPH)
    (folder / "two.jpg").write_bytes(PHOTOGRAPH[::-1])
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Server, directory=folder)) as running:
        running.requested = []
        running.address = f"http://127.0.0.1:{running.server_address[1]}"
        thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield running
        running.shutdown()
        thread.join()


@pytest.fixture
def registry(tmp_path, monkeypatch, server):
    """A registry of one data set, `boards`, and an empty cache; PEGPOSE_DATA unset. Returns its table."""
    table = pd.DataFrame(
        {
            "dataset": "boards",
            "file": ["one.jpg", "two.jpg"],
            "url": [f"{server.address}/one.jpg", f"{server.address}/two.jpg"],
            "sha256": [hashlib.sha256(data).hexdigest() for data in (PHOTOGRAPH, PHOTOGRAPH[::-1])],
        }
    )
    monkeypatch.delenv("PEGPOSE_DATA", raising=False)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setattr(datasets, "REGISTRY", tmp_path / "datasets.csv")
    monkeypatch.setattr(datasets.pooch, "os_cache", lambda project: tmp_path / "cache" / project)
    table.to_csv(datasets.REGISTRY, index=False)
    return table


def test_downloads_once_and_verifies(registry, server, tmp_path):
    folder = datasets.dataset("boards")
    assert folder == tmp_path / "cache" / "pegpose_lab" / "boards"
    assert (folder / "one.jpg").read_bytes() == PHOTOGRAPH
    assert (folder / "two.jpg").read_bytes() == PHOTOGRAPH[::-1]
    assert datasets.dataset("boards") == folder
    assert sorted(server.requested) == ["/one.jpg", "/two.jpg"]


def test_damaged_cache_is_downloaded_again(registry, server):
    folder = datasets.dataset("boards")
    (folder / "two.jpg").write_bytes(b"damaged")
    assert (datasets.dataset("boards") / "two.jpg").read_bytes() == PHOTOGRAPH[::-1]
    assert server.requested.count("/two.jpg") == 2


def test_wrong_checksum_is_refused_and_leaves_no_file(registry, tmp_path):
    registry.loc[1, "sha256"] = "0" * 64
    registry.to_csv(datasets.REGISTRY, index=False)
    with pytest.raises(FileNotFoundError, match=r"two\.jpg.*boards.*hash.*PEGPOSE_DATA.*0000"):
        datasets.dataset("boards")
    assert [path.name for path in tmp_path.glob("cache/**/*.jpg")] == ["one.jpg"]


def test_missing_on_the_server(registry):
    registry.loc[0, "url"] += ".gone"
    registry.to_csv(datasets.REGISTRY, index=False)
    with pytest.raises(FileNotFoundError, match=r"one\.jpg.*404.*PEGPOSE_DATA"):
        datasets.dataset("boards")


def test_no_network(registry):
    registry["url"] = "http://127.0.0.1:9/" + registry["file"]
    registry.to_csv(datasets.REGISTRY, index=False)
    with pytest.raises(FileNotFoundError, match="could not be downloaded.*127.0.0.1.*Set PEGPOSE_DATA"):
        datasets.dataset("boards")


def test_no_pinned_address(registry):
    registry["url"] = ""
    registry.to_csv(datasets.REGISTRY, index=False)
    with pytest.raises(FileNotFoundError, match="no address is pinned.*Set PEGPOSE_DATA"):
        datasets.dataset("boards")


@pytest.fixture
def local(registry, tmp_path, monkeypatch):
    """A complete local copy below PEGPOSE_DATA."""
    folder = tmp_path / "local" / "boards"
    folder.mkdir(parents=True)
    (folder / "one.jpg").write_bytes(PHOTOGRAPH)
    (folder / "two.jpg").write_bytes(PHOTOGRAPH[::-1])
    monkeypatch.setenv("PEGPOSE_DATA", str(tmp_path / "local"))
    return folder


def test_local_copy_comes_first(local, server):
    assert datasets.dataset("boards") == local
    assert server.requested == []


def test_local_copy_that_was_changed_is_refused(local):
    (local / "one.jpg").write_bytes(b"changed")
    with pytest.raises(FileNotFoundError, match=r"one\.jpg is not the pinned file"):
        datasets.dataset("boards")


def test_local_copy_that_is_incomplete_is_refused(local):
    (local / "two.jpg").unlink()
    with pytest.raises(FileNotFoundError, match=r"two\.jpg is missing.*unset PEGPOSE_DATA"):
        datasets.dataset("boards")


def test_other_folders_below_the_local_one_are_found(local):
    (local.parent / "more").mkdir()
    assert datasets.dataset("more") == local.parent / "more"


@pytest.mark.parametrize("name", ["", ".", "..", "boards/..", "../local", "nothing", None, 3])
def test_unknown_name_is_refused(local, name):
    with pytest.raises(ValueError, match="expected one of boards, or a folder below"):
        datasets.dataset(name)


def test_unset_local_folder_downloads(local, monkeypatch):
    monkeypatch.setenv("PEGPOSE_DATA", "")
    assert datasets.dataset("boards") != local


def test_registry_is_complete_and_pinned():
    table = pd.read_csv(datasets.REGISTRY, dtype=str, keep_default_na=False)
    assert table.columns.tolist() == ["dataset", "file", "url", "sha256"]
    assert table["sha256"].str.fullmatch("[0-9a-f]{64}").all()
    assert not table.duplicated(["dataset", "file"]).any()
    assert (table["dataset"] == "opencv_left").sum() == 13
    addresses = table.loc[table["dataset"] != "zhang_msr_5view", "url"]
    assert addresses.str.fullmatch(r"https://raw\.githubusercontent\.com/\S+").all()
    assert addresses.str.contains(r"/(?:\d+\.\d+\.\d+|[0-9a-f]{40})/").all(), "a branch is no pin"


@needs_data
@pytest.mark.parametrize("name", ["opencv_left", "willson_coplanar", "zhang_msr_5view"])
def test_real_copies_are_the_pinned_ones(name):
    assert datasets.dataset(name).name == name


@needs_data
@pytest.mark.parametrize(
    ("name", "views", "points"),
    [("opencv_left", 13, 54), ("willson_coplanar", 1, 100), ("zhang_msr_5view", 5, 256)],
)
def test_points_of_real_data(name, views, points):
    object_points, image_points, (width, height) = datasets.load_points(name)
    assert len(object_points) == len(image_points) == views
    for objects, images in zip(object_points, image_points, strict=False):
        assert objects.shape == (points, 3) and images.shape == (points, 2)
        assert not objects[:, 2].any()
        assert np.all((images > 0) & (images < [width, height]))


@needs_data
def test_units_of_real_points():
    """Zhang's inches give his square of about 17 cm; OpenCV's corners are 30 mm apart."""
    zhang = datasets.load_points("zhang_msr_5view")[0][0]
    assert np.allclose(np.ptp(zhang, axis=0), [170.745, 170.745, 0], atol=0.5)
    assert np.linalg.norm(zhang[1] - zhang[0]) == pytest.approx(12.7)
    opencv = datasets.load_points("opencv_left")[0][0]
    assert np.ptp(opencv, axis=0).tolist() == [240, 150, 0]


def test_photographs_without_the_corner_list(tmp_path):
    with pytest.raises(FileNotFoundError, match="find_corners"):
        datasets._load_opencv(tmp_path)


def test_points_of_an_unknown_data_set():
    with pytest.raises(ValueError, match="name is 'visp_circles'; expected one of 'opencv_left'"):
        datasets.load_points("visp_circles")


def views(rng):
    """Two views of a 2 x 3 board."""
    board = np.column_stack([*np.mgrid[:3, :2].reshape(2, -1) * 29.0, np.zeros(6)])
    return ["left12.jpg", "left03.jpg"], [board, board], [rng.uniform(0, 640, (6, 2)) for _ in range(2)]


def test_corners_round_trip(tmp_path):
    names, object_points, image_points = views(np.random.default_rng(1))
    path = tmp_path / "measured" / "corners.csv"
    datasets.write_corners(path, names, object_points, image_points, "made\nby a test")
    assert path.read_text().startswith("# made by a test\nview,i,X,Y,u,v\nleft12.jpg,0,0.0,0.0,")
    found = datasets.read_corners(path)
    assert found[0] == names
    assert np.array_equal(found[1], object_points)
    assert np.abs(np.array(found[2]) - image_points).max() <= 0.5000001e-5


def test_corners_are_refused(tmp_path):
    names, object_points, image_points = views(np.random.default_rng(2))
    path = tmp_path / "corners.csv"
    with pytest.raises(ValueError, match="2, 1 and 2 entries"):
        datasets.write_corners(path, names, object_points[:1], image_points, "")
    with pytest.raises(ValueError, match="0, 0 and 0 entries"):
        datasets.write_corners(path, [], [], [], "")
    with pytest.raises(ValueError, match="leave the plane"):
        datasets.write_corners(path, names, [points + 1 for points in object_points], image_points, "")
    with pytest.raises(ValueError, match="NaN"):
        datasets.write_corners(path, names, object_points, [points * np.nan for points in image_points], "")
    assert not path.exists()


@pytest.mark.parametrize(
    "text", ["view,X,Y,u,v\na,0,0,1,2\n", "view,i,X,Y,u,v\na,0,0,0,1,\n", "view,i,X,Y,u,v\na,0,0,0,1,x\n"]
)
def test_unreadable_corners_are_refused(tmp_path, text):
    path = tmp_path / "corners.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match="expected"):
        datasets.read_corners(path)
