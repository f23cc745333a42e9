"""Studies: third-party data, repeated experiments, and the method beside its rivals.

What loads data, or repeats an experiment many times, is one file here; a method to be compared is one line
in the table `calibration.METHODS`, a rival of the genetic algorithm alone one in that of `baselines`.
"""

from .baselines import DIFFERENTIAL_EVOLUTION, GENETIC, compare, search
from .circle_counts import load_bits, load_counts, load_missed
from .distances import GIVEN, count_below, load_two_stage_counts, printed_ratio, rayleigh_counts
from .ga_success import REACHED, VARIANTS, load_success, trial_sets
from .held_out import coverage, leave_one_out, radial_profile
from .photographs import FOLDER, GRID_RADIUS, load_corners, load_grid, load_sensitivity
from .sector_corners import load_sector_corners
from .segmented_parts import load_parts
from .trials import PARAMETERS, load_rendered_trials, monte_carlo, trial_poses

__all__ = [
    "DIFFERENTIAL_EVOLUTION",
    "FOLDER",
    "GENETIC",
    "GIVEN",
    "GRID_RADIUS",
    "PARAMETERS",
    "REACHED",
    "VARIANTS",
    "compare",
    "count_below",
    "coverage",
    "leave_one_out",
    "load_bits",
    "load_corners",
    "load_counts",
    "load_grid",
    "load_missed",
    "load_parts",
    "load_rendered_trials",
    "load_sector_corners",
    "load_sensitivity",
    "load_success",
    "load_two_stage_counts",
    "monte_carlo",
    "printed_ratio",
    "radial_profile",
    "rayleigh_counts",
    "search",
    "trial_poses",
    "trial_sets",
]
