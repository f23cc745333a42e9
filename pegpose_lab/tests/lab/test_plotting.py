"""Figures: the same bytes each time, whole files only, and artists that hold the data they were given."""

import base64
import io
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Circle, Ellipse
from matplotlib.quiver import QuiverKey
from numpy.testing import assert_allclose
from PIL import Image

from pegpose_lab.lab import plotting


@pytest.fixture
def axes():
    fig, ax = plotting.figure()
    yield ax
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fig.canvas.draw()
    plt.close(fig)


@pytest.fixture
def output(tmp_path, monkeypatch):
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))
    return tmp_path / "figures"


def make_figure(seed=0):
    fig, ax = plotting.figure()
    plotting.plot_error_scatter(ax, np.random.default_rng(seed).normal(size=(50, 2)), label="genetic", limit=2.0)
    return fig


# ---- files ----


def test_same_figure_gives_same_bytes(output):
    contents = []
    for _ in range(2):
        fig = make_figure()
        plotting.save_figure(fig, "fig07_scatter")
        plt.close(fig)
        contents.append([(output / f"fig07_scatter.{kind}").read_bytes() for kind in ("png", "pdf")])
    assert contents[0] == contents[1]
    png, pdf = contents[0]
    assert png.startswith(b"\x89PNG") and pdf.startswith(b"%PDF")
    assert b"CreationDate" not in pdf and b"Software" not in png


def test_saving_one_figure_again_gives_same_bytes(output):
    fig = make_figure()
    contents = []
    for name in ("fig_first", "fig_second"):
        plotting.save_figure(fig, name)
        contents.append([(output / f"{name}.{kind}").read_bytes() for kind in ("png", "pdf")])
    plt.close(fig)
    assert contents[0] == contents[1]


def test_only_the_papers_figures_are_written_as_pdf(output):
    fig = make_figure()
    for name in ("fig07_scatter", "07_more"):
        plotting.save_figure(fig, name)
    plt.close(fig)
    names = sorted(path.name for path in output.iterdir())
    assert names == ["07_more.png", "fig07_scatter.pdf", "fig07_scatter.png"]


def test_other_data_give_other_bytes(output):
    pictures = []
    for seed in (0, 1):
        fig = make_figure(seed)
        plotting.save_figure(fig, "fig07_scatter")
        plt.close(fig)
        pictures.append([(output / f"fig07_scatter.{kind}").read_bytes() for kind in ("png", "pdf")])
    assert pictures[0][0] != pictures[1][0] and pictures[0][1] != pictures[1][1]


@pytest.mark.parametrize("kind", ["png", "pdf"])
def test_an_interrupted_save_leaves_the_old_file(kind, output):
    fig = make_figure()
    plotting.save_figure(fig, "fig07_scatter")
    before = {path.name: path.read_bytes() for path in output.iterdir()}
    write = fig.savefig

    def interrupted(path, **options):
        if options["format"] == kind:
            path.write_bytes(b"half a file")
            raise KeyboardInterrupt
        write(path, **options)

    fig.savefig = interrupted
    with pytest.raises(KeyboardInterrupt):
        plotting.save_figure(fig, "fig07_scatter")
    plt.close(fig)
    assert {path.name: path.read_bytes() for path in output.iterdir()} == before


# ---- in a notebook ----


def test_what_is_shown_is_what_is_saved(output, monkeypatch):
    shown = []
    monkeypatch.setattr(plotting, "display", lambda data, **options: shown.append((data, options)))
    fig = make_figure()
    plotting.show_figure(fig, "07_scatter", "A cloud of points")
    assert not plt.fignum_exists(fig.number)
    ((data, options),) = shown
    content = base64.b64decode(data["image/png"])
    assert content == (output / "07_scatter.png").read_bytes()
    assert data["text/plain"].startswith("figures/07_scatter.png\nfigure: 7 x 3.6 in\naxes 1\n")
    assert options["metadata"] == {"image/png": {"width": 700, "height": 360, "alt": "A cloud of points"}}
    with Image.open(io.BytesIO(content)) as image:
        assert image.size == (7 * plotting.DPI, round(3.6 * plotting.DPI))
        assert data["text/plain"].endswith(image.info["Description"])


def test_the_digest_tells_where_a_label_beside_a_point_is_saved(output, monkeypatch):
    shown = []
    monkeypatch.setattr(plotting, "display", lambda data, **options: shown.append(data["text/plain"]))
    fig, ax = plotting.figure()
    ax.set(xlim=(0, 1), ylim=(0, 1))
    ax.annotate("peg 1", (0.5, 0.25), xytext=(0, 0), textcoords="offset points")
    plotting.show_figure(fig, "07_scatter", "A cloud of points")
    assert "text 'peg 1' at 0.500 0.250" in shown[0]


