"""The corners in each image of a board: found once, kept, and found again only if the image or the board changes."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from joblib import Parallel, delayed
from tqdm import tqdm

from ..checks import DetectionError
from ..corners import locate_board
from ..files import replacing
from .reading import read_picture

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..targets import Checkerboard

LEAST_CORNERS = 12  # of a view that is used: its pose alone has six parameters


@dataclass(frozen=True, eq=False)
class BoardImage:
    """What was found in one image of the board.

    Attributes
    ----------
    path : Path
    fate : str
        What became of it, in a sentence.
    size : (int, int) or None
        Width and height, px; None if it could not be read.
    index : (n,) ndarray of int
        Which corners of the board are seen.
    corners : (n, 2) ndarray
        px.
    used : bool
        Whether the calibration uses it.

    Examples
    --------
    >>> from pathlib import Path
    >>> BoardImage(Path("a.png"), "no board found").used
    False
    """

    path: Path
    fate: str
    size: tuple[int, int] | None = None
    index: NDArray[np.int64] | None = None
    corners: NDArray[np.float64] | None = None
    used: bool = False


def find_boards(
    paths: list[Path], board: Checkerboard, kept: Path, *, workers: int, progress: bool
) -> list[BoardImage]:
    """Find the corners in all images; what is in the folder `kept` of an earlier run is not searched again.

    Of images of several sizes, those of the most frequent one are used.
    """
    found = {path: known for path in paths if (known := _from_earlier(path, board, kept)) is not None}
    new = [path for path in paths if path not in found]
    jobs = (delayed(_found)(path, board, kept) for path in new)
    done = Parallel(n_jobs=max(1, min(workers, len(new))), return_as="generator")(jobs)
    bar = tqdm(done, total=len(paths), initial=len(found), unit="image", desc="boards", disable=not progress)
    found |= dict(zip(new, bar, strict=True))
    return _of_one_size([found[path] for path in paths])


def _of_one_size(found):
    """The images with those marked as used whose size most have."""
    sizes = Counter(one.size for one in found if one.corners is not None)
    if not sizes:
        return found
    (size, _), *others = sizes.most_common()
    marked = []
    for one in found:
        if one.corners is None:
            marked.append(one)
        elif one.size != size:
            fate = f"{one.fate}; not used: it has {one.size[0]} x {one.size[1]} px, and {size[0]} x {size[1]} is more frequent"
            marked.append(replace(one, fate=fate))
        elif len(one.index) < LEAST_CORNERS:
            marked.append(replace(one, fate=f"{one.fate}; not used: fewer than {LEAST_CORNERS} corners"))
        else:
            marked.append(replace(one, used=True))
    return marked


def _from_earlier(path, board, kept):
    """What an earlier run found in the same image with the same board, or None."""
    try:
        return _from_store(path, json.loads(_store(path, board, kept).read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError):  # there is none, or it is damaged
        return None


def _found(path, board, kept):
    """The corners of an image, which are kept for the next run."""
    found = _searched(path, board)
    with replacing(_store(path, board, kept)) as temporary:
        temporary.write_text(json.dumps(_to_store(found)), encoding="utf-8")
    return found


def _store(path, board, kept):
    """A file whose name changes with the image and the board."""
    status = path.stat()
    what = f"{path.name} {status.st_size} {status.st_mtime_ns} {board!r}"
    return kept / f"{hashlib.sha256(what.encode()).hexdigest()[:16]}.json"


def _searched(path, board):
    try:
        picture = read_picture(path)
    except (ValueError, OSError) as error:
        return BoardImage(path, f"not read: {error}")
    notes = "".join(f" ({note})" for note in picture.notes)
    try:
        seen = locate_board(picture.image, board)
    except (DetectionError, ValueError) as error:
        return BoardImage(path, f"no board{notes}: {error}", picture.size)
    count = len(board.object_points)
    return BoardImage(path, f"{len(seen.index)} of {count} corners{notes}", picture.size, seen.index, seen.image_points)


def _to_store(found):
    size = None if found.size is None else list(found.size)
    corners = None if found.corners is None else found.corners.tolist()
    index = None if found.index is None else found.index.tolist()
    return {"fate": found.fate, "size": size, "index": index, "corners": corners}


def _from_store(path, values):
    size = None if values["size"] is None else tuple(values["size"])
    if values["corners"] is None:
        return BoardImage(path, values["fate"], size)
    return BoardImage(path, values["fate"], size, np.array(values["index"]), np.reshape(values["corners"], (-1, 2)))
