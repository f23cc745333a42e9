"""A camera in each lens model, the options that calibrate it, and tilted boards that it sees."""

import numpy as np

from pegpose_lab import OpenCVCamera, paper, study

_PAPER = paper.paper_camera()
MODELS = {
    "paper": (_PAPER, {}),
    "opencv": (
        OpenCVCamera([[1291, 0, 805], [0, 1293, 595], [0, 0, 1]], [-0.2, 0.06, 1e-3, -5e-4, 0], (1600, 1200)),
        {"focal": "two", "coefficients": ("k1", "k2", "p1", "p2")},
    ),
}
MODEL_NAMES = list(MODELS)
BOARD = paper.paper_experiment().board


def tilted_views(camera, count, noise, seed=0):
    """Boards and images of the same boards tilted by 30 degrees, whatever the noise, and their poses."""
    poses = study.trial_poses(BOARD, 30.0, count, np.random.default_rng(3))
    rng = np.random.default_rng([seed, 17])
    seen = [camera.project(BOARD.object_points, pose) for pose in poses]
    return [BOARD.object_points] * count, [view + noise * rng.standard_normal(view.shape) for view in seen], poses
