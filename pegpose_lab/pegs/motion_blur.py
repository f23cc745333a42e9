"""How far the discs' images moved during the exposure, by the widths of their rims.

An image that moves by v during the exposure has its edges widened, in variance along their normal n, by

    s^2(n) = s_0^2 + (v . n)^2 / 12 = s_0^2 + |v|^2 / 24 (1 + cos 2 (phi_n - phi_v)),

so the second harmonic of the width round a disc is v^2 / 24 as a complex number.  The discs of a rigid part move as
v_k = v + i w z_k: what does not (a highlight, swarf, uneven ground) is no motion.
"""

import cv2
import numpy as np
from scipy.special import ndtr

RAYS = 96  # round each disc
REACH = 6.0  # px, of the profiles on each side of the rim, and SPACING of their samples
SPACING = 0.5
LEAST_RADIUS = 9.5  # px: smaller discs have no level inside, 6 px from their rim
LEAST_BLUR = 1.5  # px: with less, errors and sigmas are those of a sharp image
CLEAR = 2.5  # sigmas, all harmonics together: of eight random numbers 4 in 10^8 are so large
FIT = 0.4  # of the harmonics' length: how much of them a rigid motion may leave over
ROUNDS = 4  # of the estimate of the rims' common width
VARIANCES = 0.3, 6.0  # px^2, that the common width may have: the profiles are short


def _motion_blur(image, centers, shapes, measured):
    """Rms length, px, of the motion of discs with ellipses `centers` (n, 2), `shapes` (n, 2, 2), of which `measured` (n,)
    count; None where their rims tell of none.

    Three discs at least are needed, as a shift and a turn explain two discs whatever their rims.
    """
    large = (np.linalg.eigvalsh(shapes)[:, 0] > LEAST_RADIUS**2) & measured
    if large.sum() < 3:
        return None
    widths, normals = _widths(image, centers[large], shapes[large])
    harmonics, sigmas = _second_harmonics(widths, normals)
    size = np.linalg.norm(harmonics)
    if size < CLEAR * np.linalg.norm(sigmas):
        return None
    motions = _rigid(24 * harmonics, centers[large] @ (1, 1j))
    length = float(np.sqrt(np.mean(np.abs(motions) ** 2)))
    left = np.linalg.norm(24 * harmonics - motions**2)
    return length if length > LEAST_BLUR and left < FIT * 24 * size else None


def _widths(image, centers, shapes):
    """What the rims' variances (n, RAYS), px^2, have beyond their mean, and their normals (n, RAYS) as x + i y.

    A profile is lo + A Phi(-t / s) with a slope outside; its width is read off by linear least squares about a common s: of a
    motion of 5 px a fifth too much, of 8 px half.
    """
    turns = 2 * np.pi * np.arange(RAYS) / RAYS
    units = np.column_stack([np.cos(turns), np.sin(turns)])
    values, vectors = np.linalg.eigh(shapes)
    roots = vectors * np.sqrt(values)[:, None] @ vectors.transpose(0, 2, 1)
    points = centers[:, None] + units @ roots
    normals = units @ np.linalg.inv(roots)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    steps = np.arange(-REACH, REACH + SPACING / 2, SPACING)
    spots = (points[:, :, None] + steps[:, None] * normals[:, :, None]).astype(np.float32)
    spots = spots.reshape(-1, len(steps), 2)
    profiles = cv2.remap(image, spots[..., 0], spots[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(
        float
    )
    variance = 1.0
    for _ in range(ROUNDS):
        s = np.sqrt(variance)
        bell = np.exp(-0.5 * (steps / s) ** 2) / (s * np.sqrt(2 * np.pi))
        ones, outside = np.ones_like(steps), np.maximum(steps, 0)
        design = np.column_stack([ones, ndtr(-steps / s), bell, steps * bell / (2 * variance), outside])
        solution = np.linalg.lstsq(design, profiles.T, rcond=None)[0]
        contrast = np.median(solution[1])
        widths = solution[3] / contrast if abs(contrast) > 1 else np.zeros(len(profiles))
        variance = float(np.clip(variance + np.median(widths), *VARIANCES))
    return widths.reshape(len(centers), RAYS), normals @ (1, 1j)


def _second_harmonics(widths, normals):
    """The complex second harmonics (n,) of the widths over the normals' directions, px^2, and their sigmas (n,).

    Robust: what is far off the harmonics of a disc, as at a highlight, counts little.
    """
    double = normals**2
    harmonics, sigmas = np.zeros(len(widths), complex), np.zeros(len(widths))
    for k, (width, turn) in enumerate(zip(widths, double, strict=True)):
        design = np.column_stack([np.ones(RAYS), turn.real, turn.imag])
        weights = np.ones(RAYS)
        for _ in range(5):
            rows = design * weights[:, None]
            solution = np.linalg.solve(rows.T @ design, rows.T @ width)
            off = width - design @ solution
            scale = max(1.4826 * float(np.median(np.abs(off))), 1e-6)
            weights = 1 / np.maximum(np.abs(off) / (1.5 * scale), 1.0)
        harmonics[k] = solution[1] + 1j * solution[2]
        sigmas[k] = scale * np.sqrt(2 * 2 / RAYS)
    return harmonics, sigmas


def _rigid(squares, z):
    """The rigid motion v + i w (z - mean z) whose squares are nearest to `squares` (n,): its values (n,).

    Its sign is not seen: of the starts (a shift, a turn, and both) the one that leaves least is refined.
    """
    arm = z - z.mean()
    shift = np.sqrt(squares.mean() + 0j)
    turn = np.sqrt(max(float(np.mean((-squares / arm**2).real)), 0.0))
    basis, motions = np.column_stack([np.ones(len(z)), np.full(len(z), 1j), 1j * arm]), []
    for v, w in ((shift, 0.0), (0j, turn), (shift, turn), (shift, -turn)):
        x = np.array([v.real, v.imag, w])
        for _ in range(15):
            off = squares - (basis @ x) ** 2
            design = 2 * (basis @ x)[:, None] * basis
            design = np.vstack([design.real, design.imag])
            normal = design.T @ design
            damped = normal + 1e-9 * max(float(np.trace(normal)), 1e-12) * np.eye(3)
            x = x + np.linalg.solve(damped, design.T @ np.concatenate([off.real, off.imag]))
        motions.append(basis @ x)
    return min(motions, key=lambda motion: np.linalg.norm(squares - motion**2))
