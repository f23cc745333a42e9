"""Memory for one frame, and time as a function of the image size."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pandas as pd
from tqdm import tqdm

from ..render import expose
from . import contrib, peers
from .scenes import MAIN, RADIUS_RANGE, _camera, draw_frame
from .score import _match, one_thread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from .detectors import Method


def peak_memory(method: Method) -> float:
    """Megabytes that a method needs for one 1600 x 1200 px frame, in addition to a process with all imports.

    A fresh process loads the frame and runs the method on a small part of it.  Then it runs the method on the whole
    frame and reports the increase from its memory before to its peak memory.
    """
    with tempfile.TemporaryDirectory(prefix="pegpose_") as folder:
        path = Path(folder, "frame.npy")
        np.save(path, expose(draw_frame(MAIN[1], 0).picture, 5, 0))
        code = "import sys; from pegpose_lab.bench import resources; resources.tell_memory(*sys.argv[1:])"
        served = method.module == peers.CONTRIB_MODULE
        variables = contrib.contrib_variables() if served else dict(os.environ)
        command = [sys.executable, "-c", code, method.name, path]
        return float(subprocess.run(command, env=variables, check=True, capture_output=True, text=True).stdout)


def tell_memory(name: str, path: str) -> None:
    """Print the result for `peak_memory`; runs in a process of its own."""
    cv2.setNumThreads(1)
    image, method = np.load(path), peers.COMPARED[name]
    peers.run(method, np.ascontiguousarray(image[:200, :200]), RADIUS_RANGE)
    before = _memory("VmRSS")
    peers.run(method, image, RADIUS_RANGE)
    print(max(_memory("VmHWM") - before, 0.0))


def _memory(field):
    """Resident memory now (VmRSS) or its peak (VmHWM), MB.

    On other systems than Linux this is the peak in both cases.  On Linux getrusage is not used, because its peak is
    that of the parent process if that was larger.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return int(status.split(field + ":")[1].split()[0]) / 1024
    except OSError:
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def measure_sizes(
    sizes: Sequence[float], *, methods: Sequence[str] = (peers.OURS, peers.REFERENCE), repeats: int = 3
) -> pd.DataFrame:
    """Time as a function of the image size: the same scene with more pixels, radii and radius range in proportion.

    Parameters
    ----------
    sizes : sequence of float
        Megapixels.
    methods : sequence of str
    repeats : int

    Returns
    -------
    DataFrame
        megapixels, method, ms (median), ms_per_megapixel, pegs (detected, of four).
    """
    rows = []
    with one_thread():
        for size in tqdm(sizes, unit="size", desc="sizes ", disable=None):
            camera = _scaled(_camera(), np.sqrt(1e6 * size / np.prod(_camera().image_size)))
            frame = draw_frame(MAIN[0], 0, camera)
            image = expose(frame.picture, 5, 0)
            scale = camera.image_size[0] / _camera().image_size[0]
            limits = tuple(scale * radius for radius in RADIUS_RANGE)
            times, pegs = {name: [] for name in methods}, {}
            for _ in range(repeats + 1):
                for name in methods:
                    found, seconds = peers.run(peers.COMPARED[name], image, limits)
                    times[name].append(seconds)
                    pegs[name] = _detected_pegs(frame, found)
            for name, seconds in times.items():
                ms = 1e3 * float(np.median(seconds[1:]))  # the first run warms up
                rows.append((image.size / 1e6, name, ms, ms / (image.size / 1e6), pegs[name]))
    return pd.DataFrame(rows, columns=["megapixels", "method", "ms", "ms_per_megapixel", "pegs"])


def _detected_pegs(frame, found):
    """The number of the frame's pegs that a method detected."""
    free = np.ones(len(found), bool)
    return sum(_match(disc.truth, found, free) is not None for disc in frame.discs if disc.peg)


def _scaled(camera, scale):
    """The same camera with `scale` times the pixels along each axis, its principal point in the image centre."""
    scaled = camera.scaled(scale)
    width, height = scaled.image_size
    return replace(scaled, principal_point=((width - 1) / 2, (height - 1) / 2))


def growth(sizes: pd.DataFrame, method: str = peers.OURS) -> float:
    """Exponent of time over size: the slope of ln(ms) over ln(megapixels)."""
    rows = sizes[sizes["method"] == method]
    return exponent(rows["megapixels"], rows["ms"])


def exponent(size: ArrayLike, time: ArrayLike) -> float:
    """Slope of ln(time) over ln(size): 1 if time grows linearly."""
    return float(np.polyfit(np.log(size), np.log(time), 1)[0])


# ---- methods ----


def describe_methods(methods: Sequence[str], memory: Sequence[str]) -> pd.DataFrame:
    """Package, version, settings and memory (MB; NaN if the name is not in `memory`) of each method, and the reason if
    it is missing."""
    rows = []
    for name in methods:
        method = peers.COMPARED[name]
        reason = peers.missing(method)
        megabytes = np.nan if reason or name not in memory else peak_memory(method)
        rows.append((name, method.package, peers.version(method), method.settings, megabytes, reason))
    return pd.DataFrame(rows, columns=["method", "package", "version", "settings", "memory_mb", "missing"])
