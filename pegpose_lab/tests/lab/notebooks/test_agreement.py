"""What may differ between two runs, and what may not."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pegpose_lab.lab import animation, figure_digest, plotting
from pegpose_lab.lab.notebooks.agreement import IMAGE_TOLERANCE, files_agree, texts_agree
from pegpose_lab.lab.notebooks.testing import PrintedText


@pytest.mark.parametrize(
    ("stored", "fresh"),
    [
        ("E = 0.0310 px", "E = 0.0311 px"),
        ("-0.000 mm", "0.000 mm"),
        ("1.097e-05", "1.098e-05"),
        ("9.9999e-01", "1.0000e+00"),
        ("47.95,0.1\n", "47.95,0.1001\n"),  # a CSV drops zeros at the end
        ("x  -0.001\ny   9.999\n", "x   0.000\ny  10.000\n"),  # columns widen
        ("<td>0.177</td>", "<td>0.176</td>"),
        (r"0.177 \\", r"0.178 \\"),
        ("\u22120.5 mm", "\u22120.4 mm"),
        ("(0.5, 1.5)", "(0.6, 1.4)"),
        (r"12 & -0 \\", r"12.0001 & 0 \\"),  # LaTeX tables drop zeros, too
    ],
)
def test_last_digits_agree(stored, fresh):
    assert texts_agree(stored, fresh) and texts_agree(fresh, stored)


@pytest.mark.parametrize(
    ("stored", "fresh"),
    [
        ("E = 0.0310 px", "E = 0.0312 px"),
        ("E = 0.0310 px", "E = 0.0310 mm"),
        ("3 of 3 seeds", "2 of 3 seeds"),
        ("12", "12.1001"),
        ("0.177", "-0.177"),
        ("1.097e-05", "1.097e-06"),
        ("0.1 0.2", "0.1"),
        ("0.177", "nan"),
        ("0.5", "1"),
        ("alpha 0.75", "alpha 0.70"),
        ("T_x1.5", "T_x1.4"),  # part of a name
        ("version 1.2.3", "version 1.2.4"),
        ("a\nb", "a b"),
        ("", "0.0"),
    ],
)
def test_everything_else_is_told(stored, fresh):
    assert not texts_agree(stored, fresh) and not texts_agree(fresh, stored)


@given(st.floats(-1e6, 1e6).filter(lambda x: x == 0 or abs(x) > 1e-290), st.integers(0, 8), st.integers(-3, 3))
def test_one_unit_of_the_last_digit_and_no_more(value, digits, steps):
    stored = f"{value:.{digits}e}"
    unit = 10.0 ** (int(stored.partition("e")[2]) - digits)
    fresh = f"{float(stored) + steps * unit:.{digits}e}"
    if digits and fresh.partition("e")[2] == stored.partition("e")[2]:
        assert texts_agree(stored, fresh) == (abs(steps) <= 1)


def test_text_of_an_output_compares_like_its_numbers():
    assert PrintedText("f = 1.25") == "f = 1.26" and not PrintedText("f = 1.25") != "f = 1.26"  # noqa: SIM202
    assert PrintedText("f = 1.25") != "f = 1.27"
    assert PrintedText("f = 1.25") != 1.25


# ---- files ----


def _table(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def test_tables_agree_as_texts(tmp_path):
    first, second = _table(tmp_path / "a.csv", "f\n47.95\n"), _table(tmp_path / "b.csv", "f\n47.96\n")
    assert files_agree(first, second)
    assert not files_agree(first, _table(tmp_path / "c.csv", "f\n47.97\n"))
    assert not files_agree(first, tmp_path / "missing.csv") and not files_agree(tmp_path / "missing.csv", first)


def test_other_files_agree_byte_by_byte(tmp_path):
    assert not files_agree(_table(tmp_path / "a.npy", "1.25"), _table(tmp_path / "b.npy", "1.26"))


def _figure(folder, name, change=lambda ax: None, shift=0.0):
    """A saved figure with one curve, changed before it is saved."""
    fig, ax = plotting.figure()
    x = np.linspace(0, 1, 50)
    ax.plot(x, np.sin(9 * x) + shift, label="curve")
    ax.plot(x, np.cos(9 * x), label="other")
    ax.set(xlabel="x (mm)", ylabel="y (um)", xlim=(0, 1), ylim=(-2, 2), title="E = 0.123 px")
    ax.legend()
    change(ax)
    fig.draw_without_rendering()
    path = folder / f"{name}.png"
    fig.savefig(path, dpi=plotting.DPI, metadata={"Description": figure_digest.figure_digest(fig)})
    plt.close(fig)
    return path


def test_figures_agree_within_what_can_be_seen(tmp_path):
    stored = _figure(tmp_path, "stored")
    assert files_agree(stored, _figure(tmp_path, "bits", shift=1e-9))
    assert files_agree(stored, _figure(tmp_path, "digit", lambda ax: ax.set_title("E = 0.124 px")))


def _swap_legend(ax):
    ax.legend(ax.lines[::-1], [line.get_label() for line in ax.lines])


def test_a_damaged_figure_agrees_with_none(tmp_path):
    stored, damaged = _figure(tmp_path, "stored"), tmp_path / "damaged.png"
    damaged.write_bytes(stored.read_bytes()[:1000])
    assert not files_agree(damaged, stored) and not files_agree(stored, damaged)


FIGURE_FAULTS = {
    "a sign": lambda ax: ax.lines[0].set_ydata(-ax.lines[0].get_ydata()),
    "a unit": lambda ax: ax.set_xlabel("x (um)"),
    "units swapped": lambda ax: ax.set(xlabel="x (um)", ylabel="y (mm)"),
    "a legend swapped": _swap_legend,
    "a limit": lambda ax: ax.set_xlim(0, 1.02),
    "a curve dropped": lambda ax: ax.lines[1].remove(),
    "a title": lambda ax: ax.set_title("E = 0.125 px"),
    "a thicker line": lambda ax: ax.lines[1].set_linewidth(4),  # seen by the pixels only
}


@pytest.mark.parametrize("fault", FIGURE_FAULTS)
def test_a_fault_in_a_figure_is_told(tmp_path, fault):
    assert not files_agree(_figure(tmp_path, "stored"), _figure(tmp_path, "faulty", FIGURE_FAULTS[fault]))


def test_the_image_tolerance_lies_between_noise_and_fault(tmp_path):
    def difference(**other):
        images = [
            plt.imread(_figure(tmp_path, name, **options))[..., :3] for name, options in (("a", {}), ("b", other))
        ]
        return 255 * np.sqrt(np.mean(np.square(images[0] - images[1])))

    assert difference(change=lambda ax: ax.set_title("E = 0.124 px")) < IMAGE_TOLERANCE / 2
    assert difference(change=lambda ax: ax.set_xlabel("")) > 1.5 * IMAGE_TOLERANCE
    assert difference(change=lambda ax: ax.lines[1].remove()) > 1.5 * IMAGE_TOLERANCE


def _animation(folder, name, change=0, **options):
    """A saved animation of two pictures of a bar that moves; `change` grey values are added in every fourth column."""
    pictures = [np.full((40, 60, 3), 94, np.uint8) for _ in range(2)]
    for k, picture in enumerate(pictures):
        picture[:, ::4] += np.uint8(change)
        picture[options.pop("row", 5) : 15, 10 * k : 10 * k + 12] = 230
    path = animation.save_animation(pictures, name, options.pop("text", "x 1.50 mm"), **options)
    return path.rename(folder / f"{name}.gif")


def test_animations_agree_within_a_grey_value(tmp_path, monkeypatch):
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))
    stored = _animation(tmp_path, "stored")
    bits = _animation(tmp_path, "bits", change=1)
    assert stored.read_bytes() != bits.read_bytes() and files_agree(stored, bits)
    assert files_agree(stored, _animation(tmp_path, "digit", text="x 1.51 mm"))


@pytest.mark.parametrize("fault", [{"change": 30}, {"text": "x 1.52 mm"}, {"duration": 80}, {"row": 10}])
def test_a_fault_in_an_animation_is_told(tmp_path, monkeypatch, fault):
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))
    assert not files_agree(_animation(tmp_path, "stored"), _animation(tmp_path, "faulty", **fault))


def test_an_animation_that_lacks_a_frame_or_is_damaged_agrees_with_none(tmp_path, monkeypatch):
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))
    stored, damaged = _animation(tmp_path, "stored"), tmp_path / "damaged.gif"
    short = animation.save_animation([np.full((40, 60, 3), 94, np.uint8)], "short", "x 1.50 mm")
    damaged.write_bytes(stored.read_bytes()[:30])
    for other in (short, damaged):
        assert not files_agree(stored, other) and not files_agree(other, stored)
