"""A simulated cell for visual servoing: a fixed camera, and a robot that carries the hub to where it belongs.

The camera is the paper's, `GOAL_DEPTH` from the goal, so that a hub that starts 60 mm away is still in the image.  It was
calibrated by the joint method from five boards.  The goal is taught: its pose is the mean of `TAUGHT` frames of the hub at its
place.  The robot believes the camera to be elsewhere (`hand_eye`), and repeats its motions to RP.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..calibration import calibrate_joint
from ..checks import DetectionError
from ..insertion import RP_OF_SIGMA
from ..paper import paper_experiment
from ..pegs import locate_pegs
from ..pose import estimate_pose, project_discs
from ..render import render_hub

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from ..camera import TsaiCamera
    from ..pose import HubPose

GOAL_DEPTH = 400.0  # mm
TAUGHT = 16  # frames
CORNER_SIGMA = 0.002  # px for each grey value of noise: what `find_corners` reaches on rendered boards
MARGIN = 3.0  # px between hub and image border, in the fast mode, with less than which the hub is not found
MODEL_FRAMES = 40  # rendered for the noise model
PARTS_SIGMA = 0.3  # px, of bore and screws in the fast mode
HALF_TURN = 2  # the hub looks the same after half a turn


@dataclass(frozen=True)
class NoiseModel:
    """How far the pegs' centres are off, and how far they say to be: px of a peg of radius 1 px, falling as its root.

    The bound of a disc's centre falls with the root of its radius (Cramer-Rao), and so do the errors of the fit.
    """

    error: float
    sigma: float


def start_pose(
    goal: RigidTransform, rng: np.random.Generator, *, shift: float = 60.0, turn: float = 40.0, tilt: float = 15.0
) -> RigidTransform:
    """A pose within `shift` mm, `turn` and `tilt` degrees of the goal, uniform in the ball, the turn and the tilt's disc."""
    way = rng.standard_normal(3)
    way *= shift * rng.random() ** (1 / 3) / np.linalg.norm(way)
    axis, angle = rng.uniform(0, 2 * np.pi), np.deg2rad(tilt) * np.sqrt(rng.random())
    tilted = Rotation.from_rotvec(angle * np.array([np.cos(axis), np.sin(axis), 0.0]))
    turned = Rotation.from_rotvec([0, 0, np.deg2rad(rng.uniform(-turn, turn))])
    return RigidTransform.from_components(goal.translation + way, tilted * goal.rotation * turned)


@cache
def noise_model(noise: float) -> NoiseModel:
    """The `NoiseModel` of rendered frames with that noise, grey values, at poses between start and goal.

    Examples
    --------
    >>> model = noise_model(2.0)
    >>> bool(0.5 < model.error / model.sigma < 2)
    True
    """
    experiment, errors, sigmas = paper_experiment(), [], []
    for seed in range(MODEL_FRAMES):
        rng = np.random.default_rng([seed, 7])
        pose = start_pose(goal_pose(), rng)
        found = locate_pegs(frame_at(pose, noise, rng), experiment.hub)
        turned = pose * RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, np.pi]))
        centers = min(
            (_peg_images(experiment, p)[0] for p in (pose, turned)), key=lambda c: np.abs(c - found.peg_centers).max()
        )
        root = np.sqrt(found.peg_radii)[:, None]
        errors.append(root * (found.peg_centers - centers))
        sigmas.append(root * found.peg_sigmas)
    return NoiseModel(*(float(np.sqrt(np.mean(np.square(values)))) for values in (errors, sigmas)))


def frame_at(cam_from_hub: RigidTransform, noise: float, rng: int | np.random.Generator) -> NDArray[Any]:
    """Render the hub at a pose, seen by the paper's camera.

    Examples
    --------
    >>> frame_at(goal_pose(), 2.0, 0).shape
    (1200, 1600)
    """
    experiment = paper_experiment()
    return render_hub(experiment.camera, cam_from_hub, experiment.hub, blur=experiment.blur, noise=noise, rng=rng)


def goal_pose() -> RigidTransform:
    """cam_from_hub where the hub belongs: on the optical axis, tilted as in Table 1.

    Examples
    --------
    >>> goal_pose().translation.tolist()  # mm
    [0.0, 0.0, 400.0]
    """
    return RigidTransform.from_components([0.0, 0.0, GOAL_DEPTH], paper_experiment().cam_from_plane.rotation)


def _peg_images(experiment, pose):
    hub = experiment.hub
    return project_discs(experiment.camera, pose, hub.peg_centers, np.full(hub.n_pegs, hub.peg_radius))


