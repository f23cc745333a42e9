"""Ellipse fits of a labelled ring's discs, checked against the perspective (homography) of one plane."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..checks import DetectionError
from ..discs import fit_discs
from ..flags import Flag
from .candidates import _as_circles
from .edges import _ellipses, _fields_beside, _rims, _visible
from .hidden import LEAST_MEASURED, _peg_image, _seen_pegs
from .motion_blur import _motion_blur
from .rings import RADIUS_TOLERANCE


@dataclass(frozen=True, eq=False)
class PegObservation:
    """The parts of a hub, or of a ring of a `RingPattern`, in one image; rows in label order.

    Of a ring without bore, `bore_center` is the image of the ring's middle, with radius 0; the screws are its marks.

    Attributes
    ----------
    peg_centers : (n_pegs, 2) ndarray
        Centres of the pegs' images (centres of the ellipses, which are not the images of the peg centres; see `pose`), px.
    peg_radii : (n_pegs,) ndarray
        Radii of the circles of equal area, px.
    peg_sigmas : (n_pegs, 2) ndarray
        Standard deviations of `peg_centers`, px.
    hub_center : (2,) ndarray
        Image of the hub's centre in the plane of the peg tops, from the pegs' homography, px.
    screw_centers, screw_radii, screw_sigmas : (n_screws, 2), (n_screws,) and (n_screws, 2) ndarray
        px.
    bore_center, bore_radius, bore_sigma : (2,) ndarray, float and (2,) ndarray
        px.
    flags : tuple of Flag
        A sentence with a code for each part that was found but could not be measured, "screw 2: edge
        hidden" (the reasons are those of `fit_discs`, or "no disc there"), with infinite sigmas.  Centre and radius are
        then those of the Hough transform (accurate to a pixel or two), those of a peg what the other pegs make
        of it: one peg of four or more may be hidden.  Of a ring there may be more flags, see `Flag`.
    peg_covariances : (n_pegs, 2, 2) ndarray
        Of `peg_centers`, px^2; infinite for a missing one, whose centre is where the others have it.
    states : tuple of str
        "measured"; "partial": part of the rim is seen, and the ring gives the shape; "missing": the place is empty;
        "contradicted": there is a rim, but not that of a disc of this ring, and the covariance covers both.
    visible : (n_pegs,) ndarray
        Part of each rim that is seen, 0 to 1.
    homography : (3, 3) ndarray
        From the plane of the pegs (x, y in mm, or the pattern's unit) to the image.
    residual, residual_over_sigma : float
        Rms distance of the rims from the images of equal discs in one plane, px, and its ratio to what is left if each
        disc has an ellipse of its own; 0 for a hub, whose discs are fitted one by one.
    labelled_by : {"mark", "previous frame", "nothing"}
    turns : (m, n_pegs) ndarray of int
        The labellings that remain possible: ``peg_centers[turn]``; the first changes nothing.
    rivals : tuple of (3, 3) ndarray
        Homographies of other rings that fit the pattern nearly as well.
    motion_blur : float
        Rms length, px, of the pegs' motion during the exposure, as the widths of a hub's rims tell it; 0 where they tell of
        none (see the flag "motion-blur").  Centres are those of the middle of the exposure.

    Examples
    --------
    >>> from scipy.spatial.transform import RigidTransform, Rotation
    >>> import pegpose_lab as pl
    >>> camera = pl.TsaiCamera(8.0, pixel_pitch=(0.01, 0.01), principal_point=(199.5, 149.5), image_size=(400, 300))
    >>> hub = pl.Hub(n_pegs=4, pitch_circle_diameter=97.05, peg_radius=10.1)
    >>> cam_from_hub = RigidTransform.from_components([2.0, -1.0, 400.0], Rotation.from_rotvec([0, 0, 0.3]))
    >>> image = pl.render_hub(camera, cam_from_hub, hub, rng=0)
    >>> observation = pl.locate_pegs(image, hub)
    >>> observation.peg_radii.round().tolist(), observation.flags
    ([20.0, 20.0, 20.0, 20.0], ())
    """

    peg_centers: np.ndarray
    peg_radii: np.ndarray
    peg_sigmas: np.ndarray
    hub_center: np.ndarray
    screw_centers: np.ndarray
    screw_radii: np.ndarray
    screw_sigmas: np.ndarray
    bore_center: np.ndarray
    bore_radius: float
    bore_sigma: np.ndarray
    flags: tuple[Flag, ...] = ()
    peg_covariances: np.ndarray | None = None
    states: tuple[str, ...] = ()
    visible: np.ndarray | None = None
    homography: np.ndarray | None = None
    residual: float = 0.0
    residual_over_sigma: float = 0.0
    labelled_by: str = "nothing"
    turns: np.ndarray | None = None
    rivals: tuple[np.ndarray, ...] = ()
    motion_blur: float = 0.0


# ---- measuring ----


def _measure(image, circles, ring, labelling, hub, labelled_by, turns):
    """Measure the chosen pegs, bore and screws by ellipse fits."""
    index = np.append(labelling.pegs, ring.bore)
    located = np.vstack([np.column_stack([circles.centers[index], circles.radii[index]]), labelling.screws])
    return _measured_parts(image, located, hub, labelled_by, turns)


def _measured_parts(image, located, hub, labelled_by, turns=None):
    """The same for circles (n_pegs + 1 + n_screws, 3) of pegs, bore and screws in label order."""
    n, n_screws = hub.n_pegs, len(located) - hub.n_pegs - 1
    names = [f"peg {k + 1}" for k in range(n)] + ["bore"] + [f"screw {k + 1}" for k in range(n_screws)]
    parts, covariances, reasons, shapes = _fit_parts(image, located)
    blur = _motion_blur(image, parts[:n, :2], shapes[:n], [not reason for reason in reasons[:n]])
    try:
        _check_fits(reasons, names, n)
        homography = _homography(parts[:n, :2], hub)
        homography, reasons[:n] = _seen_pegs(homography, parts[:n], shapes[:n], reasons[:n], hub)
    except DetectionError as error:
        if blur is None:
            raise
        raise DetectionError(f"{error}; {_told(blur)}") from error
    for peg in np.flatnonzero([bool(reason) for reason in reasons[:n]]):
        parts[peg, :2], parts[peg, 2], shapes[peg] = _peg_image(homography, peg, hub)
        covariances[peg] = np.diag([np.inf, np.inf])
    sigmas = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    return PegObservation(
        peg_centers=parts[:n, :2],
        peg_radii=parts[:n, 2],
        peg_sigmas=sigmas[:n],
        hub_center=homography[:2, 2] / homography[2, 2],
        screw_centers=parts[n + 1 :, :2],
        screw_radii=parts[n + 1 :, 2],
        screw_sigmas=sigmas[n + 1 :],
        bore_center=parts[n, :2],
        bore_radius=float(parts[n, 2]),
        bore_sigma=sigmas[n],
        flags=_flags_of(names, reasons) + ((Flag("motion-blur", _told(blur)),) if blur else ()),
        peg_covariances=covariances[:n],
        states=tuple("missing" if reason else "measured" for reason in reasons[:n]),
        visible=_visible_rims(image, parts[:n, :2], shapes[:n]),
        homography=homography,
        labelled_by=labelled_by,
        turns=np.arange(n)[None] if turns is None else turns,
        motion_blur=blur or 0.0,
    )


def _visible_rims(image, centers, shapes):
    """The visible shares (n,) of the pegs' rims."""
    reaches = 1.3 * np.sqrt(np.linalg.eigvalsh(shapes)[:, -1:]) + 4
    lows = np.maximum(np.floor(centers - reaches), 0).astype(int)
    highs = np.ceil(centers + reaches).astype(int)
    parts = [image[y0:y1, x0:x1] for (x0, y0), (x1, y1) in zip(lows.tolist(), highs.tolist(), strict=True)]
    field, steps = _fields_beside(parts)
    outlines = _ellipses(centers - lows + steps, np.linalg.cholesky(shapes))
    rims, _ = _rims(field, outlines, np.ones(len(centers)), 2.5 / float(outlines.px.mean()))
    return _visible(rims, rims.offsets * outlines.px, 1.0)


def _fit_parts(image, located):
    """Measure the circles `located` (k, 3).

    Returns x, y, radius (k, 3), covariances of x and y (k, 2, 2), why a part could not be measured, "" where it was, and
    the shapes (k, 2, 2): matrices with the squares of the semi-axes as eigenvalues.  What cannot be
    measured stays where it was located, with infinite sigmas.
    """
    discs = fit_discs(image, _as_circles(located))
    moved = np.linalg.norm(discs.centers - located[:, :2], axis=1)
    strayed = np.maximum(moved, np.abs(discs.radii - located[:, 2])) > RADIUS_TOLERANCE * located[:, 2]
    measured = discs.accepted & ~strayed
    fitted = np.column_stack([discs.centers, discs.radii])
    reasons = np.where(measured, "", np.where(discs.accepted, "no disc there", discs.reasons))
    cos, sin = np.cos(discs.angles), np.sin(discs.angles)
    axes = np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1) * discs.semi_axes[:, None, :]
    return (
        np.where(measured[:, None], fitted, located),
        np.where(measured[:, None, None], discs.covariance[:, :2, :2], np.diag([np.inf, np.inf])),
        [str(reason) for reason in reasons],
        axes @ axes.transpose(0, 2, 1),
    )


