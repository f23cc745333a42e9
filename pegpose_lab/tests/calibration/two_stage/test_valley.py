"""Wide-angle views, where the valley is oblique: the optimum is found, or the run says that it stopped short."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import Checkerboard, OpenCVCamera, TsaiCamera, calibrate_genetic, calibrate_tsai, optimum_in_box
from pegpose_lab.calibration import BOX, TwoStageObjective, repeat_calibration
from pegpose_lab.calibration.two_stage.genes import _Genes
from pegpose_lab.calibration.two_stage.valley import Valley
from pegpose_lab.tests.calibration.views import CAMERA, view

SIZE = (1280, 960)
WIDE = TsaiCamera(1000.0, (1.0, 1.0), (639.5, 479.5), SIZE)
BOARD = Checkerboard(15, 9, 30.0)


def oblique_view():
    """A board across the picture of a lens with k1 = -0.25 at f = 450 px, far from the centre and steep."""
    lens = OpenCVCamera([[450, 0, 639.5], [0, 450, 479.5], [0, 0, 1]], [-0.25, 0.05, 0, 0], SIZE)
    turn = Rotation.from_rotvec([0.1, 0.75, 0]) * Rotation.from_rotvec([0, 0, 0.3])
    pose = RigidTransform.from_components(np.array([-20, 30, 290]) - turn.apply(BOARD.center), turn)
    image = lens.project(BOARD.object_points, pose)
    return BOARD.object_points, image + 0.3 * np.random.default_rng(0).standard_normal(image.shape)


def test_an_oblique_valley_turns_the_gene_and_all_runs_reach_the_optimum():
    points, image = oblique_view()
    linear, optimum = calibrate_tsai(points, image, WIDE), optimum_in_box(points, image, WIDE)
    objective = TwoStageObjective(points, image, linear)
    coding = _Genes("magnification", linear, objective.c2, BOX)
    coding.follow(*Valley(objective, coding.lower, coding.upper).floor)
    assert abs(coding.offset - objective.c2.mean()) > 20  # mm
    for run in repeat_calibration(points, image, WIDE, range(6)):
        assert run.mean_distance - optimum.mean_distance < 1e-6 and run.flags == ()


def test_the_valley_of_an_ordinary_lens_leaves_the_gene_as_it_was():
    points, image = view(noise=0.1)
    linear = calibrate_tsai(points, image, CAMERA)
    objective = TwoStageObjective(points, image, linear)
    coding = _Genes("magnification", linear, objective.c2, BOX)
    coding.follow(*Valley(objective, coding.lower, coding.upper).floor)
    assert coding.offset == objective.c2.mean()


def test_a_run_that_stops_short_says_so_and_where_the_optimum_is():
    points, image = oblique_view()
    optimum = optimum_in_box(points, image, WIDE)
    short = 0
    for seed in range(4):
        run = calibrate_genetic(points, image, WIDE, rng=seed, generations=4)
        codes = [flag.code for flag in run.flags]
        if run.mean_distance - optimum.mean_distance > 1e-4:
            (flag,) = (flag for flag in run.flags if flag.code == "short-of-optimum")
            f, value = (
                float(flag.split("and f = ")[1].split(" mm")[0]),
                float(flag.split("mm have ")[1].split(" px")[0]),
            )
            assert f == pytest.approx(optimum.camera.focal_length, rel=1e-3)
            assert value == pytest.approx(optimum.mean_distance, rel=1e-4)
            short += 1
        elif run.mean_distance - optimum.mean_distance < 5e-5:
            assert "short-of-optimum" not in codes
    assert short