@dataclass
class Cell:
    """A camera, a robot and a hub.

    Parameters
    ----------
    start : RigidTransform
        cam_from_hub.
    rng : Generator
    noise : float
        Grey values.
    rendered : bool
        Whether frames are rendered and the pegs found in them; else the pegs' images are drawn from the `NoiseModel`.
    hand_eye : RigidTransform
        Motions in the camera's frame come out turned and shifted by it: true_cam_from_believed_cam.
    repeatability : float
        RP of ISO 9283, mm.
    """

    start: RigidTransform
    rng: np.random.Generator
    noise: float = 2.0
    rendered: bool = False
    hand_eye: RigidTransform = field(default_factory=RigidTransform.identity)
    repeatability: float = 0.05

    def __post_init__(self) -> None:
        self.experiment = paper_experiment(noise=self.noise)
        self.camera = self._calibrated()
        self.place = goal_pose()
        self.goal, self.goal_covariance = self._taught()
        self.place = self.start
        self.places = [self.start]

    def _calibrated(self) -> TsaiCamera:
        """The camera as it was calibrated, from boards of its own."""
        experiment = self.experiment
        board = experiment.board.object_points
        corners = [experiment.camera.project(board, pose) for pose in experiment.cam_from_boards]
        seen = [points + CORNER_SIGMA * self.noise * self.rng.standard_normal(points.shape) for points in corners]
        return calibrate_joint([board] * 5, seen, experiment.camera.sensor).camera

    def _taught(self):
        """The mean of some poses at the goal, and its covariance: what its frames' noise leaves."""
        poses = [self.observe() for _ in range(TAUGHT)]
        first = poses[0].cam_from_hub
        turns = np.mean([(pose.cam_from_hub.rotation * first.rotation.inv()).as_rotvec() for pose in poses], axis=0)
        shift = np.mean([pose.cam_from_hub.translation for pose in poses], axis=0)
        mean = RigidTransform.from_components(shift, Rotation.from_rotvec(turns) * first.rotation)
        return mean, np.mean([pose.covariance for pose in poses], axis=0) / TAUGHT

    def observe(self) -> HubPose:
        """The hub's pose in a new frame; of two labellings, the one nearer to the goal's turn."""
        seen = self._in_frame() if self.rendered else self._drawn()
        pose = estimate_pose(seen, self.camera, self.experiment.hub)
        return _turned_to(pose, goal_pose())

    def _in_frame(self):
        return locate_pegs(frame_at(self.place, self.noise, self.rng), self.experiment.hub)

    def _drawn(self):
        """What `locate_pegs` would give, by the noise model."""
        experiment, model = self.experiment, noise_model(self.noise)
        hub, camera = experiment.hub, experiment.camera
        centers, radii = _peg_images(experiment, self.place)
        width, height = camera.image_size
        near = np.minimum(centers, np.array([width, height]) - 1 - centers).min(axis=1) - radii
        if (near < MARGIN).sum() > 1:
            raise DetectionError("more than one peg is outside of the image")
        spread = model.error / np.sqrt(radii)[:, None]
        screws = camera.project(hub.screw_centers, self.place)
        (bore,), _ = project_discs(camera, self.place, hub.bore_center[None], [hub.bore_radius])
        covariances = np.eye(2) * (model.sigma**2 / radii)[:, None, None]
        covariances[near < MARGIN] = np.diag([np.inf, np.inf])
        return SimpleNamespace(
            peg_centers=centers + spread * self.rng.standard_normal(centers.shape),
            peg_radii=radii,
            peg_covariances=covariances,
            screw_centers=screws + PARTS_SIGMA * self.rng.standard_normal(screws.shape),
            bore_center=bore + PARTS_SIGMA * self.rng.standard_normal(2),
        )

    def move(self, motion: RigidTransform) -> None:
        """The robot's motion: asked for in the camera's frame, made through the hand-eye transform, to its repeatability."""
        made = self.hand_eye * motion * self.hand_eye.inv()
        off = RigidTransform.from_translation(self.repeatability / RP_OF_SIGMA * self.rng.standard_normal(3))
        self.place = off * made * self.place
        self.places.append(self.place)


def _turned_to(pose, goal):
    """The pose with the labels, of those that the screws allow, whose turn is nearer to the goal's."""
    half = RigidTransform.from_rotation(Rotation.from_rotvec([0, 0, 2 * np.pi / HALF_TURN]))
    if (pose.cam_from_hub.rotation.inv() * goal.rotation).magnitude() < np.pi / 2:
        return pose
    return replace(pose, cam_from_hub=pose.cam_from_hub * half)