# ---- style ----


def test_colors_are_distinct_and_readable():
    assert len({to_hex(color) for color in plotting.COLORS.values()}) == len(plotting.COLORS)
    assert {"paper", "truth", "linear", "genetic", "zhang", "joint", "oracle", "measured"} <= set(plotting.COLORS)


def test_figure_has_the_style():
    fig, axes = plotting.figure(6.0, 3.0, rows=2, columns=3)
    assert axes.shape == (2, 3) and tuple(fig.get_size_inches()) == (6.0, 3.0)
    assert not axes[0, 0].spines["top"].get_visible() and fig.get_layout_engine() is not None
    plt.close(fig)


# ---- plots ----


def test_dark_images_are_shown_brighter():
    fig, (dark, bright) = plotting.figure(6.0, 3.0, 1, 2)
    plotting.plot_image(dark, np.full((8, 8), 165, np.uint8))
    plotting.plot_image(bright, np.full((8, 8), 192, np.uint8))
    assert dark.images[0].get_clim() == (0, 191) and bright.images[0].get_clim() == (0, 255)
    plt.close(fig)


def test_residual_arrows_have_a_key_of_their_scale():
    fig, ax = plotting.figure()
    plotting.plot_residuals(ax, np.array([[1.0, 1.0], [5.0, 4.0]]), np.array([[0.003, 0.0], [0.0, 0.0042]]))
    (key,) = (child for child in ax.get_children() if isinstance(child, QuiverKey))
    assert key.U == 0.004 and key.text.get_text() == "0.004 px"
    plt.close(fig)


def test_image(axes):
    image = np.arange(60, dtype=np.uint8).reshape(6, 10)
    plotting.plot_image(axes, image, "a title")
    assert np.array_equal(axes.images[0].get_array(), image)
    assert axes.images[0].get_clim() == (0, 63)
    assert axes.get_title() == "a title" and "px" in axes.get_xlabel()


def test_image_has_y_down_and_pixel_centres_at_whole_numbers(axes):
    plotting.plot_image(axes, np.zeros((6, 10), np.uint8))
    assert axes.get_xlim() == (-0.5, 9.5) and axes.get_ylim() == (5.5, -0.5)


def test_only_the_part_within_limits_is_drawn(axes):
    image = np.arange(120, dtype=np.uint8).reshape(10, 12)
    plotting.plot_image(axes, image, limits=(3, 6.5, 2, 5))
    shown = axes.images[0]
    assert_allclose(shown.get_array(), image[2:6, 3:8])
    assert_allclose(shown.get_extent(), [2.5, 7.5, 5.5, 1.5])
    assert (axes.get_xlim(), axes.get_ylim()) == ((3, 6.5), (5, 2))


def test_mask(axes):
    mask = np.zeros((8, 9), bool)
    mask[[2, 4, 4], [3, 4, 6]] = True
    plotting.plot_image(axes, np.zeros((8, 9), np.uint8))
    plotting.plot_mask(axes, mask, color="#0072B2", label="parts", alpha=0.5)
    layer, part = axes.images[1].get_array(), mask[2:5, 3:7]
    assert_allclose(layer[part], [[0, 0x72 / 255, 0xB2 / 255, 0.5]] * 3)
    assert (layer[~part] == 0).all()
    assert_allclose(axes.images[1].get_extent(), [2.5, 6.5, 4.5, 1.5])
    assert axes.get_legend_handles_labels()[1] == ["parts"]
    plotting.plot_mask(axes, np.zeros((8, 9), bool), color="#0072B2")
    assert len(axes.images) == 2


@pytest.mark.parametrize("count", [1, 4])
def test_circles(count, axes):
    rng = np.random.default_rng(count)
    centers, radii = rng.uniform(0, 100, (count, 2)), rng.uniform(3, 9, count)
    plotting.plot_circles(axes, centers, radii)
    circles = [patch for patch in axes.patches if isinstance(patch, Circle)]
    assert_allclose([circle.center for circle in circles], centers)
    assert_allclose([circle.radius for circle in circles], radii)
    assert_allclose(axes.lines[0].get_xydata(), centers)


def test_ellipses(axes):
    centers, semi_axes, angles = np.array([[10.0, 20.0]]), np.array([[8.0, 5.0]]), np.array([0.3])
    plotting.plot_ellipses(axes, centers, semi_axes, angles)
    (ellipse,) = (patch for patch in axes.patches if isinstance(patch, Ellipse))
    drawn = (*ellipse.center, ellipse.width, ellipse.height, ellipse.angle)
    assert_allclose(drawn, (10, 20, 16, 10, np.rad2deg(0.3)))
    tip = ellipse.get_patch_transform().transform([(1.0, 0.0)])[0]
    assert_allclose(tip - centers[0], 8.0 * np.array([np.cos(0.3), np.sin(0.3)]))  # from x towards y


