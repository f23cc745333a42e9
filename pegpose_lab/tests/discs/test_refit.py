"""Discs of which parts are covered or unevenly lit."""

import numpy as np

from pegpose_lab.discs import fit, fit_discs, ground
from pegpose_lab.tests.discs.stacks import SHAPE, R, _circles, _measure, _near, _stack, _truth
from pegpose_lab.tests.pictures import center_bound, draw_ellipses, to_uint8


def _with_wall(rng, noise):
    """Discs with a wall 12 grey values above the base on one side, and a slope over the base."""
    truth = _truth(rng)
    walls = truth + [-6, -3, 0, 0, 0]
    base = draw_ellipses(SHAPE, walls, background=60, level=72)
    base += np.linspace(0, 10, SHAPE[1])
    share = draw_ellipses(SHAPE, truth, background=0, level=1)
    return truth, to_uint8(base + share * (160 - base), noise, rng)


def test_side_walls_are_fitted_by_sectors(monkeypatch):
    rng = np.random.default_rng(11)
    truth, image = _with_wall(rng, 2)
    circles = _near(truth, rng)

    def rms_and_scaled():
        discs = fit_discs(image, circles)
        errors = discs.centers - truth[:, :2]
        return np.sqrt((errors**2).mean()), np.sqrt(((errors / discs.sigmas[:, :2]) ** 2).mean()), discs

    rms, scaled, discs = rms_and_scaled()
    assert discs.accepted.all() and rms < 0.03 and scaled < 1.5
    monkeypatch.setattr(fit, "REFIT_SIGMAS", np.inf)
    monkeypatch.setattr(ground, "GROUND_SIGMAS", np.inf)
    assert rms_and_scaled()[0] > 5 * rms


def test_a_bar_over_the_edge_moves_the_center_little():
    rng = np.random.default_rng(5)
    picture = draw_ellipses((140, 140), [(70.2, 69.7, R, R, 0)])
    picture[60:75, :40] = 110
    discs = fit_discs(to_uint8(picture, 2, rng), _circles([(70, 70)], [R]))
    error = discs.centers[0] - (70.2, 69.7)
    assert discs.accepted[0] and np.hypot(*error) < 0.03
    assert (np.abs(error) < 4 * discs.sigmas[0, :2]).all()


def test_an_arc_is_enough_and_too_short_an_arc_is_refused():
    """What lies right of a column is hidden by a bar of the background's own level."""
    results = []
    for column in (95, 40):
        picture = draw_ellipses((140, 140), [(70.2, 69.7, R, R, 0)])
        picture[:, column:] = 60
        results.append(fit_discs(to_uint8(picture, 2, 1), _circles([(70, 70)], [R])))
    arc, little = results
    error = np.abs(arc.centers[0] - (70.2, 69.7))
    assert arc.accepted[0] and error.max() < 0.1 and (error < 4 * arc.sigmas[0, :2]).all()
    assert not little.accepted[0]


def test_sectors_cost_little_where_nothing_is_wrong(monkeypatch):
    monkeypatch.setattr(fit, "REFIT_SIGMAS", -1e9)
    truth, discs = _measure(5, pictures=6)
    errors = _stack(discs, "centers") - truth[:, :2]
    assert np.sqrt((errors**2).mean()) < 1.3 * center_bound(R, 100, 0.9, 5)
    assert 0.8 < np.sqrt(((errors / _stack(discs, "sigmas")[:, :2]) ** 2).mean()) < 1.3
