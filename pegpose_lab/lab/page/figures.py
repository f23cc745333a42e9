"""Which figures the page shows, with captions: those of the paper, and the picture of each notebook."""

from __future__ import annotations

from dataclasses import dataclass

from ..notebooks.contents import Entry, entries


@dataclass(frozen=True)
class Shown:
    """A figure of the page: its file's name, alternative text, caption, and the notebook that makes it."""

    name: str
    alternative: str
    caption: str
    notebook: str


PAPER = (
    Shown("fig01_assembly", "Drawing of robot, wheel, hub and camera with the transforms of Eqs. 1 and 2 between them",
          "Fig. 1: the fixed camera sees the hub, the robot holds the wheel; Eqs. 1 and 2 as arrows.", "06_peg_pose"),
    Shown("fig02_overview", "Flow chart of the method's steps from frame to pose",
          "Fig. 2: the method's steps, on a rendered frame.", "01_segmentation"),
    Shown("fig04_camera_model", "Drawing of the camera model with the undistorted and the distorted image point",
          "Fig. 4: the camera model with radial distortion (Eq. 3).", "03_tsai_calibration"),
    Shown("fig05_orientation", "Drawing of the hub's face with line 1 from its centre to peg 1 and the angle theta",
          "Fig. 5: the orientation θ, from the hub's centre to peg 1 (Eq. 11).", "06_peg_pose"),
    Shown("fig06_error_histogram", "Histogram of re-projection distances",
          "Fig. 6: re-projection distances; the printed limit is dotted.", "07_error_histograms"),
    Shown("fig07_error_scatter", "Scatter plot of re-projection errors in x and y",
          "Fig. 7: re-projection errors in x and y.", "07_error_histograms"),
)  # fmt: skip

OWN = "13_your_images"


def figures() -> list[Shown]:
    """The paper's figures, then one of each notebook with its question and answer as caption.

    Examples
    --------
    >>> figures()[0].name
    'fig01_assembly'
    """
    listed = list(PAPER)
    known = {shown.name for shown in listed}
    for entry in entries():
        if entry.name == OWN:  # of the reader's images, not of the results
            continue
        name = entry.picture.rsplit("/", 1)[-1].removesuffix(".png")
        if name not in known:
            listed.append(Shown(name, entry.alternative, _caption(entry), entry.name))
    return listed


def _caption(entry: Entry) -> str:
    return f"{entry.title}. {entry.answer}"
