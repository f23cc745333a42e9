"""What `fit_discs` promises of any picture."""

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pegpose_lab.discs import Discs, fit_discs
from pegpose_lab.discs.reasons import REASONS
from pegpose_lab.tests.discs.stacks import _circles
from pegpose_lab.tests.pictures import SEEDS, scenes

NAMES = tuple(Discs.__dataclass_fields__)


def _random_starts(scene, seed, arbitrary):
    """Circles off each disc's centre and radius by up to 20 % of it, then some that have to do with no disc."""
    rng, (x, y, r) = np.random.default_rng(seed), scene.discs.T
    far, turn = 0.2 * r * rng.random(len(r)), rng.uniform(0, 2 * np.pi, len(r))
    near = np.column_stack([x + far * np.cos(turn), y + far * np.sin(turn), r * rng.uniform(0.8, 1.2, len(r))])
    scale = rng.choice([1, 1, 1, 1e6], (arbitrary, 1))
    places = rng.uniform(-0.2, 1.2, (arbitrary, 2)) * scene.image.shape[::-1] * scale
    rows = np.concatenate([near, np.hstack([places, 10 ** rng.uniform(-0.5, 2, (arbitrary, 1)) * scale])])
    return _circles(rows[:, :2], rows[:, 2])


def _assert_discs(discs, shape, circles):
    """What `Discs` and `fit_discs` promise of every result."""
    n = len(circles.radii)
    shapes = {"centers": (n, 2), "semi_axes": (n, 2), "sigmas": (n, 5), "covariance": (n, 5, 5)}
    for name in NAMES:
        assert getattr(discs, name).shape == shapes.get(name, (n,))
        assert getattr(discs, name).dtype.kind == {"states": "U", "reasons": "U"}.get(name, "f")
    assert len(discs) == n and set(discs.reasons) <= {*REASONS, ""}
    assert set(discs.states) <= {"measured", "partial", "rejected"}
    np.testing.assert_array_equal(discs.accepted, discs.reasons == "")
    np.testing.assert_array_equal(discs.usable, discs.states != "rejected")
    for name in ("centers", "semi_axes", "angles", "contrasts", "blurs", "noises", "radii"):
        assert np.isfinite(getattr(discs, name)).all()
    major, minor = discs.semi_axes.T
    assert (major >= minor).all() and (minor > 0).all()
    np.testing.assert_allclose(discs.radii, np.sqrt(major * minor))
    assert (np.abs(discs.angles) <= np.pi / 2).all() and (discs.angles > -np.pi / 2).all()
    assert (discs.noises >= np.sqrt(1 / 12) - 1e-12).all() and (discs.blurs >= 0).all() and (discs.chi2 >= 0).all()
    _assert_sigmas(discs)
    _assert_no_fit(discs, circles)
    _assert_on_picture(discs, shape)


def _assert_sigmas(discs):
    """Positive, the roots of the covariances' diagonals, the angle's no more than that of any direction."""
    assert (discs.sigmas > 0).all() and not np.isnan(discs.covariance).any()
    np.testing.assert_allclose(np.sqrt(np.diagonal(discs.covariance, axis1=1, axis2=2)), discs.sigmas)
    fitted = np.isfinite(discs.sigmas).all(axis=1)
    assert fitted[discs.usable].all() and np.isinf(discs.sigmas[~fitted]).all()
    assert (discs.sigmas[fitted, 4] <= np.pi / np.sqrt(12) + 1e-9).all()
    scaled = discs.covariance[fitted] / (discs.sigmas[fitted, :, None] * discs.sigmas[fitted, None])
    np.testing.assert_allclose(scaled, scaled.swapaxes(1, 2), atol=1e-6)
    assert (np.linalg.eigvalsh(scaled) > -1e-6).all()


def _assert_no_fit(discs, circles):
    """Where there is no fit, centre and radius are the circle's own."""
    none = np.isinf(discs.chi2)
    np.testing.assert_array_equal(none, np.isinf(discs.sigmas).all(axis=1))
    np.testing.assert_array_equal(discs.centers[none], circles.centers[none])
    np.testing.assert_allclose(discs.radii[none], circles.radii[none])
    assert none[discs.reasons == "radius too small"].all() and not none[discs.accepted].any()


def _assert_on_picture(discs, shape):
    """An accepted ellipse lies on the picture, as far as the last, small step lets it."""
    (a, b), cos, sin = discs.semi_axes.T, np.cos(discs.angles), np.sin(discs.angles)
    reach = np.column_stack([np.hypot(a * cos, b * sin), np.hypot(a * sin, b * cos)])[discs.accepted]
    centers = discs.centers[discs.accepted]
    assert (centers >= reach - 0.1).all() and (centers + reach <= np.array(shape[::-1]) - 1 + 0.1).all()


def _assert_limits(discs, max_chi2=1.5, max_misfit=0.05):
    """An accepted fit shows the disc above the noise, and keeps one of the limits at least."""
    misfit = discs.noises * np.sqrt(np.maximum(discs.chi2 - 1, 0))
    kept = (discs.chi2 <= max_chi2 + 1e-9) | (misfit <= max_misfit * np.abs(discs.contrasts) + 1e-9)
    assert (kept & (np.abs(discs.contrasts) > discs.noises))[discs.accepted].all()


def _check_fit(scene, circles, limits, again, seen):
    """Assert all promises for one picture, and that they are kept `again`; `seen` counts what came of it."""
    before = scene.image.copy()
    discs = fit_discs(scene.image, circles, **limits)
    np.testing.assert_array_equal(scene.image, before)
    _assert_discs(discs, before.shape, circles)
    _assert_limits(discs, **limits)
    if again:
        repeated = fit_discs(before, circles, **limits)
        for name in NAMES:
            np.testing.assert_array_equal(getattr(discs, name), getattr(repeated, name))
    near = len(scene.discs)
    off = np.column_stack([discs.centers, discs.radii])[:near] - scene.discs
    right = discs.accepted[:near] & (np.hypot(*off[:, :2].T) + np.abs(off[:, 2]) < 0.3)
    seen.update(fits=len(discs), accepted=discs.accepted.sum().item(), near=near, right=right.sum().item())
    seen.update(pictures=1, with_accepted=int(discs.accepted.any()), **{"own limits": int(bool(limits))})
    seen.update(discs.reasons.tolist())


LIMITS = st.just({}) | st.fixed_dictionaries(
    {}, optional={"max_chi2": st.floats(0, 10), "max_misfit": st.floats(0, 0.5)}
)


def test_promises_hold_for_any_picture_and_a_fifth_of_the_fits_is_accepted():
    seen = Counter()

    @settings(max_examples=2000, deadline=None, derandomize=True)
    @given(scenes(), SEEDS, st.sampled_from((0, 1, 0, 2)), LIMITS, st.sampled_from((False, False, True)))
    def check(scene, seed, arbitrary, limits, again):
        _check_fit(scene, _random_starts(scene, seed, arbitrary), limits, again, seen)

    check()
    assert seen["pictures"] == 2000 and seen["accepted"] >= 0.2 * seen["fits"], seen
    assert seen["right"] >= 0.15 * seen["near"] and len(set(REASONS) & set(seen)) >= 6, seen
