"""What is stored of the photographs of real parts: rings found, places right, labels kept."""

import numpy as np

from pegpose_lab.study import load_measured, real_rings


def test_every_ring_is_found_and_no_place_is_wrong():
    rings, places = load_measured("real_rings"), load_measured("real_ring_places")
    assert len(rings) == 6 and rings["found"].all() and (rings["wrong"] == 0).all()
    counts = places.groupby("picture", sort=False)["state"].value_counts().unstack(fill_value=0)
    for state in ("measured", "partial", "contradicted"):
        assert counts.get(state, 0 * rings.index).tolist() == rings[state].tolist()
    contradicted = places["state"] == "contradicted"
    assert (places.loc[contradicted, "sigma"] > places.loc[~contradicted, "sigma"].median()).all()
    assert all("place-contradicted" in said for said in rings.loc[rings["contradicted"] > 0, "said"])


def test_the_target_is_found_in_every_frame():
    runs = load_measured("real_ring_runs")
    assert runs["frames"].sum() == 44 and (runs["located"] == runs["frames"]).all()
    assert runs["noise"].dropna().max() <= 0.035 and runs["crossing"].max() <= 0.07
    assert runs["labels_kept"].dropna().eq(1).all()


def test_diagonals_cross_where_they_should():
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    assert real_rings._crossing(square) == (1.0, 1.0)
    kite = np.array([[0.0, 0.0], [1.0, -1.0], [4.0, 0.0], [1.0, 1.0]])
    np.testing.assert_allclose(real_rings._crossing(kite), (1.0, 0.0), atol=1e-12)


def test_patterns_follow_from_the_marks():
    turn = 2 * np.pi * np.arange(5) / 5
    whole = {
        "centers": 100 + 40 * np.column_stack([np.cos(turn), np.sin(turn)]),
        "radii": [8.0] * 5,
        "n": 5,
        "polarity": "mixed",
    }
    pattern = real_rings._pattern(whole)
    assert pattern.n_places == 5 and pattern.polarity == "either" and abs(pattern.scale - 40) < 1
    part = real_rings._pattern(whole | {"centers": whole["centers"][:4], "n": 5, "polarity": "dark"})
    assert part.n_places == 4 and part.polarity == "dark"
    apart = np.linalg.norm(np.diff(part.places[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(apart, 80 * np.sin(np.pi / 5), rtol=1e-9)
