"""Views of known cameras and real ones, and an oracle of stage 2."""

import numpy as np
import pandas as pd
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab.paper import paper_experiment, paper_pose

EXPERIMENT = paper_experiment()
CAMERA = EXPERIMENT.camera
BOARD = EXPERIMENT.board.object_points
WORLD_BOARD = EXPERIMENT.world_from_board.apply(BOARD)
BODY = np.random.default_rng(4).uniform(-80, 80, (40, 3))


def view(points=WORLD_BOARD, pose=None, noise=0.0, seed=0, camera=CAMERA):
    image_points = camera.project(points, paper_pose() if pose is None else pose)
    return points, image_points + noise * np.random.default_rng(seed).standard_normal(image_points.shape)


def five_views(noise, seed=0, board=BOARD):
    """Views of the flat board; if another one is given, its corners are seen, as of a board that is not flat."""
    rng = np.random.default_rng(seed)
    image_points = [CAMERA.project(board, pose) for pose in EXPERIMENT.cam_from_boards]
    return [BOARD] * 5, [points + noise * rng.standard_normal(points.shape) for points in image_points]


def fronto_parallel(noise=0.1, seed=0, count=5):
    rng = np.random.default_rng(seed)
    board = BOARD - BOARD.mean(axis=0)
    poses = [
        RigidTransform.from_components([*rng.uniform(-40, 40, 2), 350 + 30 * k], Rotation.from_rotvec([0, 0, k]))
        for k in range(count)
    ]
    return [board] * count, [CAMERA.project(board, pose) + noise * rng.standard_normal((48, 2)) for pose in poses]


def table_views(path, split="view"):
    views = [group for _, group in pd.read_csv(path, comment="#").groupby(split)]
    object_points = [group[["X", "Y"]].assign(Z=0.0).to_numpy() for group in views]
    return object_points, [group[["u", "v"]].to_numpy() for group in views]


def zhang_views(folder):
    model = 25.4 * np.loadtxt(folder / "Model.txt").reshape(-1, 2)
    image_points = [np.loadtxt(folder / f"data{number}.txt").reshape(-1, 2) for number in range(1, 6)]
    return [np.column_stack([model, np.zeros(len(model))])] * 5, image_points


def best_in_box(objective, lower, upper):
    """The oracle: a dense scan over T_z, for each T_z over f, then ever finer scans round the best."""

    def best_f(t_z):
        f = np.linspace(lower[0], upper[0], 101)
        for _ in range(9):
            values = objective(np.column_stack([f, np.full(len(f), t_z)]))
            best = np.argmin(values)
            f = np.linspace(f[max(best - 1, 0)], f[min(best + 1, len(f) - 1)], 21)
        return values[best]

    t_z = np.linspace(lower[1], upper[1], 81)
    for _ in range(8):
        values = [best_f(value) for value in t_z]
        best = np.argmin(values)
        t_z = np.linspace(t_z[max(best - 1, 0)], t_z[min(best + 1, len(t_z) - 1)], 9)
    return values[best]


def box_of(linear):
    centre = np.array([linear.camera.focal_length, linear.cam_from_object[0].translation[2]])
    return 0.75 * centre, 1.25 * centre
