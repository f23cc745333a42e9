"""Your own images: a folder of photographs in, a calibration, poses and one report out.

`description` reads what board and part are, and `measures` checks it; `reading` reads any image, `boards` finds corners,
`frames` tracks the part, `writing` writes the files, `report` the page, `sample` renders images to try it with, and
`folder` leads through them.
"""

from .boards import BoardImage
from .description import Description, read_description
from .folder import FolderRun, run_folder
from .reading import Picture, read_picture
from .report import parameter_table
from .sample import write_sample
from .writing import forecast_table

__all__ = [
    "BoardImage",
    "Description",
    "FolderRun",
    "Picture",
    "forecast_table",
    "parameter_table",
    "read_description",
    "read_picture",
    "run_folder",
    "write_sample",
]
