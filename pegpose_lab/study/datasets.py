"""Third-party photographs and point lists: used if they are on this machine, else downloaded once; never committed.

`dataset` looks in the folder that the environment variable ``PEGPOSE_DATA`` names, then in a cache of its own,
which it fills from pinned addresses.  data/datasets.csv lists each file with its address and its SHA-256; a file
with other bytes is refused wherever it comes from.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pooch

from ..checks import as_choice, as_matched_points
from ..files import PROJECT_FOLDER
from ..lab import results

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from numpy.typing import ArrayLike, NDArray

REGISTRY = PROJECT_FOLDER / "data" / "datasets.csv"
_CORNER_COLUMNS = ["view", "i", "X", "Y", "u", "v"]
_MM_PER_INCH = 25.4


def dataset(name: str) -> Path:
    """Return the folder of a third-party data set.

    Parameters
    ----------
    name : str
        A data set of data/datasets.csv, or any folder below the one that ``PEGPOSE_DATA`` names.

    Returns
    -------
    pathlib.Path
        The folder below ``PEGPOSE_DATA`` if it is there, else the cache's, downloaded if need be.

    Raises
    ------
    ValueError
        If nothing of that name is known.
    FileNotFoundError
        If a file is missing, cannot be downloaded or is not the pinned one; the message says what to do.

    Examples
    --------
    >>> import os, tempfile
    >>> from pathlib import Path
    >>> from unittest import mock
    >>> from pegpose_lab import study
    >>> with tempfile.TemporaryDirectory() as root, mock.patch.dict(os.environ, PEGPOSE_DATA=root):
    ...     Path(root, "my_board").mkdir()
    ...     study.dataset("my_board").name
    'my_board'
    """
    registry = results.read_csv(REGISTRY, as_text=True)
    files = registry[registry["dataset"] == name]
    folder = _local_folder(name)
    if folder is None and files.empty:
        raise ValueError(
            f"name is {name!r}; expected one of {', '.join(registry['dataset'].unique())}, "
            "or a folder below the one that the environment variable PEGPOSE_DATA names"
        )
    if folder is None:
        return _download(name, files)
    for row in files.itertuples():
        _check(folder / row.file, row.sha256)
    return folder


def _local_folder(name):
    """The folder of that name below PEGPOSE_DATA, or None."""
    root, name = os.environ.get("PEGPOSE_DATA"), str(name)
    if not root or name in ("", ".", "..") or Path(name).name != name:
        return None
    folder = Path(root) / name
    return folder if folder.is_dir() else None


def _check(path, sha256):
    """Raise if a file of a data set is missing or differs from the pinned version (SHA-256)."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; complete the folder, or unset PEGPOSE_DATA to download it")
    if hashlib.sha256(path.read_bytes()).hexdigest() != sha256:
        raise FileNotFoundError(f"{path} is not the pinned file (SHA-256 {sha256}); put an unchanged copy there")


def _download(name, files):
    """Download a registered data set into its folder in the cache; existing files are only checked."""
    folder = Path(pooch.os_cache("pegpose_lab")) / name
    files = files.set_index("file")
    registry, addresses = files["sha256"].to_dict(), files["url"].to_dict()
    fetcher = pooch.create(folder, base_url="", registry=registry, urls=addresses)
    for file, address in addresses.items():
        try:
            if not address:
                raise ValueError("no address is pinned for this file")
            fetcher.fetch(file)
        except (OSError, ValueError) as error:
            raise FileNotFoundError(
                f"{file} of data set {name} could not be downloaded from {address or 'anywhere'}: {error}. "
                f"Set PEGPOSE_DATA to a folder that holds {name}/{file} with SHA-256 {registry[file]}"
            ) from error
    return folder


