"""The paper's experiment (Sect. 4) on the paper camera: 5 boards and 45 hub frames, with their truth.

The camera is made from Table 1's second row and the scale of Table 2: 0.207 mm per pixel with f = 47.95 mm and
T_z = 267.38 mm is a pixel pitch of 0.207 f / T_z = 0.0371 mm; kappa1 is read in mm^-2
on the sensor.  What is not printed (the other four boards, how far the hub turns and shifts in each frame, its
height, grey values, blur and noise) is chosen here, once, and stated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from ..camera import TsaiCamera
from ..render import render_board, render_hub
from ..targets import Checkerboard, Hub
from . import numbers

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

N_FRAMES = 45
TURN_PER_FRAME = np.deg2rad(-3.0)  # anticlockwise on the screen
SHIFT_PER_FRAME = 1.5  # mm along x of the hub's plane
BOARD_TILTS = ((-25.0, 5.0), (6.0, 27.0), (18.0, -20.0))  # deg about x and y, boards 2 to 4


@cache
def paper_camera() -> TsaiCamera:
    """The camera of Table 1, second row, read consistently (see the module's text).

    Examples
    --------
    >>> paper_camera().image_size
    (1600, 1200)
    """
    table = numbers.table1().set_index("stage")
    focal_length, t_z, kappa1 = table.loc["genetic", ["f", "t_z", "kappa1"]]
    pitch = numbers.mm_per_pixel() * focal_length / t_z
    width, height = numbers.image_size()
    return TsaiCamera(
        focal_length,
        pixel_pitch=(pitch, pitch),
        principal_point=((width - 1) / 2, (height - 1) / 2),
        image_size=(width, height),
        kappa1=kappa1,
    )


def paper_pose() -> RigidTransform:
    """Table 1's pose cam_from_world of the calibration board, its rotation projected on SO(3).

    Examples
    --------
    >>> round(float(paper_pose().translation[2]), 2)
    267.38
    """
    table = numbers.table1().set_index("stage")
    translation = table.loc["genetic", ["t_x", "t_y", "t_z"]].to_numpy(float)
    return RigidTransform.from_components(translation, Rotation.from_matrix(numbers.table1_rotation()))


@dataclass(frozen=True)
class Experiment:
    """Truth of the rendered experiment.

    Attributes
    ----------
    camera : TsaiCamera
    board : Checkerboard
    hub : Hub
    blur, noise : float
        px and grey values, the same in every image.

    Examples
    --------
    >>> experiment = paper_experiment()
    >>> len(experiment.cam_from_boards), len(experiment.cam_from_hubs)
    (5, 45)
    """

    camera: TsaiCamera
    board: Checkerboard
    hub: Hub
    blur: float = 0.9
    noise: float = 2.0

    @cached_property
    def world_from_board(self) -> RigidTransform:
        """Where the first board lies in the world of Table 1: its middle is then near the middle of the image."""
        return RigidTransform.from_translation(np.array([948.5, -667.1, 0.0]) - self.board.center)

    @cached_property
    def cam_from_boards(self) -> list[RigidTransform]:
        """Poses of the five boards: Table 1's; three tilted in other directions; one on the hub's plane."""
        first = paper_pose() * self.world_from_board
        middle = first.apply(self.board.center)
        tilted = []
        for tilt_x, tilt_y in BOARD_TILTS:
            rotation = Rotation.from_euler("xy", [tilt_x, tilt_y], degrees=True)
            tilted.append(RigidTransform.from_components(middle - rotation.apply(self.board.center), rotation))
        on_hub_plane = self.cam_from_plane * RigidTransform.from_translation([-30.0, -40.0, 0.0])
        return [first, *tilted, on_hub_plane]

    @cached_property
    def cam_from_plane(self) -> RigidTransform:
        """The plane of the peg tops: Table 1's tilt, and in frame 1 the hub's centre where Table 2's pegs put it.

        Its origin is the hub's centre in frame 1, seen in the middle of Table 2's four pegs at a depth of
        T_z = 267.38 mm (the paper's 0.27 m).
        """
        table = numbers.table2()
        middle = table[["x_px", "y_px"]].to_numpy().mean(axis=0)
        depth = numbers.table1().set_index("stage").loc["genetic", "t_z"]
        return RigidTransform.from_components(depth * self.camera.rays([middle])[0], paper_pose().rotation)

    @cached_property
    def thetas(self) -> NDArray[np.float64]:
        """(45,) rad: the hub's angle about z in the plane; frame 1 has the direction of Table 2's peg 1."""
        pegs = numbers.table2()[["x_px", "y_px"]].to_numpy()
        first = np.arctan2(*(pegs[0] - pegs.mean(axis=0))[::-1])
        return first + TURN_PER_FRAME * np.arange(N_FRAMES)

    @cached_property
    def shifts(self) -> NDArray[np.float64]:
        """(45,) mm: the hub's position along x of the plane."""
        return SHIFT_PER_FRAME * np.arange(N_FRAMES)

    @cached_property
    def cam_from_hubs(self) -> list[RigidTransform]:
        """(45) poses of the hub."""
        return [
            self.cam_from_plane * RigidTransform.from_components([shift, 0, 0], Rotation.from_rotvec([0, 0, theta]))
            for shift, theta in zip(self.shifts, self.thetas, strict=False)
        ]

    def board_image(self, index: int, *, rng: int = 0) -> NDArray[Any]:
        """Render board 0..4; the noise is seeded by `rng` and `index`."""
        return render_board(
            self.camera, self.cam_from_boards[index], self.board, blur=self.blur, noise=self.noise, rng=[rng, index]
        )

    def hub_frame(self, index: int, *, rng: int = 0, **scene: Any) -> NDArray[Any]:
        """Render hub frame 0..44; the noise is seeded by `rng` and `index`, `scene` goes to `render_hub`."""
        return render_hub(
            self.camera,
            self.cam_from_hubs[index],
            self.hub,
            blur=self.blur,
            noise=self.noise,
            rng=[rng, 100 + index],
            **scene,
        )


def paper_experiment(**changes: Any) -> Experiment:
    """The `Experiment` with the paper's camera, board and hub; `changes` replace its attributes.

    Examples
    --------
    >>> paper_experiment(noise=0.0).noise
    0.0
    """
    settings = dict(camera=paper_camera(), board=Checkerboard(8, 6, numbers.printed("setup.pitch")), hub=Hub())
    return Experiment(**(settings | changes))
