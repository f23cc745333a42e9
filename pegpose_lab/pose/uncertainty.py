r"""What makes a pose uncertain: the measured discs, the part, the camera's calibration, and the plane.

With the gain G = dp/dm of the pose p by the measured centres and radii m, and what changes the images m(p) that the
pose predicts, the pose moves by

.. math:: \delta p = G \, (\delta m - P\, \delta d - D\, \delta\theta) + (1 - G B) A \, \delta\pi

for noise :math:`\delta m` of the discs, errors :math:`\delta d` of their places on the part, :math:`\delta\theta` of the
camera's parameters, and a motion :math:`\delta\pi` of the plane: it takes the hub along (A), and the discs, which have
not moved (B = dm/dp), take it back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..camera import lens_covariance, lens_derivative
from ..checks import as_count, as_covariance, as_number

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray
    from scipy.spatial.transform import RigidTransform

    from ..calibration import Calibration
    from ..camera import FisheyeCamera, OpenCVCamera, TsaiCamera
    from .fit import Discs, Fit


@dataclass(frozen=True, eq=False)
class Causes:
    """What is known of the causes besides the discs' own noise: the camera's covariance, the view whose pose the plane
    shares, a covariance (6, 6) of the plane of its own, and the sigma of the pegs' places and radii on the part, mm."""

    calibration: Calibration | None
    plane: RigidTransform | None
    plane_view: int | None
    plane_covariance: NDArray[np.float64] | None
    part_sigma: float

    @classmethod
    def checked(
        cls,
        camera: TsaiCamera | OpenCVCamera | FisheyeCamera | Calibration,
        plane: RigidTransform | None,
        plane_view: int | None,
        plane_covariance: ArrayLike | None,
        part_sigma: float,
    ) -> Causes:
        """The checked arguments of `estimate_pose`; ValueError if one is unusable."""
        calibration = camera if hasattr(camera, "camera") else None
        if plane is None and (plane_view is not None or plane_covariance is not None):
            raise ValueError("plane_view and plane_covariance need a plane; expected plane, or neither")
        if plane_view is not None:
            views = len(calibration.cam_from_object) if calibration is not None else 0
            if not views or calibration.covariance is None:
                raise ValueError("plane_view needs a Calibration with poses and a covariance in place of the camera")
            plane_view = as_count(plane_view, "plane_view", 0, views - 1)
        if plane_covariance is not None:
            plane_covariance = as_covariance(plane_covariance, "plane_covariance", infinite=False)
        return cls(calibration, plane, plane_view, plane_covariance, as_number(part_sigma, "part_sigma", 0))


def budget_of(fit: Fit, discs: Discs, noise: NDArray[np.float64], causes: Causes) -> dict[str, NDArray[np.float64]]:
    """Covariances (6, 6) of the pose by cause, of a left perturbation in axes of the camera at the hub's origin, mm, rad.

    Parameters
    ----------
    fit : Fit
    discs : Discs
    noise : (n, 3, 3) ndarray
        Of the measured centres and radii, px^2.
    causes : Causes

    Returns
    -------
    dict
        "discs" and, where they are known, "part", "calibration" (the camera's parameters, and the pose of the plane's view)
        and "plane"; their sum is the covariance.
    """
    if not np.isfinite(fit.gain).all():
        return {"discs": np.diag(np.full(6, np.inf))}
    gain = fit.gain.reshape(6, -1)
    budget = {"discs": fit.covariance(noise)}
    if causes.part_sigma:
        by_place = np.einsum("ikp,kpq->ikq", fit.gain, _by_place(fit)).reshape(6, -1)
        budget["part"] = causes.part_sigma**2 * by_place @ by_place.T
    along = (np.eye(6) - gain @ fit.images.by_pose().reshape(-1, 6)) if causes.plane is not None else None
    if causes.calibration is not None and causes.calibration.covariance is not None:
        calibration = causes.calibration
        own = lens_covariance(calibration.camera, calibration.covariance)
        design, names = -gain @ _by_lens(fit, calibration.camera, own), list(own.index)
        if causes.plane_view is not None:
            names += [f"{name}_{causes.plane_view}" for name in ("tx", "ty", "tz", "rx", "ry", "rz")]
            view = calibration.cam_from_object[causes.plane_view].translation
            design = np.hstack([design, along @ carried_motion(fit.pose.translation - view)])
        budget["calibration"] = design @ calibration.covariance.loc[names, names].to_numpy() @ design.T
    if causes.plane_covariance is not None:
        design = along @ carried_motion(fit.pose.translation - causes.plane.translation)
        budget["plane"] = design @ causes.plane_covariance @ design.T
    return budget


def _by_place(fit):
    """Derivatives (n, 3, 3) of the images' centres and radii by the discs' own x, y and radius."""
    by_place = fit.images.by_place()
    by_place[:, 2] *= (np.sign(fit.images.areas) / fit.images.radii)[:, None]
    return by_place


def _by_lens(fit, camera, own: pd.DataFrame):
    """Derivatives (3 n, k) of the images' centres and radii by the parameters of `own`."""
    n, m, _ = fit.images.arms.shape
    directions = camera.directions((fit.images.arms + fit.pose.translation).reshape(-1, 3))
    outlines = lens_derivative(camera, own, directions).reshape(n, m, 2, -1)
    return fit.images.by_outline(outlines).reshape(3 * n, -1)


def carried_motion(arm: NDArray[np.float64]) -> NDArray[np.float64]:
    """The matrix (6, 6) from a small motion of a body, (shift, rotation vector), to that of its point at `arm` (3,).

    Examples
    --------
    >>> (carried_motion(np.array([500.0, 0, 0])) @ [0, 0, 0, 0, 0, 1e-3]).tolist()  # 1 mrad about z, 500 mm along x
    [0.0, 0.5, 0.0, 0.0, 0.0, 0.001]
    """
    x, y, z = arm
    motion = np.eye(6)
    motion[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]  # turn x arm
    return motion
