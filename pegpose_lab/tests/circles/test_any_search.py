"""What `find_circles` promises of any picture."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pegpose_lab.circles import DETECTION_METHODS, Circles, find_circles
from pegpose_lab.tests.pictures import SEEDS, Scene, scenes


@dataclass(frozen=True)
class _Search:
    """Everything that `find_circles` is given."""

    scene: Scene
    radius_range: tuple
    arguments: dict

    @property
    def method(self):
        return self.arguments.get("method", "multiscale")

    def find(self, image, **changes):
        return find_circles(image, self.radius_range, **(self.arguments | changes))


def _random_search(scene, seed, method, known, others):
    """Ask for the scene's own radii if they are `known`, and change the arguments named in `others`."""
    rng, arguments = np.random.default_rng(seed), {} if method is None else {"method": method}
    radii = scene.discs[:, 2] if known and len(scene.discs) else 10 ** rng.uniform(-3, 3, 1)
    wide = rng.uniform(1.1, 2.5) if known else 1 + 10 ** rng.uniform(-3, 3)
    radius_range = rng.uniform(0.5, 0.95) * radii.min(), min(wide * radii.max(), 9.9e4)
    if method == "accumulator":  # a plane for each whole radius is slow: few, and of less than the picture
        middle = min(radii[0], 100)
        radius_range = middle - min(3, 0.3 * middle), middle + rng.uniform(0.1, 3)
    choices = {
        "polarity": rng.choice(["bright", "dark"]),
        "sensitivity": rng.choice([0.0, 1.0, *rng.uniform(0, 1, 2), *rng.uniform(0.6, 1, 4)]),
        "edge_threshold": rng.choice([0.0, 1.0, *rng.random(4)]),
        "max_circles": rng.integers(1, 4),
        "regions": _random_regions(rng, scene),
    }
    arguments |= {"polarity": scene.polarity} | {name: choices[name] for name in others}
    return _Search(scene, radius_range, arguments)


def _random_regions(rng, scene):
    """Up to five boxes around discs, anywhere, outside, empty, even with negative sizes."""
    x, y, r = scene.discs.T
    around = np.column_stack([x - r, y - r, 2 * r, 2 * r])
    anywhere = rng.uniform(-100, 250, (2, 4)) * rng.choice([0, 1, 1, 1000], (2, 1))
    return rng.permutation(np.concatenate([around, anywhere]))[: rng.integers(0, 6)]


OTHERS = ("polarity", "sensitivity", "edge_threshold", "max_circles", "regions")
SEARCHES = st.builds(
    _random_search,
    scenes(masks=1),
    SEEDS,
    method=st.sampled_from((None, None, *DETECTION_METHODS)),
    known=st.sampled_from((True, True, True, True, False)),
    others=st.just([]) | st.just([]) | st.lists(st.sampled_from(OTHERS), min_size=1, max_size=2, unique=True),
)


def _assert_circles(found, search):
    """What `Circles` and `find_circles` promise of every result."""
    n, (height, width) = len(found), search.scene.image.shape
    assert found.centers.shape == (n, 2) and found.radii.shape == found.scores.shape == (n,)
    assert found.centers.dtype == found.radii.dtype == found.scores.dtype == float
    assert (found.centers >= 0).all() and (found.centers <= (width - 1, height - 1)).all()
    assert (found.radii >= search.radius_range[0]).all() and (found.radii <= search.radius_range[1]).all()
    assert (found.scores >= _least_score(search) - 1e-6).all() and np.isfinite(found.scores).all()
    order = [(-score, y, x) for score, (x, y) in zip(found.scores, found.centers, strict=True)]
    assert order == sorted(order)
    apart = np.hypot(*(found.centers[:, None] - found.centers).T) + abs(found.radii[:, None] - found.radii)
    near = np.maximum(3, 0.15 * np.minimum(found.radii[:, None], found.radii))
    assert (apart >= near - 1e-9)[~np.eye(n, dtype=bool)].all()


def _least_score(search):
    sensitivity = search.arguments.get("sensitivity", 0.85)
    if search.method == "multiscale":
        return 1.55 - sensitivity
    return 1 - sensitivity / 2 if search.method == "accumulator" else 1 - sensitivity


def _assert_same(found, expected):
    for name in ("centers", "radii", "scores"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def _hits(found, discs):
    """The number of discs that a circle lies on, to 10 % of the radius and 1 px."""
    apart = np.hypot(*(found.centers[:, None] - discs[:, :2]).T) + abs(found.radii[:, None] - discs[:, 2]).T
    return (apart.min(axis=1, initial=np.inf) < 0.1 * discs[:, 2] + 1).sum()


def _inside_regions(found, regions, r_max):
    """Which centres lie in a box, grown by the margin and rounded to whole pixels."""
    margin, (x, y, width, height) = r_max / 4 + 5, np.reshape(regions, (-1, 4)).T
    across, down = found.centers.T[..., None]
    inside = (x - margin <= across) & (across <= x + width + margin)
    return (inside & (y - margin <= down) & (down <= y + height + margin)).any(axis=1)


def _check_search(search, seen):
    """Assert all promises for one search; `seen` counts what it was like."""
    image, before = search.scene.image, search.scene.image.copy()
    found = search.find(image)
    np.testing.assert_array_equal(image, before)
    _assert_circles(found, search)
    most = search.arguments.get("max_circles")
    everything = search.find(before, max_circles=None)
    _assert_same(found, Circles(*(getattr(everything, name)[:most] for name in ("centers", "radii", "scores"))))
    if "regions" in search.arguments:  # which may be none
        assert _inside_regions(found, search.arguments["regions"], search.radius_range[1]).all()
    seen[search.method, "searches"] += 1
    seen[search.method, "with circles"] += len(found) > 0
    seen[search.method, "with true circles"] += bool(_hits(found, search.scene.discs))
    for name in search.arguments:
        seen[name, "with circles"] += len(found) > 0
    seen["max_circles", "at work"] += len(everything) > len(found)


def test_promises_hold_for_any_picture_and_a_quarter_of_them_has_circles():
    seen = Counter()

    @settings(max_examples=2000, deadline=None, derandomize=True)
    @given(SEARCHES)
    def check(search):
        _check_search(search, seen)

    check()
    assert sum(seen[method, "searches"] for method in DETECTION_METHODS) > 1900, seen
    for method in DETECTION_METHODS:
        assert seen[method, "with circles"] >= 0.25 * seen[method, "searches"], seen
        assert seen[method, "with true circles"] >= 0.1 * seen[method, "searches"], seen
    assert min(seen[name, "with circles"] for name in OTHERS) > 20 and seen["max_circles", "at work"] > 5, seen
