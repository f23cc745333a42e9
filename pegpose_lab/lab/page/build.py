"""Writes ``figures/index.html``: one file that opens without a server, a kernel or a network."""

from __future__ import annotations

import base64
import html
import io
import json
import re
from pathlib import Path

from PIL import Image

from ...files import replacing
from ...paper import claims
from .. import results
from ..front_page import findings, quality
from .figures import Shown, figures
from .sliders import Slider, sliders

HERE = Path(__file__).parent
SEQUENCE = "The 45 frames, with the pegs' numbers, the line from the hub's centre to peg 1, and the estimated pose"
MEANINGS = {
    claims.RECOVERED: "The rendering was given this number, and the method finds it again. This tests the method; it says "
    "nothing about the authors' board.",
    claims.ARITHMETIC: "It follows from other printed numbers alone, without an image.",
    claims.REPRODUCED: "Nothing that was given fixes it, and our result agrees within the tolerance, or is at most as large "
    "where the paper states a limit (such as an error below 1 mm).",
    "contradicted": "Printed numbers alone, or all that the paper leaves open, exclude it.",
    "not determined": "The result depends on something that the paper does not print.",
    "input": "It was adopted for the rendered experiment, so nothing can be said about it.",
}
"""Of the verdicts in claims.csv, for a reader of the table."""

COLUMNS = ("where", "quantity", "paper", "ours", "unit", "verdict", "reason")


def write_page(folder: Path) -> None:
    """Write ``figures/index.html`` below a folder, from the figures and results in it.

    Raises
    ------
    FileNotFoundError
        If a figure or a table is missing.
    """
    with replacing(folder / "figures" / "index.html") as path:
        path.write_text(page_text(folder), encoding="utf-8", newline="\n")


def page_text(folder: Path) -> str:
    """The page as a text."""
    tables = folder / "data" / "results"
    moved = sliders(tables)
    states = json.dumps({one.name: {"kind": one.kind, "states": one.states} for one in moved}, ensure_ascii=False)
    parts = [
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1"><title>PegPose Lab: the results</title>',
        f"<style>{(HERE / 'page.css').read_text(encoding='utf-8')}</style></head><body>",
        "<h1>Where are the pegs, and will the wheel go on?</h1>",
        "<p>The results of PegPose Lab, which reproduces, examines and goes beyond the paper <i>Vision Based Pose Estimation "
        "of Multiple Peg-in-Hole for Robotic Assembly</i>. Everything here is computed by the project's notebooks or measured "
        "by one of its commands; the files are named below each part.</p>",
        '<nav><a href="#findings">Findings</a><a href="#move">Sliders</a><a href="#figures">Figures</a>'
        '<a href="#claims">Every printed number</a></nav>',
        _scene(folder),
        _sequence(folder),
        f'<h2 id="findings">Findings</h2>{_list(findings(tables))}<div class="scroll">{_rows(quality(tables))}</div>',
        '<h2 id="move">Sliders</h2><p>Each slider moves through stored results; nothing is computed here.</p>',
        *(_slider(one) for one in moved),
        '<h2 id="figures">Figures</h2>',
        *(_figure(folder, one) for one in figures() if one.name != "12_scene"),
        '<h2 id="claims">Every printed number, and ours</h2>',
        f"<p>{html.escape(claims.summary(claims.claims_table(results.load_values(tables))))}</p>",
        _verdicts(tables),
        f'<div class="scroll">{_claims(tables)}</div>',
        f'<script type="application/json" id="states">{states.replace("</", "<" + chr(92) + "/")}</script>',
        f"<script>{(HERE / 'page.js').read_text(encoding='utf-8')}</script></body></html>\n",
    ]
    return "\n".join(parts)


def _image(folder, name, alternative):
    """The figure in 256 colours, which is a third of its size and looks the same."""
    with Image.open(folder / "figures" / f"{name}.png") as image:
        small = image.convert("RGB").quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    content = io.BytesIO()
    small.save(content, "PNG", optimize=True)
    return _embedded(content.getvalue(), "png", alternative)


def _embedded(content, kind, alternative):
    data = base64.b64encode(content).decode("ascii")
    return f'<img alt="{html.escape(alternative)}" src="data:image/{kind};base64,{data}">'


def _sequence(folder):
    """The 45 frames, moving."""
    image = _embedded((folder / "figures" / "06_sequence.gif").read_bytes(), "gif", SEQUENCE)
    source = f'<span class="source">{_linked("notebooks/06_peg_pose.ipynb, figures/06_sequence.gif")}</span>'
    return f"<figure>{image}<figcaption>{SEQUENCE}.<br>{source}</figcaption></figure>"


def _scene(folder):
    image = _image(folder, "12_scene", "Camera, boards, hub with four pegs and the wheel in front of it, to scale")
    return f"<figure>{image}<figcaption>The rendered experiment, to scale.</figcaption></figure>"


def _figure(folder: Path, shown: Shown) -> str:
    question = f"<b>{_code(shown.question)}</b><br>" if shown.question else ""
    caption = f'{question}{_code(shown.caption)}<br><span class="source">{_linked(shown.source)}</span>'
    return f"<figure>{_image(folder, shown.name, shown.alternative)}<figcaption>{caption}</figcaption></figure>"


def _slider(one: Slider) -> str:
    last = len(one.states) - 1
    return (
        f'<div class="slider" data-slider="{one.name}"><h3><label for="slide-{one.name}">{html.escape(one.title)}</label></h3>'
        f'<output></output><svg role="img" aria-label="{html.escape(one.title)}"></svg>'
        f'<input type="range" id="slide-{one.name}" min="0" max="{last}" value="{one.start}">'
        f'<p class="source">{_linked(one.source)}</p></div>'
    )


def _bold(text):
    """Markdown's bold as HTML, the rest escaped."""
    return re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", html.escape(text))


def _code(text):
    """Markdown's code and emphasis as HTML, its links as their texts, the rest escaped."""
    text = re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", html.escape(text, quote=False))
    return re.sub(r"\*([^*]+)\*", r"<i>\1</i>", re.sub(r"`([^`]+)`", r"<code>\1</code>", text))


def _linked(source):
    """A line that names files of the project, each as a link that works where the page lies in it."""
    return re.sub(r"(?:notebooks|data|figures)/[\w/]+\.\w+", r'<a href="../\g<0>">\g<0></a>', html.escape(source))


def _list(lines):
    return "<ol>" + "".join(f"<li>{_bold(line)}</li>" for line in lines) + "</ol>"


def _rows(rows):
    """A table whose first row is its header; each cell knows the name of its column, which a narrow screen shows."""
    header, *body = ([html.escape(cell) for cell in row] for row in rows)
    lines = ["".join(f"<th>{cell}</th>" for cell in header)]
    lines += [
        "".join(f'<td data-column="{name}">{cell}</td>' for name, cell in zip(header, row, strict=True)) for row in body
    ]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def _verdicts(tables):
    """What the words of the column *verdict* mean: of those that occur."""
    given = set(results.read_csv(tables / "claims.csv", as_text=True)["verdict"])
    terms = [f"<dt>{word}</dt><dd>{meaning}</dd>" for word, meaning in MEANINGS.items() if word in given]
    return "<dl>" + "".join(terms) + "</dl>"


def _claims(tables):
    table = results.read_csv(tables / "claims.csv", as_text=True)
    return _rows([list(COLUMNS), *table[list(COLUMNS)].to_numpy().tolist()])
