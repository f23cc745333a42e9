"""Sub-pixel discs: the maximum-likelihood fit of a blurred ellipse edge, with a sigma for every number.

Around the edge of a blurred disc the picture is

    I = B + A Phi((d - s^2 kappa / 2) / s),

d the signed distance to the ellipse (positive inside), Phi the normal distribution function, s the
edge's standard deviation (optical blur and the pixel's own width, s^2 = blur^2 + 1/12) and kappa the
ellipse's curvature: blur moves the half-way point of a curved edge towards the inside by s^2 kappa / 2.
With white noise, least squares over the pixels of a ring around the edge is maximum likelihood: for
a disc of radius r, contrast A and noise sigma, no unbiased method can measure the centre better
than (sigma / A) sqrt(2 s / (sqrt(pi) r)) per axis.

The fit runs over the centre, the radius of the circle of equal area r, the shape, log s and the
levels; where the ground farther out is even, up to 24 px from the edge, its mean values help to know these.  The
shape is a symmetric traceless matrix m (cos 2 angle, sin 2 angle; sin 2 angle, -cos 2 angle)
with semi-axes r exp(+-m): unlike axes and angle it is regular for a perfect circle.
"""

import threading

import numpy as np
from scipy.special import ndtr

QUANTISATION = 1 / 12  # variance of rounding to whole grey values


def _ingredients(pixels, ellipse, log_s, extra=0):
    """Layers (9, n, m): Phi's derivatives by x, y, r, p, q, log s, then 1, Phi and the grey values.

    With w = S (X - c), S = diag(e^-m, e^m) R^T, the ellipse is |w| = r; the distance is
    (r - |w|) / |S^T w / |w||, exact for circles and in error by (d^2/r) O(m^2) for ellipses.  Two more layers, if
    `extra` is 2: the distance, and the distance times Phi.  All in float32; Phi and its derivative from
    tables, which every processor reads alike.  The layers are overwritten by the next call in the same thread.
    """
    shrink, grow, cos, sin = np.exp(-ellipse.m), np.exp(ellipse.m), np.cos(ellipse.angle), np.sin(ellipse.angle)
    column = np.empty((9, len(ellipse.r), 1), np.float32)
    column[:, :, 0] = (
        ellipse.x - pixels.origin[:, 0],
        ellipse.y - pixels.origin[:, 1],
        shrink * cos,
        shrink * sin,
        grow * cos,
        grow * sin,
        ellipse.r,
        np.exp(-log_s),
        0.5 * np.exp(log_s) / ellipse.r,
    )
    cx, cy, ux, uy, vy, vx, r, per_s, bend = column
    layers = _layers((9 + extra, *pixels.x.shape))
    dx, dy = pixels.x - cx, pixels.y - cy
    u, v = dx * ux, dy * vy
    u += dy * uy
    v -= dx * vx
    uu, vv = u * u, v * v
    norm = np.maximum(uu + vv, np.float32(1e-6))
    inverse_norm = 1 / np.sqrt(norm)
    norm *= inverse_norm
    # the gradient of |w| is (gx, gy) / |w|; dx and dy are no longer needed
    gx, gy = np.multiply(u, ux, out=dx), np.multiply(u, uy, out=dy)
    gx -= v * vx
    gy += v * vy
    inverse = gx * gx
    inverse += gy * gy
    inverse = 1 / np.sqrt(np.maximum(inverse, np.float32(0.01) * norm * norm))
    steep = inverse * norm  # 1 / |gradient of |w||
    short, cubed = r - norm, steep * steep * steep
    cubed *= bend
    z = short * (steep * per_s)
    z -= cubed
    cell = _cells(z)
    density = _DENSITY.take(cell, mode="clip")
    density *= per_s
    density *= pixels.used
    flat = density * inverse
    np.multiply(gx, flat, out=layers[0])
    np.multiply(gy, flat, out=layers[1])
    np.multiply(density, steep, out=layers[2])
    np.multiply(np.subtract(uu, vv, out=uu), flat, out=layers[3])
    u *= v
    flat *= 2
    np.multiply(u, flat, out=layers[4])
    cubed *= 2
    z += cubed
    np.multiply(density / -per_s, z, out=layers[5])
    layers[6] = pixels.used
    np.multiply(_CDF.take(cell, mode="clip"), pixels.used, out=layers[7])
    layers[8] = pixels.values
    if extra:
        steep *= pixels.used
        np.multiply(short, steep, out=layers[9])
        np.multiply(layers[9], layers[7], out=layers[10])
    return layers


_KEPT = threading.local()
MOST_KEPT = 1_000_000  # numbers, not kept for large fits: fresh memory takes the system longer than the arithmetic


def _layers(shape):
    """An array of that shape, in the memory of the last one where that is large enough."""
    size = int(np.prod(shape))
    if size > MOST_KEPT:
        return np.empty(shape)
    if getattr(_KEPT, "memory", None) is None:
        _KEPT.memory = np.empty(MOST_KEPT)
    return _KEPT.memory[:size].reshape(shape)


def _cells(z):
    """Where the tables below hold float32 values."""
    return (z * np.float32(1024) + np.float32(8 * 1024 + 0.5)).astype(np.int32)


_TABULATED = np.arange(-8 * 1024, 8 * 1024 + 1) / 1024
_CDF = ndtr(_TABULATED).astype(np.float32)
_DENSITY = (np.exp(-0.5 * _TABULATED**2) / np.sqrt(2 * np.pi)).astype(np.float32)
