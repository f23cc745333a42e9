"""The benchmark: measures circle detection and calibration beside their peers and their bounds, in one run.

A detector to compare with is one function in `detectors` and one entry in `peers.COMPARED`; a scene is one entry in
`scenes.SCENES`.
"""

from .bounds import center_bound
from .calibrators import write_mrcal_uncertainty
from .disc_constants import write_disc_constants
from .peers import OURS, REFERENCE
from .photographs import write_peer_counts
from .plan import FULL, QUICK, run
from .report import to_text, write
from .scenes import SCENES, TARGET_NOISE
from .tuning import write_peer_settings

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
    "write_disc_constants",
    "write_mrcal_uncertainty",
    "write_peer_counts",
    "write_peer_settings",
]
