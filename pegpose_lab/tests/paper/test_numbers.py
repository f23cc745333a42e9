"""The printed numbers, and what follows from them alone."""

import numpy as np
import pytest

from pegpose_lab.paper import numbers


def test_every_id_is_unique_and_every_row_is_complete():
    table = numbers.printed_numbers()
    assert len(table) >= 60
    assert table.index.is_unique
    assert (table[["where", "quantity", "printed"]] != "").all(axis=None)
    assert np.isfinite(table["value"]).all()


def test_printed_text_and_value_agree():
    for identifier, row in numbers.printed_numbers().iterrows():
        assert numbers.printed(identifier) == float(row["printed"]) == row["value"]


def test_callers_cannot_change_the_numbers():
    table = numbers.printed_numbers()
    table.loc[:, "value"] = 0.0
    assert numbers.printed("T1-ga.f") == 47.95


@pytest.mark.parametrize("identifier", ["", "T1-ga.F", "t2.x1", None, 3])
def test_unknown_id_is_refused(identifier):
    with pytest.raises(ValueError, match="identifier is .*expected an id such as"):
        numbers.printed(identifier)


def test_unknown_id_names_the_nearest():
    with pytest.raises(ValueError, match="T1-ga.kappa1"):
        numbers.printed("T1-ga.kapa1")


def test_table1_against_the_paper():
    table = numbers.table1().set_index("stage")
    assert table.loc["linear"].tolist() == [54.74, -945.2, 663.51, 308.52, 0.0]
    assert table.loc["genetic"].tolist() == [47.95, -945.2, 663.51, 267.38, 1.097e-5]
    assert table.columns.tolist() == ["f", "t_x", "t_y", "t_z", "kappa1"]


def test_rotation_is_nearly_orthonormal_and_tilted_as_read():
    rotation = numbers.table1_rotation()
    assert rotation.tolist() == [[0.999, 0.004, 0.034], [-0.011, 0.979, 0.203], [-0.032, -0.203, 0.978]]
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() == pytest.approx(1.3e-3, abs=2e-4)
    tilt = np.rad2deg(np.arctan2(-rotation[1, 2], rotation[2, 2]))
    assert abs(tilt) == pytest.approx(11.7, abs=0.05)


def test_both_stages_share_rotation_and_t_x_t_y():
    table = numbers.table1()
    assert table["t_x"].nunique() == table["t_y"].nunique() == 1


def test_table2_against_the_paper():
    table = numbers.table2()
    assert table["peg"].tolist() == [1, 2, 3, 4]
    assert table.iloc[0, 1:].tolist() == [140.064, 127.673, 28.993, 26.428]
    assert table.iloc[2, 1:].tolist() == [506.212, 421.383, 104.785, 87.226]


def test_one_scale_gives_all_eight_metric_coordinates_to_their_last_digit():
    table = numbers.table2()
    pixels, metric = table[["x_px", "y_px"]].to_numpy(), table[["x_mm", "y_mm"]].to_numpy()
    assert np.array_equal(np.round(numbers.mm_per_pixel() * pixels, 3), metric)
    assert round(numbers.mm_per_pixel(), 5) == 0.207


def test_the_rounded_scale_gives_seven_of_eight_and_the_eighth_within_its_last_digit():
    table = numbers.table2()
    pixels, metric = table[["x_px", "y_px"]].to_numpy(), table[["x_mm", "y_mm"]].to_numpy()
    difference = np.round(np.round(0.207 * pixels, 3) - metric, 3)
    assert np.count_nonzero(difference) == 1
    assert difference[2, 0] == 0.001


def test_the_scale_is_the_least_squares_solution():
    table = numbers.table2()
    pixels, metric = table[["x_px", "y_px"]].to_numpy().ravel(), table[["x_mm", "y_mm"]].to_numpy().ravel()
    oracle = np.linalg.lstsq(pixels[:, None], metric, rcond=None)[0][0]
    assert numbers.mm_per_pixel() == pytest.approx(oracle, rel=1e-14)


def test_opposite_sides_of_table2_agree_on_the_screen():
    """Opposite sides of the four printed pegs agree to 0.3 %: a tilted plane would show here."""
    pegs = numbers.table2()[["x_px", "y_px"]].to_numpy()
    sides = np.linalg.norm(np.roll(pegs, -1, axis=0) - pegs, axis=1)
    assert np.abs(sides[:2] / sides[2:] - 1).max() < 0.003
    assert sides.std() / sides.mean() < 0.0035


def test_table3_against_the_paper():
    table = numbers.table3()
    assert table["first_frame"].tolist() == [1, 11, 21, 31]
    assert table["last_frame"].tolist() == [10, 20, 30, 45]
    assert table["mean_mm"].tolist() == [0.677, 0.206, -0.171, -0.431]
    assert table["sd_mm"].tolist() == [0.689, 0.333, 0.259, 0.463]
    assert (table["radius_mm"] == 10.1).all()
    assert table["last_frame"].iloc[-1] == numbers.printed("setup.frames")


def test_setup_against_the_paper():
    assert numbers.image_size() == (1600, 1200)
    names = ["fps", "distance_m", "corner_rows", "corner_columns", "pitch", "orientations", "lens", "frames"]
    assert [numbers.printed(f"setup.{name}") for name in names] == [10, 0.27, 6, 8, 29, 5, 50, 45]
    assert numbers.corner_count() == 240


def test_errors_against_the_paper():
    names = ["E-rms", "E-zhang", "F6.percent", "F6.limit", "F7.range", "acc", "bounds", "alpha"]
    assert [numbers.printed(name) for name in names] == [0.031, 0.37, 57, 0.03, 0.5, 1, 25, 0.75]


def test_kappa1_in_pixels_would_stretch_the_corner_twelvefold():
    assert numbers.corner_stretch() == pytest.approx(1 + 1.097e-5 * (800**2 + 600**2), rel=1e-12)
    assert numbers.corner_stretch() > 10