def load_points(name: str) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]], tuple[int, int]]:
    """Return the matched points of a planar data set.

    Parameters
    ----------
    name : {"opencv_left", "zhang_msr_5view", "willson_coplanar"}
        opencv_left: OpenCV's own corners with a 5 px window, beside the photographs below ``PEGPOSE_DATA`` only.

    Returns
    -------
    object_points, image_points : list of (n, 3) and (n, 2) arrays
        mm and px, an entry for each view.
    image_size : tuple
        (width, height), px.  Willson's file does not state a height; its width is given for both.

    Raises
    ------
    ValueError, FileNotFoundError
        As `dataset` does; ValueError also for a data set without matched points.
    """
    loaders = {"opencv_left": _load_opencv, "zhang_msr_5view": _load_zhang, "willson_coplanar": _load_willson}
    name = as_choice(name, "name", loaders)
    return loaders[name](dataset(name))


def _load_opencv(folder):
    """Corners of the 13 photographs."""
    path = folder / "points_cv2_subpix5.csv"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing; measure the photographs' corners with find_corners instead")
    _, object_points, image_points = read_corners(path)
    return object_points, image_points, (640, 480)


def _load_zhang(folder):
    """Zhang's 256 corners of squares in each of 5 views; the model is in inches."""
    model = np.loadtxt(folder / "Model.txt").reshape(-1, 2) * _MM_PER_INCH
    object_points = np.column_stack([model, np.zeros(len(model))])
    views = [np.loadtxt(folder / f"data{k}.txt").reshape(-1, 2) for k in range(1, 6)]
    return [object_points.copy() for _ in views], views, (640, 480)


def _load_willson(folder):
    """Willson's 100 coplanar points: x y z (mm) and X Y (px) in each line."""
    points = np.loadtxt(folder / "cc_cd.dat")
    return [points[:, :3].copy()], [points[:, 3:].copy()], (576, 576)


def read_corners(
    path: str | PathLike[str],
) -> tuple[list[str], list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Read corners of a planar target from a CSV with the columns view, i, X, Y (mm), u, v (px).

    Lines that begin with # are comments.

    Returns
    -------
    names : list of str
        The views, in the file's order.
    object_points, image_points : list of (n, 3) and (n, 2) arrays
        mm and px, an entry for each view.

    Raises
    ------
    ValueError
        If a column is missing or a value is not a finite number.
    """
    table = results.read_csv(path, dtype={"view": str})
    if not set(_CORNER_COLUMNS) <= set(table.columns):
        expected = ", ".join(_CORNER_COLUMNS)
        raise ValueError(f"path {path} has columns {', '.join(table.columns)}; expected {expected}")
    views = dict(iter(table.groupby("view", sort=False)))
    matched = [
        as_matched_points(view.assign(z=0.0)[["X", "Y", "z"]].to_numpy(), view[["u", "v"]].to_numpy())
        for view in views.values()
    ]
    return list(views), [objects for objects, _ in matched], [images for _, images in matched]


def write_corners(
    path: str | PathLike[str],
    names: Sequence[str],
    object_points: Sequence[ArrayLike],
    image_points: Sequence[ArrayLike],
    comment: str,
) -> None:
    """Write corners of a planar target in the format of `read_corners`, with a comment as the first line.

    Image points are rounded to 1e-5 px.

    Raises
    ------
    ValueError
        If the lists differ in length, a view's points do not match, or the target is not in the plane z = 0.
    """
    lengths = [len(names), len(object_points), len(image_points)]
    if len(set(lengths)) > 1 or not lengths[0]:
        raise ValueError(
            "names, object_points and image_points have {}, {} and {} entries; ".format(*lengths)
            + "expected one entry for each view"
        )
    tables = [_corner_table(*view) for view in zip(names, object_points, image_points, strict=True)]
    results.write_csv(path, pd.concat(tables), comment=comment)


def _corner_table(name, object_points, image_points):
    """One view as a table."""
    objects, images = as_matched_points(object_points, image_points)
    if np.any(objects[:, 2]):
        raise ValueError("object_points leave the plane z = 0; expected a planar target in its own frame")
    columns = [str(name), np.arange(len(objects)), *objects[:, :2].T, *np.round(images, 5).T]
    return pd.DataFrame(dict(zip(_CORNER_COLUMNS, columns, strict=False)))
