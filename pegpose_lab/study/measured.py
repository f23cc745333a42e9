"""What the package's own methods measured in third-party photographs: data/measured/.

``python3 -m pegpose_lab.study.measured`` finds the photographs (see `datasets.dataset`) and writes every file anew;
notebooks read the files, so that they do not need the photographs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..files import replacing
from .circle_counts import BITS_FILE, COUNTS_FILE, MISSED_FILE, count_circles, measure_bits
from .datasets import write_corners
from .photographs import (
    CORNERS_FILE,
    FOLDER,
    GRID_FILE,
    LEFT_BOARD,
    LEFT_SIZE,
    SENSITIVITY_FILE,
    measure_corners,
    measure_grid,
    measure_sensitivity,
)
from .segmented_parts import PARTS_FILE, count_parts

if TYPE_CHECKING:
    from pathlib import Path

COMMAND = "python3 -m pegpose_lab.study.measured"


def write_measured(folder: Path = FOLDER) -> None:
    """Measure everything anew and write it below `folder`; errors as in `measure_corners` and `count_circles`."""
    counts, missed = count_circles()
    for name, table, what in (
        (COUNTS_FILE, counts, "circles found in photographs with known counts"),
        (SENSITIVITY_FILE, measure_sensitivity(), "joint calibration of opencv_left by three corner detectors"),
        (MISSED_FILE, missed.round(3), "discs not found in them (px), the share of their rim with a step, and why"),
        (BITS_FILE, measure_bits(), "the places of screws4-a: is a screw there, and is one found"),
        (PARTS_FILE, count_parts(), "discs that are a part of their own by segment and by Otsu's threshold alone"),
    ):
        with replacing(folder / name) as path:
            table = table.to_csv(index=False, lineterminator="\n")
            path.write_text(f"# {what}; made by: {COMMAND}\n{table}", encoding="utf-8")
    comment = (
        "centres of the discs' images by fit_discs in ViSP's circles-01..05.jpg (320 x 240 px), grid of 6 x 6 discs, "
        f"X Y in mm, u v in px; made by: {COMMAND}"
    )
    write_corners(folder / GRID_FILE, *measure_grid(), comment)
    comment = (
        f"corners by find_corners in OpenCV's left01..left14.jpg ({LEFT_SIZE[0]} x {LEFT_SIZE[1]} px), board of "
        f"{LEFT_BOARD.columns} x {LEFT_BOARD.rows} corners, X Y in mm, u v in px; made by: {COMMAND}"
    )
    write_corners(folder / CORNERS_FILE, *measure_corners(), comment)


if __name__ == "__main__":
    write_measured()
