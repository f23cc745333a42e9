"""Studies: third-party data, repeated experiments, and comparisons with other methods.

Code that loads data, or repeats an experiment many times, is one file here.  A calibration method to be compared is
one line in the table `calibration.CALIBRATION_METHODS`; a rival of the genetic algorithm alone is one in `baselines`.
"""

from .assembly_trials import CHAINS
from .baselines import DIFFERENTIAL_EVOLUTION, GENETIC, compare, search
from .bent_boards import bent_board_trials, bowed_board, summarize_bent_boards, write_bent_boards
from .circle_counts import match_circles, pictures_of_discs, write_circle_counts, write_screw_bits
from .datasets import dataset
from .disc_pulls import write_disc_pulls
from .distances import GIVEN, count_below, printed_ratio, rayleigh_counts, write_two_stage_counts
from .error_definitions import DEFINITIONS, error_numbers, errors_by_definition
from .flat_discs import flat_discs
from .focal_intervals import focal_interval
from .ga_success import REACHED, VARIANTS, success_shares, trial_sets, write_success
from .held_out import coverage, held_out_distances, leave_one_out, radial_profile, single_views_left_out
from .honest_intervals import correlated_noise, correlated_trials, interval_coverage, write_split_halves
from .insertion_rates import AXES, CELLS, curve_table, interval_table, rate_table, run_trials, write_assemblies
from .linear_trials import noisy_solutions, tilt_trials
from .measured import load_measured, made_by, write_measured
from .moving_hub import moving_hub_table, write_moving_hub
from .opencv_corners import sub_pixel_corners
from .operator_trials import good_children, operator_trials, printed_effect
from .photographs import GRID_RADIUS, load_corners, load_grid, write_grid, write_left_corners, write_sensitivity
from .pose_errors import PoseErrors, aligned_distances, covariance_in_plane, errors_in_plane, pose_errors
from .radius_drift import block_means, chi_squares, radii_over_turn
from .readings import (
    eq4_readings,
    eq6_readings,
    eq7_readings,
    eq9_readings,
    eq10_readings,
    eq11_readings,
    label_readings,
)
from .real_hand_eyes import write_hand_eyes
from .real_rings import write_real_rings
from .sector_corners import load_sector_corners, write_sector_corners
from .segmented_parts import write_parts
from .servo_cell import frame_at, goal_pose
from .servo_runs import servo_table, write_servo_runs
from .trials import PARAMETERS, load_rendered_trials, monte_carlo, trial_poses, write_rendered_trials
from .wide_views import WIDE_LENSES, views_over_image

__all__ = [
    "AXES",
    "CELLS",
    "CHAINS",
    "DEFINITIONS",
    "DIFFERENTIAL_EVOLUTION",
    "GENETIC",
    "GIVEN",
    "GRID_RADIUS",
    "PARAMETERS",
    "REACHED",
    "VARIANTS",
    "WIDE_LENSES",
    "PoseErrors",
    "aligned_distances",
    "bent_board_trials",
    "block_means",
    "bowed_board",
    "chi_squares",
    "compare",
    "correlated_noise",
    "correlated_trials",
    "count_below",
    "covariance_in_plane",
    "coverage",
    "curve_table",
    "dataset",
    "eq4_readings",
    "eq6_readings",
    "eq7_readings",
    "eq9_readings",
    "eq10_readings",
    "eq11_readings",
    "error_numbers",
    "errors_by_definition",
    "errors_in_plane",
    "flat_discs",
    "focal_interval",
    "frame_at",
    "frame_at",
    "goal_pose",
    "good_children",
    "held_out_distances",
    "interval_coverage",
    "interval_table",
    "label_readings",
    "leave_one_out",
    "load_corners",
    "load_grid",
    "load_measured",
    "load_rendered_trials",
    "load_sector_corners",
    "made_by",
    "match_circles",
    "monte_carlo",
    "moving_hub_table",
    "noisy_solutions",
    "operator_trials",
    "pictures_of_discs",
    "pose_errors",
    "printed_effect",
    "printed_ratio",
    "radial_profile",
    "radii_over_turn",
    "rate_table",
    "rayleigh_counts",
    "run_trials",
    "search",
    "servo_table",
    "single_views_left_out",
    "sub_pixel_corners",
    "success_shares",
    "summarize_bent_boards",
    "tilt_trials",
    "trial_poses",
    "trial_sets",
    "views_over_image",
    "write_assemblies",
    "write_bent_boards",
    "write_circle_counts",
    "write_disc_pulls",
    "write_grid",
    "write_hand_eyes",
    "write_left_corners",
    "write_measured",
    "write_moving_hub",
    "write_parts",
    "write_real_rings",
    "write_rendered_trials",
    "write_screw_bits",
    "write_sector_corners",
    "write_sensitivity",
    "write_servo_runs",
    "write_split_halves",
    "write_success",
    "write_two_stage_counts",
]
