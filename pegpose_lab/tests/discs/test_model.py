"""The fast model against a literal one."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from pegpose_lab.discs import model, ring
from pegpose_lab.discs.ellipse import _Ellipse


@given(st.floats(-0.6, 0.6), st.floats(-1.5, 1.5), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_shape_steps_match_the_distance_derivatives(m, angle, dp, dq):
    """A small step of the shape changes the distance as the analytic derivatives say."""
    ellipse = _Ellipse(3.0, -2.0, 20.0, abs(m), angle)
    t = np.linspace(0, 6, 25)
    x, y = 3 + 21 * np.cos(t), -2 + 19 * np.sin(t)
    (a, b), cos, sin = ellipse.axes, np.cos(angle), np.sin(angle)
    x, y = 3 + a * np.cos(t) * cos - b * np.sin(t) * sin, -2 + a * np.cos(t) * sin + b * np.sin(t) * cos
    step = 1e-6 * np.array([0.7, -0.4, 0.9, dp, dq])
    before, rows, _ = _geometry(x, y, ellipse)
    after = _geometry(x, y, ellipse.moved(*step))[0]
    np.testing.assert_allclose(before, 0, atol=1e-9)
    np.testing.assert_allclose(after - before, step @ rows, atol=2e-9)


# ---------------------------------------------------------------------------- the fast model and a literal one


def _geometry(x, y, ellipse):
    """Signed distance (positive inside), its derivatives by x, y, r, p, q as rows, and the curvature.

    With w = S (X - c), S = diag(e^-m, e^m) R^T, the ellipse is |w| = r; the distance is
    (r - |w|) / |S^T w / |w||, exact for circles and in error by (d^2/r) O(m^2) for ellipses.
    """
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    grow, shrink = np.exp(ellipse.m), np.exp(-ellipse.m)
    dx, dy = x - ellipse.x, y - ellipse.y
    u, v = shrink * (dx * cos + dy * sin), grow * (dy * cos - dx * sin)
    norm = np.sqrt(u * u + v * v)
    centre = norm < 1e-6  # has no direction; any will do
    u[centre], norm[centre] = 1e-6, 1e-6
    u /= norm
    v /= norm
    along, across = shrink * u, grow * v
    inverse = 1 / np.sqrt(along * along + across * across)
    rows = np.empty((5, len(x)))
    rows[0] = (along * cos - across * sin) * inverse
    rows[1] = (along * sin + across * cos) * inverse
    rows[2] = inverse
    rows[3] = (u * u - v * v) * norm * inverse
    rows[4] = 2 * u * v * norm * inverse
    return (ellipse.r - norm) * inverse, rows, inverse**3 / ellipse.r


def _model(x, y, ellipse, log_s):
    """Phi and the derivatives of Phi by x, y, r, p, q, log s (rows)."""
    s = np.exp(log_s)
    distance, rows, curvature = _geometry(x, y, ellipse)
    shift = 0.5 * s * curvature
    z = distance / s - shift
    density = np.exp(-0.5 * z * z) * (1 / (np.sqrt(2 * np.pi) * s))
    derivatives = np.empty((6, len(x)))
    np.multiply(rows, density, out=derivatives[:5])
    derivatives[5] = -(z + 2 * shift) * density * s
    return ndtr(z), derivatives


@given(
    st.floats(0, 0.4), st.floats(-1.5, 1.5), st.floats(-0.5, 0.7), st.floats(3, 60), st.sampled_from([0.0, 0.3, -0.4])
)
def test_fast_rows_equal_the_literal_model(m, angle, log_s, r, shift):
    """Single precision and the tables cost less than 1e-3 of the contrast, and of its derivatives."""
    ellipse = _Ellipse(*(np.array([value]) for value in (100.0 + shift, 90.0 - shift, r, m, angle)))
    t = np.linspace(0, 6.2, 40)[:, None]
    beyond = 1 + np.linspace(-4, 4, 9) / r
    x = np.rint(100 + r * beyond * np.cos(t)).ravel()
    y = np.rint(90 + r * beyond * np.sin(t)).ravel()
    ones = np.ones((1, len(x)), np.float32)
    pixels = ring._Pixels(
        np.array([[100.0, 90.0]]),
        (x[None] - 100).astype(np.float32),
        (y[None] - 90).astype(np.float32),
        ones,
        ones,
        np.zeros(1),
    )
    fast = model._ingredients(pixels, ellipse, np.array([log_s]), extra=2)[:, 0]
    one = _Ellipse(*(float(getattr(ellipse, name)[0]) for name in ("x", "y", "r", "m", "angle")))
    share, derivatives = _model(x, y, one, log_s)
    far = np.hypot(x - one.x, y - one.y) > 1
    np.testing.assert_allclose(fast[7][far], share[far], atol=1e-3)
    np.testing.assert_allclose(fast[:6, far], derivatives[:, far], atol=2e-3 * max(1, r * np.exp(-log_s) / 10))
    distance = _geometry(x, y, one)[0]
    np.testing.assert_allclose(fast[9][far], distance[far], atol=1e-3)
