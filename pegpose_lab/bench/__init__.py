"""The benchmark: circle measurement and calibration beside their peers and their bounds, measured in one run.

A detector to compare with is one function in `detectors` and one line in `bench.methods`, a scene one line in
`scenes`.
"""

from .detectors import OURS, REFERENCE
from .report import FULL, QUICK, run, to_text, write
from .score import SCENES, TARGET_NOISE, center_bound

__all__ = [
    "FULL",
    "OURS",
    "QUICK",
    "REFERENCE",
    "SCENES",
    "TARGET_NOISE",
    "center_bound",
    "run",
    "to_text",
    "write",
]
