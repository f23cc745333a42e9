"""Writes pictures as an animated GIF, which Markdown can show; the same pictures give the same bytes.

The palette is fixed: greys, and shades of a few colours.  The description is stored as the file's comment, and
`notebooks.agreement` compares it like the text of a figure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_rgb

from ..files import output_folder, replacing

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

GREYS = 32
SHADES = (1.0, 0.75, 0.5, 0.25)
"""Shares of a colour in its mixtures with `GROUND`: rims of drawn lines are such mixtures."""
GROUND = 60
"""Grey value of what lines are mostly drawn on."""


def save_animation(
    pictures: Iterable[NDArray[np.uint8]],
    name: str,
    description: str,
    *,
    colors: Sequence[str] = (),
    duration: int = 160,
) -> Path:
    """Write pictures as figures/<name>.gif below the output folder; it repeats for ever.

    Parameters
    ----------
    pictures : iterable of (height, width, 3) uint8 array
        All of the same size.  Each pixel gets the nearest colour of the `palette`, without dithering.
    name : str
    description : str
        What is to be seen, with its numbers; kept in the file, and compared by `notebooks.agreement.files_agree`.
    colors : sequence of str
        Colours other than grey.
    duration : int
        Time of a picture, ms; a GIF keeps hundredths of a second.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        If there is no picture, or their sizes differ.
    """
    from PIL import Image  # Pillow comes with matplotlib

    known = palette(colors)
    entries: dict[int, int] = {}  # palette's numbers by colour
    frames = []
    for picture in pictures:
        frame = Image.fromarray(_nearest(np.asarray(picture), known, entries))
        frame.putpalette(known.astype(np.uint8).tobytes())
        frames.append(frame)
    if len({frame.size for frame in frames}) != 1:
        raise ValueError(f"pictures have sizes {sorted({frame.size for frame in frames})}; expected one size of all")
    target = output_folder() / "figures" / f"{name}.gif"
    options = {"save_all": True, "append_images": frames[1:], "duration": duration, "loop": 0}
    with replacing(target) as path:
        frames[0].save(path, format="GIF", comment=description.encode("utf-8"), **options)
    return target


def palette(colors: Sequence[str] = ()) -> NDArray[np.int64]:
    """The colours of a file (n, 3), 0 to 255: `GREYS` from black to white, then `SHADES` of each colour."""
    greys = np.rint(np.linspace(0, 255, GREYS))[:, None] * np.ones(3)
    shades = [GROUND + share * (255 * np.array(to_rgb(color)) - GROUND) for color in colors for share in SHADES]
    return np.rint(np.vstack([greys, *shades])).astype(np.int64)


def _nearest(picture, known, entries):
    """Numbers (height, width) of the palette's nearest colours; `entries` remembers them by colour."""
    packed = picture.astype(np.int64) @ (65536, 256, 1)
    present, places = np.unique(packed, return_inverse=True)
    fresh = [value for value in present.tolist() if value not in entries]
    if fresh:
        values = np.array(fresh)[:, None] // (65536, 256, 1) % 256
        distances = np.sum((values[:, None] - known) ** 2, axis=2)
        distances[np.ptp(values, axis=1) == 0, GREYS:] = distances.max() + 1  # a grey stays a grey
        entries.update(zip(fresh, np.argmin(distances, axis=1).tolist(), strict=True))
    numbers = np.array([entries[value] for value in present.tolist()], np.uint8)
    return numbers[places].reshape(packed.shape)
