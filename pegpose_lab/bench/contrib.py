"""Edge Drawing from opencv-contrib, in a separate process."""

from __future__ import annotations

import atexit
import functools
import json
import os
import subprocess
import sys
import time

import cv2
import numpy as np

from ..lab import environment
from .detectors import _rows


def _edge_drawing(image, radius_range, *, operator, gradient, sigma):
    """Edge Drawing and its ellipses; needs the cv2 of opencv-contrib."""
    detector = cv2.ximgproc.createEdgeDrawing()
    settings = cv2.ximgproc.EdgeDrawing.Params()
    settings.EdgeDetectionOperator = getattr(cv2.ximgproc, f"EdgeDrawing_{operator}")
    settings.GradientThresholdValue, settings.Sigma = gradient, sigma
    detector.setParams(settings)
    detector.detectEdges(image)
    found = detector.detectEllipses()
    rows = np.empty((0, 6)) if found is None else found.reshape(-1, 6)
    radii = np.where(rows[:, 2] > 0, rows[:, 2], np.sqrt(np.maximum(rows[:, 3] * rows[:, 4], 0)))
    return _rows(np.column_stack([rows[:, :2], radii]), radius_range)


class _Server:
    """A process with opencv-contrib, which receives images and returns circles and the processor time."""

    def __init__(self):
        self.process = subprocess.Popen(
            [sys.executable, "-c", "from pegpose_lab.bench import contrib; contrib.serve()"],
            env=contrib_variables(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        atexit.register(self.close)

    def close(self):
        """End the process by closing its pipe."""
        self.process.communicate()

    def ask(self, image, radius_range, options):
        """Return `Found` and the processor time in seconds."""
        header = json.dumps([image.shape, [float(radius) for radius in radius_range], options])
        self.process.stdin.write(header.encode() + b"\n" + image.tobytes())
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the process with opencv-contrib ended with code {self.process.wait()}")
        rows, seconds = json.loads(answer)
        return _rows(rows, radius_range), seconds


_server = functools.cache(_Server)  # one for each process; it ends when its pipe is closed


def contrib_variables() -> dict[str, str]:
    """The environment variables of a process that imports cv2 from opencv-contrib."""
    path = os.pathsep.join([str(environment.contrib_folder()), str(environment.CHECKOUT)])
    return {**os.environ, "PYTHONPATH": path}


def serve() -> None:
    """Answer the requests of a `_Server` until the pipe is closed."""
    cv2.setNumThreads(1)
    for header in iter(sys.stdin.buffer.readline, b""):
        (height, width), radius_range, options = json.loads(header)
        image = np.frombuffer(sys.stdin.buffer.read(height * width), np.uint8).reshape(height, width)
        found, seconds = _timed(_edge_drawing, image, radius_range, options)
        print(json.dumps([np.column_stack([found.centers, found.radii]).tolist(), seconds]), flush=True)


# ---- all of them ----


def _timed(find, image, radius_range, options):
    start = time.process_time()
    found = find(image, radius_range, **options)
    return found, time.process_time() - start
