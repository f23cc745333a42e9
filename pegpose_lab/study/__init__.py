"""Studies: third-party data, repeated experiments, and the method beside its rivals.

What loads data, or repeats an experiment many times, is one file here; a method to be compared is one line
in the table of `baselines`.
"""

from .trials import PARAMETERS, load_rendered_trials, monte_carlo, trial_poses

__all__ = [
    "PARAMETERS",
    "load_rendered_trials",
    "monte_carlo",
    "trial_poses",
]
