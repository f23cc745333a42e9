"""Rendered boards for the tests of their corners."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab.camera import TsaiCamera
from pegpose_lab.render import render_board

CAMERA = TsaiCamera(50.0, (0.075, 0.075), (319.5, 239.5), (640, 480), kappa1=1e-5)


def pose_of(board, tilt=(8.0, -12.0), turn=0.0, depth=700.0):
    """A board in the middle of the picture, turned about the viewing direction (degrees)."""
    rotation = Rotation.from_euler("z", turn, degrees=True) * Rotation.from_euler("xy", tilt, degrees=True)
    return RigidTransform.from_components([0, 0, depth] - rotation.apply(board.center), rotation)


def seen(board, pose, **scene):
    return render_board(CAMERA, pose, board, **({"rng": 3} | scene)), CAMERA.project(board.object_points, pose)


def distances(corners, truth):
    return np.linalg.norm(corners - truth, axis=1)
