"""Wrong views are named as what they are: another order, a mirrored one, copies, another size, outside the image."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from pegpose_lab import CalibrationError, Checkerboard, calibrate_joint, calibrate_tsai, calibrate_zhang
from pegpose_lab.calibration.joint.copies import copied_views
from pegpose_lab.calibration.joint.noise import own_noise
from pegpose_lab.calibration.joint.orders import DISORDER, fitting_order, grid_shape, homography_residuals
from pegpose_lab.paper import paper_camera

CAMERA = paper_camera()
GRID = Checkerboard(9, 6, 29.0)
BOARD = GRID.object_points
VIEWS = 7


def boards(seed=0, noise=0.1):
    """Views of a board tilted by 20 to 40 deg, all inside the image."""
    rng, images = np.random.default_rng([seed, 3]), []
    while len(images) < VIEWS:
        axis, tilt = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(20, 40))
        turn = Rotation.from_rotvec([tilt * np.cos(axis), tilt * np.sin(axis), 0])
        turn = turn * Rotation.from_rotvec([0, 0, rng.uniform(-3, 3)])
        middle = np.array([*rng.uniform(-80, 80, 2), rng.uniform(300, 700)])
        image = CAMERA.project(BOARD, RigidTransform.from_components(middle - turn.apply(GRID.center), turn))
        if image.min() > 5 and np.all(image.max(axis=0) < np.array(CAMERA.image_size) - 5):
            images.append(image + noise * rng.standard_normal(image.shape))
    return images


def grid(image):
    return image.reshape(GRID.rows, GRID.columns, 2)


def joint(images, points=BOARD, camera=CAMERA, **options):
    return calibrate_joint([points] * len(images), images, camera, **options)


def zhang(images, points=BOARD, camera=CAMERA):
    return calibrate_zhang([points] * len(images), images, camera.image_size)


def flag(calibration, code):
    (found,) = (flag for flag in calibration.flags if flag.code == code)
    return found


ORDERS = {
    "the list of corners is rolled by +1": lambda image: np.roll(image, 1, axis=0),
    "the list of corners is rolled by -5": lambda image: np.roll(image, -5, axis=0),
    "the list of corners is rolled by +9 (whole rows: +1)": lambda image: np.roll(image, 9, axis=0),
    "each row of the corners is rolled by +2": lambda image: np.roll(grid(image), 2, axis=1).reshape(-1, 2),
    "the corners are listed column by column": lambda image: grid(image).transpose(1, 0, 2).reshape(-1, 2),
    "every second row of the corners is reversed": lambda image: np.concatenate(
        [row[::-1] if k % 2 else row for k, row in enumerate(grid(image))]
    ),
    "the list of corners is rolled by +3, and mirrored": lambda image: np.roll(
        grid(image)[:, ::-1].reshape(-1, 2), 3, axis=0
    ),
}


@pytest.mark.parametrize("words", ORDERS)
def test_the_order_that_would_fit_is_named(words):
    images = boards()
    images[3] = ORDERS[words](images[3])
    for calibrate in (joint, zhang):
        with pytest.raises(CalibrationError) as caught:
            calibrate(images)
        assert str(caught.value).endswith(f"in view 3 (counted from 0) {words}")
    with pytest.raises(CalibrationError) as caught:
        calibrate_tsai(BOARD, images[3], CAMERA)
    assert str(caught.value).endswith(f"order of object_points; {words}")


def test_columns_and_rows_of_the_board_exchanged_are_named():
    with pytest.raises(CalibrationError, match=r"columns and rows of the board are exchanged \(9 columns, 6 rows\)"):
        joint(boards(), Checkerboard(6, 9, 29.0).object_points)


def test_an_order_that_nothing_explains_is_refused_without_an_explanation():
    images = boards()
    images[1] = np.random.default_rng(0).permutation(images[1])
    with pytest.raises(CalibrationError, match="view 1 are no image of the plane.*columns and rows are not mixed up"):
        joint(images)
    residual = homography_residuals([BOARD], [images[1]])[0][0]
    assert residual > DISORDER and fitting_order(BOARD, images[1], residual) is None


@pytest.mark.parametrize(
    ("points", "shape"),
    [
        (BOARD, (6, 9)),
        (Rotation.from_rotvec([0.3, 0.2, 1.0]).apply(BOARD) + 5, (6, 9)),
        (BOARD[:-1], None),
        (BOARD[:9], None),
        (np.random.default_rng(0).uniform(0, 100, (54, 3)), None),
    ],
)
def test_a_grid_is_recognised_in_any_frame(points, shape):
    assert grid_shape(points) == shape


def test_mirrored_views_are_named_and_half_turns_are_not():
    images = boards()
    turned = [*images[:2], grid(images[2])[::-1, ::-1].reshape(-1, 2), *images[3:]]
    mirrored = [*turned[:4], grid(images[4])[:, ::-1].reshape(-1, 2), *images[5:]]
    for calibrate in (joint, zhang):
        assert calibrate(turned).flags == ()
        (found,) = calibrate(mirrored).flags
        assert found.code == "mirrored-view" and found.startswith("View 4 (counted from 0) shows the other side")
        assert flag(calibrate(images, BOARD[:, [1, 0, 2]]), "mirrored-view").startswith("All views show the plane from")
    assert flag(calibrate_tsai(BOARD, mirrored[4], CAMERA), "mirrored-view").startswith("The view shows the plane from")
    assert joint(mirrored).camera.focal_length == pytest.approx(joint(images).camera.focal_length, rel=1e-9)


def test_copies_of_a_view_are_named():
    rng, images = np.random.default_rng(0), boards()
    noisy = [images[0] + 0.1 * rng.standard_normal((54, 2)) for _ in range(13)]
    for calibrate in (joint, zhang):
        try:
            words = flag(calibrate(noisy), "copied-views")
        except CalibrationError as error:
            words = str(error)
        assert words.startswith("All 13 views are copies of one view")
    some = [*images, images[5], images[2] + 0.1 * rng.standard_normal((54, 2))]
    assert flag(joint(some), "copied-views").startswith("Views 2, 8; 5, 7 (counted from 0) are copies of one view each")
    assert copied_views([BOARD] * 7, images) == [] and joint(images).flags == ()
    assert copied_views([BOARD] * 2, [images[0], images[0] + 3.0]) == []


@pytest.mark.parametrize("calibrate", [joint, zhang])
@pytest.mark.parametrize("scale", [0.5, 2.0, 1.5])
def test_pictures_of_another_size_are_named(calibrate, scale):
    """Also where two of seven spoil the fit of all, so that others have larger residuals."""
    for seed in range(2):
        images = boards(seed)
        for view in (2, 5):
            images[view] = (images[view] + 0.5) * scale - 0.5
        words = flag(calibrate(images), "misfit-view")
        assert words.startswith("Views 2, 5 (counted from 0) do not fit the others") and "f moves by" in words
        assert f"Views 2, 5 would fit with pixels scaled by {1 / scale:.3g} (a picture of {scale:.3g} times" in words


def test_a_cropped_picture_is_named():
    images = boards()
    images[6] = images[6] - [100.0, 60.0]
    words = flag(joint(images), "misfit-view")
    shift = [float(part) for part in words.split("shifted by ")[1].split(" px")[0].split(" and ")]
    assert words.startswith("View 6 (counted") and shift == pytest.approx([100, 60], abs=5)


def test_a_blurred_view_is_named_by_its_own_noise():
    images = boards()
    images[1] = images[1] + 1.0 * np.random.default_rng(0).standard_normal((54, 2))
    words = flag(joint(images), "misfit-view")
    assert words.startswith("View 1 (counted from 0)") and "the noise of their own corners: blurred" in words
    assert own_noise([BOARD] * 7, images) == pytest.approx([0.1, 1, *[0.1] * 5], rel=0.25)


def test_width_and_height_swapped_are_named():
    images, swapped = boards(), CAMERA.image_size[::-1]
    turned = replace(CAMERA, image_size=swapped, principal_point=(599.5, 799.5))
    for run in (
        joint(images, camera=replace(CAMERA, image_size=swapped)),
        joint(images, camera=turned),
        joint(images, camera=turned, principal_point="fixed"),
        zhang(images, camera=turned),
    ):
        assert flag(run, "size-swapped").endswith("is image_size (width, height) swapped?")
    moved = [image + [1300, 0] for image in images]
    with pytest.raises(ValueError, match=r"inside an image of 3000 x 1200 px: is image_size \(width, height\) swapped"):
        joint(moved, camera=replace(CAMERA, image_size=(1200, 3000)))


def test_a_principal_point_that_is_held_far_off_is_named():
    off = replace(CAMERA, principal_point=(799.5 + 150, 599.5 - 160))
    words = flag(joint(boards(), camera=off, principal_point="fixed"), "misfit-lens")
    x, y = (float(part) for part in words.split("with a free principal point, (")[1].split(")")[0].split(", "))
    assert (x, y) == pytest.approx((799.5, 599.5), abs=4)


def test_a_refused_set_names_the_view_that_does_not_agree():
    """The view spoils the fit of all; the error of all views comes second."""
    images = boards()
    images[0] = 40 * np.random.default_rng(1).standard_normal((54, 2)) + images[0]
    try:
        words = flag(joint(images), "misfit-view")
    except CalibrationError as error:
        words = str(error)
    assert words.startswith("View 0 (counted from 0) does not fit the others")


@pytest.mark.parametrize("loss", ["huber", "cauchy"])
def test_a_robust_loss_names_wrong_views_but_not_a_few_wrong_corners(loss):
    for seed in range(6):
        images = boards(seed)
        for image in images:
            image[:4] += np.random.default_rng(seed).normal(size=(4, 2))
        assert not [found for found in joint(images, loss=loss).flags if found.code == "misfit-view"]
        images[4] = (images[4] + 0.5) / 2 - 0.5
        words = flag(joint(images, loss=loss), "misfit-view")
        assert words.startswith("View 4 (counted from 0) does not fit") and "of 0.5 times the size" in words
