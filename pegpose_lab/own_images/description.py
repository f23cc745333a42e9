"""What is in a folder of images: the board, the part, and which files show them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from ..checks import as_number
from ..insertion import Wheel
from ..patterns import RingPattern
from ..targets import Checkerboard, Hub

if TYPE_CHECKING:
    from collections.abc import Mapping
    from os import PathLike
    from typing import Any

FILE = "pegpose.yaml"
ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".webp")
EXAMPLE = """board: {columns: 8, rows: 6, square: 29.0}   # inner corners along a row and a column; mm
part: {n_pegs: 4, pitch_circle_diameter: 97.05, peg_radius: 10.1}   # mm; or ring: {n: 4, pitch_radius: 48.5, disc_radius: 10.1}
boards: boards/*   # images of the board; and frames: frames/*, images of the part
"""


@dataclass(frozen=True)
class Description:
    """What is in a folder of images.

    Attributes
    ----------
    board : Checkerboard
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

    Examples
    --------
    >>> Description(Checkerboard(8, 6, 29.0)).boards
    'boards/*'
    """

    board: Checkerboard
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

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Description:
        """The description from the values of a YAML file.

        Raises
        ------
        ValueError
            If a key is unknown, the board is missing, or a value is unusable; the message names it.

        Examples
        --------
        >>> Description.of({"board": {"columns": 8, "rows": 6, "square": 29.0}, "part": {"n_pegs": 4}}).part.n_pegs
        4
        """
        if not isinstance(values, dict) or "board" not in values:
            raise ValueError(f"it does not describe a board; expected lines such as\n{EXAMPLE}")
        known = {field.name for field in fields(cls)} | {"ring"}
        unknown = sorted(set(values) - known)
        if unknown:
            raise ValueError(f"{unknown[0]} is unknown; expected some of {', '.join(sorted(known))}")
        values = dict(values)
        if "part" in values and "ring" in values:
            raise ValueError("it has both part and ring; expected one of them")
        ring, part = values.pop("ring", None), values.pop("part", None)
        made = {"board": _made(Checkerboard, values.pop("board"), "board")}
        if part is not None:
            made["part"] = _made(Hub, part, "part")
        if ring is not None:
            made["part"] = _made(RingPattern, ring, "ring")
        if (wheel := values.pop("wheel", None)) is not None:
            made["wheel"] = _fitting(wheel, made.get("part"))
        if values.get("coefficients") is not None:
            values["coefficients"] = tuple(values["coefficients"])
        if values.get("radius_range") is not None:
            values["radius_range"] = _as_range(values["radius_range"])
        as_number(values.get("robot_repeatability", 0.0), "robot_repeatability", 0)
        return cls(**made, **values)

    def paths(self, folder: Path, pattern: str) -> list[Path]:
        """The images that match a pattern, in order of their names."""
        return sorted(path for path in folder.glob(pattern) if path.suffix.lower() in ENDINGS and path.is_file())


def _made(kind, values, name):
    """A board, hub or ring of the values; ValueError that names the key."""
    if not isinstance(values, dict):
        raise ValueError(f"{name} is {values!r}; expected its measures, such as {{columns: 8, rows: 6, square: 29.0}}")
    try:
        return kind(**values)
    except TypeError as error:
        allowed = ", ".join(field.name for field in fields(kind))
        raise ValueError(
            f"{name} has a key that is not known, or lacks one ({error}); expected some of {allowed}"
        ) from error
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def _fitting(values, part):
    """The wheel for a part; its holes lie where the pegs are, if nothing else is said."""
    if not isinstance(part, Hub):
        raise ValueError(
            "wheel needs a part with pegs: part: {n_pegs: ..., pitch_circle_diameter: ..., peg_radius: ...}"
        )
    fits = {"n_holes": part.n_pegs, "pitch_circle_diameter": part.pitch_circle_diameter}
    return _made(Wheel, fits | values if isinstance(values, dict) else values, "wheel")


def _as_range(pair):
    """Smallest and largest radius, px."""
    if not isinstance(pair, (list, tuple)) or len(pair) != 2:
        raise ValueError(f"radius_range is {pair!r}; expected [smallest, largest] in px")
    low = as_number(pair[0], "radius_range[0]", 0, exclusive=True)
    return low, as_number(pair[1], "radius_range[1]", low, 1e5)


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
    if not path.is_file():
        raise ValueError(f"{path} is missing; write one with lines such as\n{EXAMPLE}")
    try:
        return Description.of(yaml.safe_load(path.read_text(encoding="utf-8-sig", errors="replace")))
    except yaml.YAMLError as error:
        raise ValueError(f"{path} is no YAML: {error}") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
