"""Wide-angle views, where the valley is oblique: the optimum is found, or the run says that it stopped short."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Checkerboard, OpenCVCamera, TsaiCamera

SIZE = (1280, 960)
WIDE = TsaiCamera(1000.0, (1.0, 1.0), (639.5, 479.5), SIZE)
BOARD = Checkerboard(15, 9, 30.0)


def oblique_view():
    """A board across the picture of a lens with k1 = -0.3 at f = 450 px, far from the centre and steep."""
    lens = OpenCVCamera([[450, 0, 639.5], [0, 450, 479.5], [0, 0, 1]], [-0.25, 0.05, 0, 0], SIZE)
    turn = Rotation.from_rotvec([0.1, 0.75, 0]) * Rotation.from_rotvec([0, 0, 0.3])
    pose = RigidTransform.from_components(np.array([-20, 30, 290]) - turn.apply(BOARD.center), turn)
    image = lens.project(BOARD.object_points, pose)
    return BOARD.object_points, image + 0.3 * np.random.default_rng(0).standard_normal(image.shape)
