"""The explorer for the genetic algorithm: its population on a map of the objective."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import ipywidgets
import numpy as np
from matplotlib import colormaps

from ...calibration import PENALTY, minimize_genetic
from .. import plotting
from ..style import COLORS
from .drawing import DPI, _bgr, _charted
from .explorer import SHOWN_WIDTH, Explorer, _slider

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

HEIGHT = 480  # px, height of the image


def genetic_explorer(
    objective: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    bounds: ArrayLike,
    *,
    search: Callable[..., NDArray[np.float64]] | None = None,
    generations: int = 100,
) -> Explorer:
    """Sliders for the genetic algorithm (Eqs. 4-10): its population on a map of the objective over (f, T_z).

    Parameters
    ----------
    objective : callable
        Maps chromosomes (n, 2), columns f and T_z in mm, to the mean distance (n,) in px.
    bounds : (2, 2) array_like
        Lower and upper bound of f and of T_z, mm (Eq. 5).
    search : callable, optional
        ``search(population_size=, alpha=, generations=, rng=)`` returns every generation's chromosomes
        (generations + 1, population_size, 2); by default `minimize_genetic` over `bounds`.
    generations : int
        Number of generations.

    Returns
    -------
    Explorer
        Controls ``population``, ``alpha``, ``seed``, ``generation``.
    """
    valley = _Valley(objective, bounds)

    @lru_cache(maxsize=32)
    def run(population, alpha, seed):
        options = {"population_size": population, "alpha": alpha, "generations": generations, "rng": seed}
        if search is not None:
            return np.asarray(search(**options))
        return minimize_genetic(objective, bounds, keep_populations=True, **options).populations

    def draw(picture, population, alpha, seed, generation):
        chromosomes = run(population, alpha, seed)[generation]
        values = objective(chromosomes)
        best = np.argmin(values)
        valley.draw(picture, chromosomes, best)
        f, t_z = chromosomes[best]
        return (
            f"generation {generation} of {generations}: mean distance of the best {values[best]:.4f} px, "
            f"median {np.median(values):.4f} px;\nbest f = {f:.3f} mm, T_z = {t_z:.3f} mm"
        )

    return Explorer(
        "genetic explorer",
        lambda **_: valley.background,
        draw,
        {
            "population": _slider(ipywidgets.IntSlider, "population", 60, 10, 200, step=10),
            "alpha": _slider(ipywidgets.FloatSlider, "alpha (Eq. 9)", 0.75, 0.0, 1.5, step=0.05),
            "seed": _slider(ipywidgets.IntSlider, "seed", 0, 0, 99),
            "generation": _slider(ipywidgets.IntSlider, "generation", min(5, generations), 0, generations),
        },
    )


# ---- the valley ----


class _Valley:
    """The objective over its box as an image with axes, which is drawn once."""

    def __init__(self, objective, bounds):
        self.f, self.t_z = np.asarray(bounds, float)
        fig, self.ax = plotting.figure(SHOWN_WIDTH / DPI, HEIGHT / DPI)
        self.ax.set(xlabel="focal length f (mm)", ylabel="$T_z$ (mm)")
        look = {"cmap": colormaps["cividis"].with_extremes(bad="0.9"), "aspect": "auto", "interpolation": "bilinear"}
        self.ax.imshow(self._heights(objective), extent=(*self.f, *self.t_z), origin="lower", **look)
        self.background = _charted(fig, HEIGHT)

    def _heights(self, objective, columns=175, rows=105):
        """log10 of the objective on a grid, masked where a point of the view has no image."""
        f, t_z = np.meshgrid(np.linspace(*self.f, columns), np.linspace(*self.t_z, rows))
        values = objective(np.column_stack([f.ravel(), t_z.ravel()])).reshape(f.shape)
        return np.ma.masked_array(np.log10(np.maximum(values, 1e-12)), values >= PENALTY)

    def place(self, chromosome):
        """Pixel (x, y) of (f, T_z)."""
        x, y = self.ax.transData.transform(chromosome)
        return np.array([x, HEIGHT - y]) - 0.5

    def draw(self, picture, chromosomes, best):
        """Draw a population as dots, with a ring around the best one."""
        for index, chromosome in enumerate(chromosomes):
            place = np.rint(16 * self.place(chromosome)).astype(int).tolist()
            cv2.circle(picture, place, 16 * 3, _bgr(COLORS["genetic"]), -1, cv2.LINE_AA, 4)
            if index == best:
                cv2.circle(picture, place, 16 * 8, (255, 255, 255), 2, cv2.LINE_AA, 4)
