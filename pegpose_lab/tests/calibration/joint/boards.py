"""Views of boards for the tests of the joint solution."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import CalibrationError, calibrate_joint
from pegpose_lab.calibration.joint.models import COEFFICIENTS, lens_model
from pegpose_lab.calibration.joint.starts import find_start
from pegpose_lab.calibration.joint.views import Views
from pegpose_lab.paper import paper_experiment

EXPERIMENT = paper_experiment()
CAMERA, BOARD = EXPERIMENT.camera, EXPERIMENT.board.object_points
MODELS = [(False, None), (True, None), (False, ("k1",)), (True, COEFFICIENTS)]


def five_views(noise, seed=0, camera=CAMERA):
    rng = np.random.default_rng(seed)
    seen = [camera.project(BOARD, pose) for pose in EXPERIMENT.cam_from_boards]
    return [BOARD] * 5, [points + noise * rng.standard_normal(points.shape) for points in seen]


def started(two, coefficients, points=None):
    points = points or five_views(0.1)
    model = lens_model(CAMERA, True, two, coefficients)
    views = Views.stack(*points)
    return model, views, find_start(model, views, *points)


# --- little tilt: refused, flagged, or right ---------------------------------------------------------------


def little_tilted(rng, tilt, number, one_axis):
    """Boards tilted alike about one axis of the camera, or evenly spread ones, and turned, shifted, at other depths."""
    first, poses = rng.uniform(0, 2 * np.pi), []
    for view in range(number):
        angle = first + (0 if one_axis else 2 * np.pi * view / number)
        rotation = Rotation.from_rotvec(np.deg2rad(tilt) * np.array([np.cos(angle), np.sin(angle), 0]))
        rotation = rotation * Rotation.from_rotvec([0, 0, rng.uniform(-0.3, 0.3)])
        middle = np.array([*rng.uniform(-25, 25, 2), 310 * rng.uniform(1, 1.3)])
        poses.append(RigidTransform.from_components(middle - rotation.apply(EXPERIMENT.board.center), rotation))
    return poses


def outcome(seed, options, tilts, numbers, noises):
    """|error| / sigma of f of one random set and whether it is flagged; None where it is refused."""
    rng = np.random.default_rng([seed, 4])
    number, noise = int(rng.choice(numbers)), rng.choice(noises)
    poses = little_tilted(rng, rng.choice(tilts), number, rng.random() < 0.5)
    images = [CAMERA.project(BOARD, pose) + noise * rng.standard_normal((48, 2)) for pose in poses]
    try:
        run = calibrate_joint([BOARD] * number, images, replace(CAMERA, focal_length=1.0, kappa1=0.0), **options)
    except CalibrationError:
        return None
    name, true = run.covariance.index[0], CAMERA.focal_length
    found = getattr(run.camera, "focal_length", None) or run.camera.camera_matrix[0, 0] * CAMERA.pixel_pitch[0]
    unit = 1.0 if name == "focal_length" else CAMERA.pixel_pitch[0]
    return abs(found - true) / (unit * run.sigma(name)), bool(run.flags)
