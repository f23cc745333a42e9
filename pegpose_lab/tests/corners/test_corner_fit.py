"""The fit of corners: its model, and edges sharper than a pixel."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab.camera import TsaiCamera
from pegpose_lab.corners import find_corners
from pegpose_lab.corners.fit import edge_crossing, fit_corners
from pegpose_lab.render import render_board
from pegpose_lab.render.board import BoardLook
from pegpose_lab.targets import Checkerboard
from pegpose_lab.tests.corners.boards import distances

VARIANCES = 1.2, 0.6, 0.15, 0.05, -0.08, -0.3, -1.0  # blurred, in between, sharpened


@pytest.mark.parametrize("variance", VARIANCES)
def test_derivatives_of_the_model(variance):
    lattice = np.indices((9, 9)).reshape(2, -1)[::-1] - 4.0
    parameters = np.array([[0.3, -0.2, 0.2, 1.9, variance, 120.0, -80.0, 0.4, -0.3]])
    jacobian = edge_crossing(parameters, lattice)[1][0]
    for k in range(9):
        step = np.zeros(9)
        step[k] = 1e-6
        ahead, behind = (edge_crossing(parameters + sign * step, lattice)[0][0] for sign in (1, -1))
        np.testing.assert_allclose(jacobian[:, k], (ahead - behind) / 2e-6, atol=1e-5)


@pytest.mark.parametrize("variance", VARIANCES)
def test_fit_recovers_the_model_exactly(variance):
    lattice = np.indices((17, 17)).reshape(2, -1)[::-1] - 8.0
    truth = np.array([[0.31, -0.27, 0.1, 1.75, variance, 120.0, -90.0, 0.5, -0.2]])
    values = edge_crossing(truth, lattice)[0]
    fits = fit_corners(values, np.ones_like(values), lattice, np.array([[0.0, 0.0, 0.0, np.pi / 2]]))
    assert fits.converged.all()
    np.testing.assert_allclose(fits.parameters, truth, atol=1e-5)


def test_stated_sigma_is_that_of_the_errors():
    lattice, rng = np.indices((17, 17)).reshape(2, -1)[::-1] - 8.0, np.random.default_rng(5)
    truth = np.tile([0.31, -0.27, 0.1, 1.75, 0.8, 120.0, -90.0, 0.5, -0.2], (400, 1))
    values = edge_crossing(truth, lattice)[0] + rng.normal(0, 5, (400, lattice.shape[1]))
    fits = fit_corners(values, np.ones_like(values), lattice, np.tile([0.0, 0.0, 0.1, 1.75], (400, 1)))
    assert fits.converged.all()
    errors = fits.parameters[:, :2] - truth[:, :2]
    assert abs(np.linalg.eigvalsh(np.cov(errors.T))[1] ** 0.5 / np.median(fits.sigma) - 1) < 0.12
    assert abs(np.median(fits.misfit) / (5 / 90) - 1) < 0.05


# ---- sharp edges ----


def upright(degrees):
    """A sharp board of 8 x 6 inner corners, face on, turned by some degrees, seen by square pixels; its corners."""
    camera, board = TsaiCamera(50.0, (0.05, 0.05), (199.5, 159.5), (400, 320)), Checkerboard(8, 6, 20.0)
    rotation = Rotation.from_euler("z", degrees, degrees=True)
    pose = RigidTransform.from_components([0.13, 0.07, 625.0] - rotation.apply(board.center), rotation)
    look = BoardLook(black=40, white=200, surroundings=200)
    image = render_board(camera, pose, board, look=look, blur=0.0, noise=0.0)
    return image, camera.project(board.object_points, pose)


def sharpen(image, amount):
    image = image.astype(np.float32)
    image = image + amount * (image - cv2.GaussianBlur(image, (0, 0), 0.8))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def nearest_order(corners, truth):
    return min(corners, corners[::-1], key=lambda order: distances(order, truth).mean())


@pytest.mark.parametrize("degrees, amount, bound", [
    (0.0, 0.0, 0.01), (0.7, 0.0, 0.01), (1.5, 0.0, 0.01), (3.0, 0.0, 0.005), (10.0, 0.0, 0.005),
    (0.0, 1.0, 0.02), (0.7, 1.0, 0.01), (1.5, 1.0, 0.01), (3.0, 1.0, 0.01), (10.0, 1.0, 0.005),
])  # fmt: skip
def test_edges_sharper_than_a_pixel(degrees, amount, bound):
    image, truth = upright(degrees)
    corners = find_corners(sharpen(image, amount), Checkerboard())
    assert distances(nearest_order(corners, truth), truth).mean() < bound


def test_sharpened_and_noisy():
    image, truth = upright(1.0)
    noisy = sharpen(image, 1.0) + np.random.default_rng(2).normal(0, 5, image.shape)
    corners = find_corners(np.clip(np.rint(noisy), 0, 255).astype(np.uint8), Checkerboard())
    assert distances(nearest_order(corners, truth), truth).mean() < 0.03


@pytest.mark.parametrize("levels", [(50, 180), (0, 255)])
def test_two_levels_and_drawn_boards(levels):
    image, truth = upright(2.0)
    corners = find_corners(np.where(image > 120, levels[1], levels[0]).astype(np.uint8), Checkerboard())
    assert distances(nearest_order(corners, truth), truth).max() < 0.2
    squares = np.pad(np.kron(np.indices((7, 9)).sum(axis=0) % 2, np.ones((40, 40))), 40, constant_values=1)
    drawn = np.where(squares, levels[1], levels[0]).astype(np.uint8)
    truth = np.stack(np.meshgrid(np.arange(80, 400, 40), np.arange(80, 320, 40)), axis=-1).reshape(-1, 2) - 0.5
    np.testing.assert_allclose(nearest_order(find_corners(drawn, Checkerboard()), truth), truth, atol=0.005)
