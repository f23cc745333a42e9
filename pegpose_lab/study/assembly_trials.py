"""The whole chain, many times: boards and hub rendered with fresh noise, camera calibrated, pegs found, hub's pose estimated.

A trial is one frame of the paper's experiment with noise of its own, and a calibration of its own from the five boards with
noise of their own.  Boards and frames are rendered without noise once; noise and rounding are added in each trial.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..calibration import board_pose, calibrate_genetic, calibrate_joint, calibrate_tsai, calibrate_zhang
from ..circles import find_circles
from ..corners import find_corners
from ..paper import mm_per_pixel, paper_experiment
from ..pegs import locate_pegs
from ..pose import estimate_pose, project_discs
from ..render import expose

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from numpy.typing import NDArray

    from ..calibration import Calibration
    from ..paper import Experiment
    from ..pegs import PegObservation
    from ..pose import HubPose

PLANE_VIEW = 4  # the board that lies in the plane of the peg tops
HIGHLIGHTS = 40.0  # grey values, as in the benchmark's scene of that name
HIDDEN_EVERY = 5  # frames: with highlights, peg 1 is hidden in each fifth
CIRCLE_RADII = (30.0, 65.0)  # px, for the circular Hough transform
HALF_TURN = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, np.pi]))
SCENES = ("clean", "highlights")
SCALE, STAGE_1, STAGES, ZHANG, JOINT = "one scale", "stage 1", "stages 1 + 2", "Zhang", "joint"
INTEGER, WHOLE, PAPER = "joint, integer radii", "joint, whole pixels", "stages 1 + 2, whole pixels"
CHAINS = (SCALE, STAGE_1, PAPER, STAGES, WHOLE, INTEGER, ZHANG, JOINT)
"""Ways to the pose: the calibration, with sub-pixel circles unless others are named."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A pose that a chain estimated, beside the truth.

    Attributes
    ----------
    scene, chain : str
        Of `SCENES` and `CHAINS`.
    seed, frame : int
    free : bool
        Whether all six numbers were estimated, without the plane.
    truth : RigidTransform
        cam_from_hub, with the labels of the estimate.
    pose : HubPose or None
        None if pegs were missing among the circles; of `SCALE`, a pose that has nothing but ``cam_from_hub``.
    """

    scene: str
    chain: str
    seed: int
    frame: int
    free: bool
    truth: RigidTransform
    pose: HubPose | SimpleNamespace | None

    @property
    def error(self) -> NDArray[np.float64]:
        """Estimate less truth (6,), mm and rad, in the axes of the plane of the peg tops; NaN without a pose."""
        if self.pose is None:
            return np.full(6, np.nan)
        found = self.pose.cam_from_hub
        turn = (found.rotation * self.truth.rotation.inv()).as_rotvec()
        return _to_plane() @ np.append(found.translation - self.truth.translation, turn)

    @property
    def sigmas(self) -> NDArray[np.float64]:
        """Stated standard deviations (6,) of `error`; NaN where none are stated."""
        if getattr(self.pose, "covariance", None) is None:
            return np.full(6, np.nan)
        return np.sqrt(np.diag(_to_plane() @ self.pose.covariance @ _to_plane().T))

    @property
    def peg_error(self) -> float:
        """Rms distance of the pegs' measured centres in the plane of their tops from the true ones, mm."""
        if getattr(self.pose, "used", None) is None:
            return np.nan
        off = self.truth.inv().apply(self.pose.peg_centers) - paper_experiment().hub.peg_centers
        return float(np.sqrt(np.mean(np.sum(off[self.pose.used, :2] ** 2, axis=1))))


@cache
def _to_plane():
    """From axes of the camera to those of the plane of the peg tops (6, 6)."""
    return np.kron(np.eye(2), paper_experiment().cam_from_plane.rotation.as_matrix().T)


@cache
def _boards() -> list[NDArray[Any]]:
    """The five boards without noise, float32."""
    quiet = paper_experiment(noise=None)
    return [quiet.board_image(k) for k in range(5)]


def run_frame(frame: int, seeds: range) -> Iterator[Trial]:
    """Yield the trials of a frame (0..44), for each seed those of all scenes and chains.

    Examples
    --------
    >>> trials = list(run_frame(0, range(1)))
    >>> sorted({trial.chain for trial in trials}) == sorted(CHAINS)
    True
    """
    experiment, quiet = paper_experiment(), paper_experiment(noise=None)
    hidden = {"occlusion": 1.0} if frame % HIDDEN_EVERY == HIDDEN_EVERY - 1 else {}
    scenes = {"clean": {}, "highlights": {"highlights": HIGHLIGHTS} | hidden}
    images = {scene: quiet.hub_frame(frame, **looks) for scene, looks in scenes.items()}
    for seed in seeds:
        rng = np.random.default_rng([seed, frame])
        corners = [find_corners(expose(board, experiment.noise, rng), experiment.board) for board in _boards()]
        calibrations = _calibrated(experiment, corners, seed)
        for scene, image in images.items():
            seen = expose(image, experiment.noise, rng)
            observation = locate_pegs(seen, experiment.hub)
            truth = _with_labels(experiment, frame, observation)
            for chain, free, pose in _poses(experiment, scene, seen, observation, calibrations, corners, truth):
                yield Trial(scene, chain, seed, frame, free, truth, pose)


