"""A folder of sample images, rendered: five boards, six frames of the hub, and the file that describes them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2

from ..files import replacing
from ..paper import paper_experiment
from .description import FILE

if TYPE_CHECKING:
    from os import PathLike

FRAMES = (0, 9, 18, 27, 36, 44)
TEXT = """# All measures in mm.
board: {columns: 8, rows: 6, square: 29.0}
part: {n_pegs: 4, pitch_circle_diameter: 97.05, peg_radius: 10.1}
wheel: {clearance: 0.1}   # radius of a hole minus that of a peg
robot_repeatability: 0.05   # RP of the robot's data sheet
plane: last            # the last board lay on the tops of the pegs
"""


def write_sample(folder: str | PathLike[str]) -> Path:
    """Render the paper's experiment into a folder as somebody would photograph it; returns the folder.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     sorted(path.name for path in write_sample(name).iterdir())
    ['boards', 'frames', 'pegpose.yaml']
    """
    folder, experiment = Path(folder), paper_experiment()
    for index in range(5):
        _write(folder / "boards" / f"board-{index + 1}.png", experiment.board_image(index))
    for index in FRAMES:
        _write(folder / "frames" / f"frame-{index + 1:02d}.png", experiment.hub_frame(index))
    with replacing(folder / FILE) as temporary:
        temporary.write_text(TEXT, encoding="utf-8")
    return folder


def _write(path, image):
    with replacing(path) as temporary:
        temporary.write_bytes(cv2.imencode(".png", image)[1].tobytes())
