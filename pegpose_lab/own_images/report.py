"""The report: one page with every image's fate, the calibration with its intervals, and the poses."""

from __future__ import annotations

import base64
import html
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd

from .reading import read_picture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..calibration import Calibration
    from .boards import BoardImage
    from .description import Description
    from .frames import Frame

WIDTH = 420  # px, of a thumbnail
MOST_SHOWN = 24  # thumbnails of boards, and of frames: the first ones
GREEN, ORANGE, BLUE = (115, 158, 0), (0, 94, 213), (178, 114, 0)  # the project's colours, in OpenCV's order
UNITS = {"focal_length": "mm", "kappa1": "1/mm²"} | dict.fromkeys(("f_x", "f_y", "c_x", "c_y"), "px")
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 64rem; padding: 0 1rem; color: #222; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #ddd; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
td, th { padding: .25rem .75rem .25rem 0; text-align: left; }
th { border-bottom: 1px solid #999; } td.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
.images { display: grid; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); gap: 1rem; }
figure { margin: 0; break-inside: avoid; } figure img { width: 100%; height: auto; }
figcaption { font-size: .85rem; color: #444; }
.flag { background: #fff4e5; border-left: 4px solid #D55E00; padding: .5rem 1rem; }
"""


def as_html(
    described: Description,
    boards: Sequence[BoardImage],
    calibration: Calibration | None,
    why_not: str,
    frames: Sequence[Frame],
) -> str:
    """The page as a text: no script, nothing that is fetched from elsewhere."""
    used = [one for one in boards if one.used]
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>PegPose Lab report</title><style>{STYLE}</style></head><body>",
        "<h1>Camera and part</h1>",
        _summary(boards, calibration, why_not, frames),
        _described(described),
        "<h2>Camera</h2>",
        _camera(calibration, why_not),
        "<h2>Images of the board</h2>",
        _table(["image", "view (as flags count)", "what became of it"], _board_rows(boards))
        if boards
        else "<p>There are none.</p>",
    ]
    if used:
        parts += [_coverage(boards), _gallery([_board_thumbnail(one) for one in used[:MOST_SHOWN]]), _first(used)]
    if frames:
        seen = [one for one in frames if one.observation is not None]
        parts += [
            "<h2>Poses of the part</h2>",
            _poses(frames),
            _forecasts(described, frames),
            "<h2>Frames of the part</h2>",
        ]
        parts.append(_table(["image", "what became of it"], [(one.path.name, one.fate) for one in frames]))
        parts += [_gallery([_frame_thumbnail(one) for one in seen[:MOST_SHOWN]]), _first(seen)]
    return "\n".join([*parts, "</body></html>\n"])


def _first(images):
    """A line if not all of them are shown."""
    return f"<p>The first {MOST_SHOWN} of {len(images)} are shown.</p>" if len(images) > MOST_SHOWN else ""


def _described(described):
    """The description as it was written, so that a wrong measure is seen."""
    if not described.text:
        return ""
    return f"<details open><summary>What was described (lengths in mm)</summary><pre>{_text(described.text)}</pre></details>"


def _board_rows(boards):
    """Name, number of the view as flags count it, and fate of each image."""
    view, rows = 0, []
    for one in boards:
        rows.append((one.path.name, view if one.used else "", one.fate))
        view += one.used
    return rows


def _summary(boards, calibration, why_not, frames):
    used, posed = sum(one.used for one in boards), sum(one.pose is not None for one in frames)
    doubtful = sum(one.doubtful for one in frames)
    doubt = f", {doubtful} of them doubtful" if doubtful else ""
    told = f" A pose of the part was estimated in {posed} of {len(frames)} frames{doubt}." if frames else ""
    if calibration is None:
        camera = f"The camera is not calibrated: {_text(why_not)}."
    elif not boards:
        camera = "The camera is given; its uncertainty is not in the ± of the poses."
    else:
        camera = f"{used} of {len(boards)} images of the board are used, rms {calibration.rms:.3f} px."
    return f"<p>{camera}{_focal_length(calibration)}{told}</p>"


def _focal_length(calibration):
    """How well it is known, in a sentence."""
    if calibration is None or calibration.covariance is None:
        return ""
    name = next((name for name in ("focal_length", "f_x") if name in calibration.covariance), None)
    if name is None:
        return ""
    low, high = calibration.interval(name)
    return f" The focal length is known to ± {100 * (high - low) / (high + low):.2g} % (95 %)."


def _text(text):
    return html.escape(str(text))


def _table(header, rows, numbers=()):
    cells = "".join(f"<th>{_text(name)}</th>" for name in header)
    body = ""
    for row in rows:
        body += "<tr>" + "".join(
            f'<td class="number">{_text(value)}</td>' if column in numbers else f"<td>{_text(value)}</td>"
            for column, value in enumerate(row)
        ) + "</tr>"  # fmt: skip
    return f"<table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>"


def _camera(calibration, why_not):
    """The parameters with their 95 % intervals, and the flags."""
    if calibration is None:
        return f'<p class="flag">{_text(why_not)}</p>'
    flags = "".join(f'<p class="flag"><b>{_text(flag.code)}</b>: {_text(flag)}</p>' for flag in calibration.flags)
    table = parameter_table(calibration)
    return _table(list(table), table.to_numpy().tolist(), (1, 2)) + flags


def parameter_table(calibration: Calibration) -> pd.DataFrame:
    """The camera's parameters as texts: value, 95 % interval, unit.

    Examples
    --------
    >>> import pegpose_lab as pl
    >>> from pegpose_lab.paper import paper_experiment
    >>> views = paper_experiment()
    >>> points = [views.camera.project(views.board.object_points, pose) for pose in views.cam_from_boards]
    >>> found = pl.calibrate_joint([views.board.object_points] * 5, points, views.camera.sensor)
    >>> parameter_table(found)["parameter"].tolist()
    ['focal_length', 'scale_x', 'kappa1', 'c_x', 'c_y']
    """
    values, rows = calibration.camera.parameters, []
    for name, value in values.items():
        if calibration.covariance is not None and name in calibration.covariance:
            low, high = calibration.interval(name)
            digits = max(0, 1 - int(np.floor(np.log10((high - low) / 4)))) if high > low else 6  # two of the sigma
            texts = [f"{value:.{digits}f}", f"{low:.{digits}f} to {high:.{digits}f}"]
        else:
            tied = name == "f_y" and value == values.get("f_x") and calibration.covariance is not None
            fixed = "given" if calibration.covariance is None else "not estimated"
            texts = [f"{value:.6g}", "as f_x: square pixels" if tied else fixed]
        rows.append([name, *texts, UNITS.get(name, "")])
    return pd.DataFrame(rows, columns=["parameter", "value", "95 % interval", "unit"])


def _coverage(boards):
    """Where in the image the corners lie."""
    used = [one for one in boards if one.used]
    width, height = used[0].size
    scale = WIDTH / width
    canvas = np.full((max(1, round(scale * height)), WIDTH, 3), 245, np.uint8)
    for one in used:
        for x, y in scale * one.corners:
            cv2.circle(canvas, (round(x), round(y)), 2, BLUE, -1, cv2.LINE_AA)
    count = sum(len(one.corners) for one in used)
    caption = f"All {count} corners of the images that are used. Empty parts of the image are not calibrated."
    return _gallery([(canvas, caption, "Map of the corners in the image")])


def _board_thumbnail(one):
    canvas, scale = _shrunk(one.path)
    for x, y in scale * one.corners:
        cv2.circle(canvas, (round(x), round(y)), 3, GREEN, 1, cv2.LINE_AA)
    return canvas, one.path.name, f"Board with its corners, {one.path.name}"


def _frame_thumbnail(frame):
    canvas, scale = _shrunk(frame.path)
    seen = frame.observation
    for number, (center, radius, state) in enumerate(
        zip(seen.peg_centers, seen.peg_radii, seen.states, strict=True), 1
    ):
        color = GREEN if state == "measured" else ORANGE
        x, y = (scale * center).round().astype(int).tolist()
        cv2.circle(canvas, (x, y), max(1, round(scale * radius)), color, 2, cv2.LINE_AA)
        cv2.putText(canvas, str(number), (x - 4, y + 5), cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, 1, cv2.LINE_AA)
    return canvas, frame.path.name, f"Part with its discs, {frame.path.name}"


def _shrunk(path) -> tuple[NDArray[np.uint8], float]:
    image = read_picture(path).image
    scale = WIDTH / image.shape[1]
    small = cv2.resize(image, (WIDTH, max(1, round(scale * image.shape[0]))), interpolation=cv2.INTER_AREA)
    return cv2.cvtColor(small, cv2.COLOR_GRAY2BGR), scale


def _gallery(images):
    shown = ""
    for canvas, caption, alternative in images:
        data = base64.b64encode(cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, 85])[1]).decode("ascii")
        shown += (
            f'<figure><img alt="{_text(alternative)}" src="data:image/jpeg;base64,{data}">'
            f"<figcaption>{_text(caption)}</figcaption></figure>"
        )
    return f'<div class="images">{shown}</div>'


def _poses(frames):
    """Place and turn in each frame, with their standard deviations and flags."""
    rows = []
    for frame in frames:
        if (pose := frame.pose) is None:
            continue
        values = [*pose.cam_from_hub.translation, np.degrees(pose.theta)]
        sigmas = np.sqrt(np.diag(pose.covariance))[[0, 1, 2, 5]] if pose.covariance is not None else np.full(4, np.nan)
        sigmas[3] = np.degrees(sigmas[3])
        stated = [f"{value:.3f} ± {sigma:.3f}" for value, sigma in zip(values, sigmas, strict=True)]
        if frame.doubtful:  # whose sigmas do not hold
            stated = [f"{value:.3f}" for value in values]
        codes = " ".join(flag.code for flag in pose.flags)
        rows.append([frame.path.name, "doubtful" if frame.doubtful else "good", *stated, f"{pose.rms:.3f}", codes])
    if not rows:
        return "<p>No frame has a pose.</p>"
    header = ["frame", "pose", "x (mm)", "y (mm)", "z (mm)", "theta (deg)", "rms (px)", "flags"]
    text = (
        "Place of the part's middle from the camera: x to the right in the image, y down, z away from the camera; theta is the "
        "turn of peg 1 about z. ± is one standard deviation. A doubtful pose has a flag that says why: look at its "
        "image, and at the measures of the part."
    )
    return f"<p>{text}</p>" + _table(header, rows, range(2, 7))


def _forecasts(described, frames):
    """Whether the wheel that is described would go on."""
    told = [(one.path.name, one.forecast) for one in frames if one.forecast is not None]
    if not told:
        return ""
    rows = [
        [
            name,
            f"{100 * one.probabilities['free']:.1f}",
            f"{100 * one.enters:.1f}",
            one.limiting_peg,
            f"{one.free_clearance:.3f}",
        ]
        for name, one in told
    ]
    header = ["frame", "goes on freely (%)", "enters at all (%)", "limiting peg", "clearance for 99.9 % (mm)"]
    text = (
        f"Chance that a wheel with a clearance of {described.wheel.clearance:g} mm goes on, from the pose's covariance and the "
        f"robot's repeatability of {described.robot_repeatability:g} mm. The calibration of the camera to the robot adds an "
        "error of its own."
    )
    return f"<h2>Forecast of the wheel</h2><p>{text}</p>" + _table(header, rows, range(1, 5))