def _calibrated(experiment: Experiment, corners, seed) -> dict[str, Calibration]:
    """The calibrations by chain; the single-view methods get Table 1's view, and the principal point."""
    board, sensor = experiment.board.object_points, experiment.camera.sensor
    world = experiment.world_from_board.apply(board)
    return {
        STAGE_1: calibrate_tsai(world, corners[0], sensor),
        STAGES: calibrate_genetic(world, corners[0], sensor, rng=seed),
        ZHANG: calibrate_zhang([board] * 5, corners, sensor),
        JOINT: calibrate_joint([board] * 5, corners, sensor),
    }


def _with_labels(experiment, frame, observation):
    """The true pose, turned by half a turn if the observation's labels are: the screws leave both."""
    truth = experiment.cam_from_hubs[frame]
    return min(
        (truth, truth * HALF_TURN), key=lambda pose: np.abs(_images(experiment, pose) - observation.peg_centers).max()
    )


def _images(experiment, pose):
    """Centres (4, 2) of the pegs' images, px."""
    hub = experiment.hub
    return project_discs(experiment.camera, pose, hub.peg_centers, np.full(hub.n_pegs, hub.peg_radius))[0]


def _poses(experiment, scene, image, observation, calibrations, corners, truth):
    """The poses of a frame: chain, whether all six numbers are free, and the pose."""
    board, hub = experiment.board.object_points, experiment.hub
    for name in (ZHANG, JOINT):
        found = calibrations[name]
        plane = found.cam_from_object[PLANE_VIEW]
        yield name, False, estimate_pose(observation, found, hub, plane=plane, plane_view=PLANE_VIEW)
        yield name, True, estimate_pose(observation, found, hub)
    if scene != "clean":
        return
    planes = {name: board_pose(board, corners[PLANE_VIEW], found.camera) for name, found in calibrations.items()}
    whole, integer = _rounded(_by_circles(image, observation)), _by_circles(image, observation)
    for chain, name, seen in (
        (STAGE_1, STAGE_1, observation),
        (STAGES, STAGES, observation),
        (PAPER, STAGES, whole),
        (WHOLE, JOINT, whole),
        (INTEGER, JOINT, integer),
    ):
        pose = seen and estimate_pose(seen, calibrations[name].camera, hub, plane=planes[name])
        yield chain, False, pose
    yield SCALE, False, _by_scale(experiment, observation, truth)


def _by_circles(image, observation: PegObservation) -> SimpleNamespace | None:
    """The circles of the two-stage Hough transform nearest to the pegs, with its integer radii; None if one is missing."""
    circles = find_circles(image, CIRCLE_RADII, method="two-stage")
    if len(circles.radii) == 0:
        return None
    apart = np.linalg.norm(circles.centers - observation.peg_centers[:, None], axis=2)
    nearest = apart.argmin(axis=1)
    if (apart.min(axis=1) > observation.peg_radii / 2).any():
        return None
    return SimpleNamespace(peg_centers=circles.centers[nearest], peg_radii=circles.radii[nearest])


def _rounded(circles):
    return circles and SimpleNamespace(peg_centers=np.rint(circles.peg_centers), peg_radii=circles.peg_radii)


def _by_scale(experiment, observation, truth):
    """The hub by Table 2's single scale, taught without error in frame 1: tilt and height are as taught."""
    plane, first = experiment.cam_from_plane, experiment.cam_from_hubs[0]
    arms = _about_middle(observation.peg_centers)
    poses = []
    for taught in (first, first * HALF_TURN):
        centers = _images(experiment, taught)
        turn = np.angle(np.vdot(_about_middle(centers), arms))
        shift = mm_per_pixel() * (observation.peg_centers.mean(axis=0) - centers.mean(axis=0))
        at = plane.inv() * taught
        rotation = Rotation.from_rotvec([0, 0, turn]) * at.rotation
        poses.append(plane * RigidTransform.from_components([*(at.translation[:2] + shift), 0.0], rotation))
    near = min(poses, key=lambda pose: (pose.rotation * truth.rotation.inv()).magnitude())
    return SimpleNamespace(cam_from_hub=near)


def _about_middle(points):
    """Points (n, 2) relative to their middle, as x + i y."""
    return (points - points.mean(axis=0)) @ (1, 1j)
