"""A box to drop photographs into: they are written into a folder, for `own_images.run_folder`."""

from __future__ import annotations

import html
from pathlib import Path
from typing import TYPE_CHECKING

import ipywidgets

from ...files import replacing
from ...own_images import read_picture

if TYPE_CHECKING:
    from os import PathLike
    from typing import Any

KINDS = ("boards", "frames")


class UploadBox(ipywidgets.VBox):
    """Two buttons that take images, of the board and of the part, and say what became of each.

    Parameters
    ----------
    folder : path
        Images go into its folders ``boards`` and ``frames``.

    Attributes
    ----------
    buttons : dict of FileUpload
        By the name of the folder.
    text : str
        What was taken, a line for each file.
    """

    def __init__(self, folder: str | PathLike[str]):
        self.folder, self.text = Path(folder), ""
        self.buttons = {
            kind: ipywidgets.FileUpload(accept="image/*", multiple=True, description=kind) for kind in KINDS
        }
        for button in self.buttons.values():
            button.observe(self._take, names="value")
        self._told = ipywidgets.HTML()
        super().__init__([ipywidgets.HBox(list(self.buttons.values())), self._told])

    def _take(self, change: Any) -> None:
        """Write the files of one button; names are reduced to their last part, so none leaves the folder."""
        kind = next(kind for kind, button in self.buttons.items() if button is change["owner"])
        lines = []
        for file in change["new"]:
            path = self.folder / kind / Path(file["name"].replace("\\", "/")).name
            with replacing(path) as temporary:
                temporary.write_bytes(bytes(file["content"]))
            try:
                picture = read_picture(path)
                lines.append(
                    f"{path.name}: {picture.size[0]} x {picture.size[1]} px"
                    + "".join(f", {note}" for note in picture.notes)
                )
            except ValueError as error:
                path.unlink()
                lines.append(f"{path.name}: not taken: {error}")
        self.text = "\n".join([*self.text.splitlines(), *lines])
        self._told.value = f"<pre>{html.escape(self.text)}</pre>"

    def __repr__(self):
        """A short text that is the same in every run, because a notebook stores it with the widget."""
        return f"upload box: {', '.join(KINDS)}"


def upload_box(folder: str | PathLike[str]) -> UploadBox:
    """Return a box that writes uploaded images into ``folder/boards`` and ``folder/frames``."""
    return UploadBox(folder)
