"""Every number that the paper prints, read from data/paper/printed.csv with its place in the paper.

Each number has an id, such as ``"T1-ga.f"`` (Table 1, genetic stage, f) or ``"T2.X3"`` (Table 2, metric x of
peg 3).  `printed` reads one, `printed_numbers` all; the tables of the paper are the same numbers in its layout.
Nothing here is ours except `mm_per_pixel`, `corner_count` and `corner_stretch`, which follow from them alone.
"""

from __future__ import annotations

import difflib
import functools
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..files import PAPER_FOLDER
from ..lab import results

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from pandas import DataFrame


@functools.cache
def _numbers():
    """The rows of the CSV, indexed by id, with the parsed number beside the printed text."""
    table = results.read_csv(PAPER_FOLDER / "printed.csv", as_text=True, index_col="id")
    table.insert(3, "value", table["printed"].astype(float))
    return table


def printed_numbers() -> DataFrame:
    """Return a DataFrame of all printed numbers.

    Returns
    -------
    DataFrame
        Indexed by id: where (place in the paper), quantity, printed (the digits, as text), value (float), unit.

    Examples
    --------
    >>> printed_numbers().at["T1-ga.f", "unit"]
    'mm'
    """
    return _numbers().copy()


def printed(identifier: str) -> float:
    """Return the printed number with this id as a float.

    Raises
    ------
    ValueError
        If there is no such id.

    Examples
    --------
    >>> printed("T1-ga.f")
    47.95
    """
    if identifier not in _numbers().index:
        near = difflib.get_close_matches(str(identifier), _numbers().index) or _numbers().index[:5]
        raise ValueError(f"identifier is {identifier!r}; expected an id such as {', '.join(near)}")
    return float(_numbers().at[identifier, "value"])


def image_size() -> tuple[int, int]:
    """Return (width, height) in px (Sect. 4).

    Examples
    --------
    >>> image_size()
    (1600, 1200)
    """
    return int(printed("setup.width")), int(printed("setup.height"))


def table1() -> DataFrame:
    """Return Table 1 without its rotation: stage (linear, genetic), f, t_x, t_y, t_z (mm), kappa1.

    The printed unit of kappa1 is pixel^-2; only mm^-2 on the sensor makes sense of it (see `corner_stretch`).

    Examples
    --------
    >>> table1()["stage"].tolist()
    ['linear', 'genetic']
    """
    fields = {"f": "f", "t_x": "Tx", "t_y": "Ty", "t_z": "Tz", "kappa1": "kappa1"}
    rows = [
        {"stage": stage} | {name: printed(f"T1-{tag}.{field}") for name, field in fields.items()}
        for stage, tag in (("linear", "linear"), ("genetic", "ga"))
    ]
    return pd.DataFrame(rows)


def table1_rotation() -> NDArray[np.float64]:
    """Return Table 1's rotation matrix (3, 3) as printed, the same for both stages; orthonormal to 1.3e-3.

    Examples
    --------
    >>> table1_rotation().shape
    (3, 3)
    """
    return np.array([printed(f"T1-R.r{k}") for k in range(1, 10)]).reshape(3, 3)


def table2() -> DataFrame:
    """Return Table 2, the pegs in frame 1: peg (1..4), x_px, y_px, x_mm, y_mm.

    Examples
    --------
    >>> table2()["peg"].tolist()
    [1, 2, 3, 4]
    """
    columns = {"x_px": "x", "y_px": "y", "x_mm": "X", "y_mm": "Y"}
    pegs = range(1, 5)
    table = {name: [printed(f"T2.{letter}{peg}") for peg in pegs] for name, letter in columns.items()}
    return pd.DataFrame({"peg": list(pegs)} | table)


def table3() -> DataFrame:
    """Return Table 3, errors of peg 1's radius: first_frame, last_frame, radius_mm, mean_mm, sd_mm.

    Examples
    --------
    >>> list(table3().columns)
    ['first_frame', 'last_frame', 'radius_mm', 'mean_mm', 'sd_mm']
    """
    ranges = [identifier.removeprefix("T3.mean.") for identifier in _numbers().index if "T3.mean." in identifier]
    ends = np.array([[int(frame) for frame in frames.split("-")] for frames in ranges])
    return pd.DataFrame(
        {
            "first_frame": ends[:, 0],
            "last_frame": ends[:, 1],
            "radius_mm": printed("T3.radius"),
            "mean_mm": [printed(f"T3.mean.{frames}") for frames in ranges],
            "sd_mm": [printed(f"T3.sd.{frames}") for frames in ranges],
        }
    )


def mm_per_pixel() -> float:
    """Return the single scale that takes Table 2's pixels to its millimetres, by least squares over its 8 pairs.

    All eight printed coordinates are this scale times the printed pixels, to their last digit.

    Examples
    --------
    >>> round(mm_per_pixel(), 3)
    0.207
    """
    pixels, metric = table2()[["x_px", "y_px"]].to_numpy().ravel(), table2()[["x_mm", "y_mm"]].to_numpy().ravel()
    return float(pixels @ metric / (pixels @ pixels))


def corner_count() -> int:
    """Return how many checkerboard corners the setup of Sect. 4 has over all orientations (6 x 8 x 5).

    Examples
    --------
    >>> corner_count()
    240
    """
    return int(printed("setup.corner_rows") * printed("setup.corner_columns") * printed("setup.orientations"))


def corner_stretch() -> float:
    """Return x_u / x_d = 1 + k_1 r^2 (Eq. 3) in the corner of the image, with k_1 in px^-2 as Table 1 prints it.

    Examples
    --------
    >>> corner_stretch() > 1
    True
    """
    return 1 + printed("T1-ga.kappa1") * float(np.sum(np.square(image_size()))) / 4