def test_residuals(axes):
    points, residuals = np.array([[10.0, 20], [30, 40]]), np.array([[0.01, 0.02], [-0.03, 0.04]])
    plotting.plot_residuals(axes, points, residuals, scale=100.0, image_size=(160, 120))
    (arrows,) = axes.collections
    assert_allclose(arrows.XY, points)
    assert_allclose(np.column_stack([arrows.U, arrows.V]), residuals)
    assert arrows.scale == pytest.approx(1 / 100.0) and arrows.angles == arrows.scale_units == "xy"
    assert "longest 0.050 px" in axes.get_title()
    assert axes.get_ylim() == (120, 0)


def test_convergence(axes):
    histories = [pd.DataFrame({"generation": [0, 1, 2], "best": [1.0, 0.5, 0.2 + seed]}) for seed in range(3)]
    plotting.plot_convergence(axes, histories, label="genetic", color="#D55E00", floor=0.1)
    for line, history in zip(axes.lines, histories, strict=False):
        assert_allclose(line.get_xydata(), history[["generation", "best"]])
    assert axes.lines[3].get_ydata()[0] == 0.1
    assert axes.get_legend_handles_labels()[1] == ["genetic", "optimum in the box"]
    assert axes.get_yscale() == "log"


def test_map(axes):
    x, y = np.linspace(-50, 50, 11), np.linspace(-20, 20, 5)
    filled = plotting.plot_map(axes, x, y, x + 10 * y[:, None])
    assert filled.levels[0] <= -250 and filled.levels[-1] >= 250
    assert axes.get_xlim() == (-50, 50) and axes.get_ylim() == (-20, 20) and axes.get_aspect() == 1


def test_error_scatter(axes):
    residuals = np.random.default_rng(0).normal(0, 0.03, (40, 2))
    plotting.plot_error_scatter(axes, residuals, limit=0.5)
    assert_allclose(axes.lines[0].get_xydata(), residuals)
    assert axes.patches[0].radius == 0.5 and axes.get_aspect() == 1.0


def test_dots(axes):
    values = {"linear": [0.3, 0.2], "zhang": [0.05, 0.06]}
    plotting.plot_dots(
        axes, ["view 1", "view 2"], values, colors=plotting.COLORS, unit="px", printed=[0.31], logarithmic=True
    )
    for line, (method, numbers) in zip(axes.lines, values.items(), strict=False):
        assert_allclose(line.get_xdata(), numbers)
        assert_allclose(line.get_ydata(), [0, 1], atol=0.2)
        assert line.get_color() == plotting.COLORS[method] and line.get_label() == method
    assert axes.lines[0].get_ydata()[0] < axes.lines[1].get_ydata()[0]
    assert axes.lines[2].get_xdata()[0] == 0.31 and [text.get_text() for text in axes.texts] == ["0.31"]
    assert axes.yaxis_inverted() and axes.get_xscale() == "log" and axes.get_xlabel() == "px"


def test_profiles(axes):
    x, values = np.linspace(0, 1, 5), {"linear": np.arange(5.0), "genetic": np.ones(5)}
    plotting.plot_profiles(axes, x, values, colors=plotting.COLORS, xlabel="f (mm)", ylabel="E (px)")
    for line, (method, numbers) in zip(axes.lines, values.items(), strict=False):
        assert_allclose(line.get_xydata(), np.column_stack([x, numbers]))
        assert line.get_color() == plotting.COLORS[method] and line.get_label() == method
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("f (mm)", "E (px)")


def test_quadrilateral(axes):
    corners = np.array([[10.0, 10], [90, 12], [88, 92], [12, 90]])
    for _ in range(2):
        plotting.plot_quadrilateral(axes, corners, color="k", lengths=["a", "b", "c", "d"])
    assert_allclose(axes.lines[0].get_xydata(), corners[[0, 1, 2, 3, 0]])
    assert axes.yaxis_inverted()
    places = {text.get_text(): text.xy for text in axes.texts}
    assert places["a"][1] < places["c"][1] and places["d"][0] < places["b"][0]


def test_block_means(axes):
    table = pd.DataFrame({"first_frame": [1, 11], "last_frame": [10, 35], "mean_mm": [0.5, -0.2], "sd_mm": [0.4, 0.5]})
    plotting.plot_block_means(axes, table)
    (container,) = axes.containers
    assert_allclose(container.lines[0].get_xydata(), [[5.5, 0.5], [23, -0.2]])
    across, along = (np.array(bars.get_segments()) for bars in container.lines[2])
    assert_allclose(across[:, 1, 0] - across[:, 0, 0], [9, 24])
    assert_allclose(along[:, 1, 1] - along[:, 0, 1], [0.8 / np.sqrt(10), 0.2])