def _told(blur):
    """The sentence of the flag "motion-blur"."""
    return (
        f"the hub moved by about {blur:.1f} px during the exposure: centres and pose are those of its middle, and errors of "
        "one or two hundredths of the motion are not in their sigmas; expose shorter, or move slower"
    )


def _flags_of(names, reasons):
    """A flag for each part that could not be measured."""
    flags = []
    for name, reason in zip(names, reasons, strict=True):
        text = f"{name}: {reason}"
        if reason and name == "bore":
            flags.append(Flag("bore-not-measured", text))
        elif reason and name.startswith("peg"):
            flags.append(Flag("peg-not-measured", text))
        elif reason:
            flags.append(Flag("screw-not-measured", text))
    return tuple(flags)


def _check_fits(reasons, names, n_pegs):
    """Raise if more than one of four or more pegs could not be measured, or no screw."""
    failed = [f"{name} ({reason})" for name, reason in zip(names, reasons, strict=False) if reason]
    measured = sum(not reason for reason in reasons[:n_pegs])
    if measured < max(n_pegs - 1, LEAST_MEASURED) or all(reasons[n_pegs + 1 :]):
        raise DetectionError(
            f"{', '.join(failed)}: found, but the edge cannot be measured; clear the view of the pegs and of "
            "a screw, soften the light, show the whole part"
        )


def _homography(peg_centers, hub):
    """The matrix (3, 3) that takes the plane of the peg tops to the image; for three pegs an affine one."""
    if hub.n_pegs == 3:
        plane = np.column_stack([hub.peg_centers[:, :2], np.ones(3)])
        return np.vstack([np.linalg.solve(plane, peg_centers).T, [0, 0, 1]])
    middle = peg_centers.mean(axis=0)
    shift = np.array([[1, 0, middle[0]], [0, 1, middle[1]], [0, 0, 1]])
    return shift @ cv2.findHomography(hub.peg_centers[:, :2], peg_centers - middle)[0]
