"""The paper: every number that it prints, and its experiment with the truth.

`numbers` reads the printed values, `experiment` has the truth of the rendered experiment, `claims`
compares, `diagrams` draws.  A printed number is one line in data/paper/printed.csv, its rule one in
claims.csv.
"""

from .experiment import (
    N_FRAMES,
    SHIFT_PER_FRAME,
    TURN_PER_FRAME,
    Experiment,
    paper_camera,
    paper_experiment,
    paper_pose,
)
from .numbers import (
    corner_count,
    corner_stretch,
    image_size,
    mm_per_pixel,
    printed,
    printed_numbers,
    table1,
    table1_rotation,
    table2,
    table3,
)

__all__ = [
    "Experiment",
    "N_FRAMES",
    "SHIFT_PER_FRAME",
    "TURN_PER_FRAME",
    "corner_count",
    "corner_stretch",
    "image_size",
    "mm_per_pixel",
    "paper_camera",
    "paper_experiment",
    "paper_pose",
    "printed",
    "printed_numbers",
    "table1",
    "table1_rotation",
    "table2",
    "table3",
]
