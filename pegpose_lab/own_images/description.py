"""What is in a folder of images: the board, the part, and which files show them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..checks import as_number
from .measures import board_of, in_one_unit, names_of, part_of, radii_of, ring_of, wheel_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike
    from typing import Any

    from ..insertion import Wheel
    from ..patterns import RingPattern
    from ..targets import Checkerboard, Hub

FILE = "pegpose.yaml"
TEXTS = (".txt", ".md", ".csv", ".json", ".yaml", ".yml", ".html", ".xml", ".log", ".ini", ".db")
EXAMPLE = """board: {columns: 8, rows: 6, square: 29.0}   # inner corners along a row and a column; mm
part: {n_pegs: 4, pitch_circle_diameter: 97.05, peg_radius: 10.1}   # mm; or ring: {n: 4, pitch_radius: 48.5, disc_radius: 10.1}
boards: boards/*   # images of the board, in a folder of their own; and frames: frames/*, images of the part
"""


@dataclass(frozen=True)
class Description:
    """What is in a folder of images.

    Attributes
    ----------
    board : Checkerboard or None
        None if the camera is calibrated already.
    part : Hub, RingPattern or None
        None if only the camera is to be calibrated.
    boards, frames : str
        Patterns of file names, relative to the folder.
    pixel_pitch : float
        mm; without it 1, and the focal length is in px.
    lens : str
        As for `calibrate_joint`.
    coefficients : tuple of str
        Of the lens, as for `calibrate_joint`.
    radius_range : (float, float) or None
        Of a ring's discs, px.
    camera : str or None
        File of a calibration (OpenCV's or ROS's), relative to the folder, in place of images of a board.
    plane : str or None
        Name of the board's image that lay in the plane of the pegs, or "last"; without it all six numbers are estimated.
    wheel : Wheel or None
        That is to go on the part; what is not given fits the part.
    robot_repeatability : float
        Of the robot that places the wheel, mm (RP of ISO 9283).
    text : str
        As it is written in its file.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> Description(pl.Checkerboard(8, 6, 29.0)).boards
    'boards/*'
    """

    board: Checkerboard | None
    part: Hub | RingPattern | None = None
    boards: str = "boards/*"
    frames: str = "frames/*"
    pixel_pitch: float = 1.0
    lens: str = "perspective"
    coefficients: tuple[str, ...] = ("k1", "k2", "p1", "p2")
    radius_range: tuple[float, float] | None = None
    camera: str | None = None
    plane: str | None = None
    wheel: Wheel | None = None
    robot_repeatability: float = 0.0
    text: str = ""

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Description:
        """The description from the values of a YAML file.

        Raises
        ------
        ValueError
            If a key is unknown, a measure is missing, or a value is unusable; the message names it.

        Examples
        --------
        >>> Description.of({"board": {"columns": 8, "rows": 6, "square": 29.0}}).board.square
        29.0
        """
        if not isinstance(values, dict) or not ("board" in values or "camera" in values):
            raise ValueError(f"it does not describe a board; expected lines such as\n{EXAMPLE}")
        known = {field.name for field in fields(cls)} - {"text"} | {"ring"}
        unknown = sorted(map(str, set(values) - known))
        if unknown:
            raise ValueError(f"{unknown[0]} is unknown; expected some of {', '.join(sorted(known))}")
        if "part" in values and "ring" in values:
            raise ValueError("it has both part and ring; expected one of them")
        empty = [
            name
            for name in ("board", "part", "ring", "wheel", "boards", "frames")
            if name in values and values[name] is None
        ]
        if empty:
            raise ValueError(f"{empty[0]} is empty: leave it out, or say what it is")
        for name in ("boards", "frames", "lens", "camera", "plane"):
            if name in values and not isinstance(values[name], str):
                raise ValueError(f"{name} is {values[name]!r}; expected a text")
        meaningless = {
            "plane": ("camera", "camera" in values),
            "coefficients": ("equidistant", values.get("lens") == "equidistant"),
            "robot_repeatability": ("no wheel", "wheel" not in values),
        }
        for name, (other, given) in meaningless.items():
            if name in values and given:
                raise ValueError(f"{name} has no meaning with {other}: leave it out")
        made = {name: value for name, value in values.items() if name != "ring"}
        made["board"] = board_of(values["board"]) if "board" in values else None
        for name, make in (("part", part_of), ("ring", ring_of)):
            if name in values:
                made["part"] = make(values[name])
        if "wheel" in values:
            made["wheel"] = wheel_of(values["wheel"], made.get("part"))
        if values.get("radius_range") is not None:
            made["radius_range"] = radii_of(values["radius_range"])
        if values.get("coefficients") is not None:
            made["coefficients"] = names_of(values["coefficients"])
        as_number(values.get("robot_repeatability", 0.0), "robot_repeatability", 0)
        in_one_unit(made["board"], made.get("part"))
        return cls(**made)

    def paths(self, folder: Path, pattern: str) -> list[Path]:
        """The files that match a pattern, in order of their names, without hidden ones and texts."""
        if Path(pattern).is_absolute():
            folder, pattern = Path(Path(pattern).anchor), str(Path(pattern).relative_to(Path(pattern).anchor))
        found = (path for path in folder.glob(pattern) if path.is_file())
        return sorted(path for path in found if path.suffix.lower() not in TEXTS and not path.name.startswith("."))


def read_description(folder: str | PathLike[str]) -> Description:
    """Read the file `FILE` of a folder.

    Raises
    ------
    ValueError
        If it is missing or unusable; the message says what to write.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     _ = Path(name, FILE).write_text(EXAMPLE)
    ...     read_description(name).board
    Checkerboard(columns=8, rows=6, square=29.0)
    """
    import yaml

    path = Path(folder, FILE)
    if not path.parent.is_dir():
        raise ValueError(f"{path.parent} is no folder")
    if not path.is_file():
        raise ValueError(f"{path} is missing; write one with lines such as\n{EXAMPLE}")
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
        return replace(Description.of(yaml.safe_load(text)), text=text)
    except yaml.YAMLError as error:
        raise ValueError(f"{path} is no YAML: {error}") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
