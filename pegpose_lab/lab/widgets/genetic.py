"""The explorer of the genetic algorithm: its population on the valley of its objective."""

from functools import lru_cache

import cv2
import ipywidgets
import numpy as np

from ...calibration import PENALTY, minimize_genetic
from ..plotting import COLORS
from .drawing import _bgr
from .explorer import FONT, SHOWN_WIDTH, Explorer, _slider


def genetic_explorer(objective, bounds, *, search=None, generations=100):
    """Sliders for the genetic algorithm (Eqs. 4-10): its population on the valley of the objective in (f, T_z).

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
        How many are run.

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
        return (f"generation {generation} of {generations}: mean distance of the best {values[best]:.4f} px, "
                f"median {np.median(values):.4f} px;\nbest f = {f:.3f} mm, T_z = {t_z:.3f} mm")

    return Explorer("genetic explorer", lambda **_: valley.background, draw, {
        "population": _slider(ipywidgets.IntSlider, "population", 60, 10, 200, step=10),
        "alpha": _slider(ipywidgets.FloatSlider, "alpha (Eq. 9)", 0.75, 0.0, 1.5, step=0.05),
        "seed": _slider(ipywidgets.IntSlider, "seed", 0, 0, 99),
        "generation": _slider(ipywidgets.IntSlider, "generation", min(5, generations), 0, generations),
    })


# ---- the valley ----


class _Valley:
    """The objective over its box as a picture with axes, drawn once."""

    left, right, top, bottom = 80, 20, 16, 44  # px round the plot
    height = 480

    def __init__(self, objective, bounds):
        self.bounds = np.asarray(bounds, float)
        self.size = np.array([SHOWN_WIDTH - self.left - self.right, self.height - self.top - self.bottom])
        self.background = np.full((self.height, SHOWN_WIDTH, 3), 255, np.uint8)
        self._fill(objective)
        self._draw_axes()

    def place(self, chromosome):
        """Pixel (x, y) of (f, T_z); T_z grows upwards."""
        x, y = (chromosome - self.bounds[:, 0]) / np.ptp(self.bounds, axis=1)
        return np.array([self.left + x * (self.size[0] - 1), self.top + (1 - y) * (self.size[1] - 1)])

    def _fill(self, objective, columns=175, rows=105):
        """Colours of log10 of the objective on a grid; grey where a point of the view has no image."""
        f = np.linspace(*self.bounds[0], columns)
        depths = np.linspace(*self.bounds[1][::-1], rows)
        values = np.array([objective(np.column_stack([f, np.full(columns, t_z)])) for t_z in depths])
        seen = values < PENALTY
        height = np.log10(np.clip(values, 1e-12, values[seen].max(initial=1e-12)))
        grey = ((height - height.min()) / max(np.ptp(height), 1e-9) * 255).astype(np.uint8)
        color = cv2.applyColorMap(cv2.resize(grey, self.size.tolist()), cv2.COLORMAP_CIVIDIS)
        color[cv2.resize(seen.astype(np.uint8), self.size.tolist(), interpolation=cv2.INTER_NEAREST) == 0] = 230
        self.background[self.top : self.top + self.size[1], self.left : self.left + self.size[0]] = color

    def _draw_axes(self):
        for share in np.linspace(0, 1, 5):
            f, t_z = self.bounds[:, 0] + share * np.ptp(self.bounds, axis=1)
            x, y = np.rint(self.place((f, t_z))).astype(int).tolist()
            foot = self.height - self.bottom
            cv2.line(self.background, (x, foot), (x, foot + 5), (0, 0, 0), 1)
            self._write(f"{f:.1f}", (x - 18, foot + 20))
            cv2.line(self.background, (self.left - 5, y), (self.left, y), (0, 0, 0), 1)
            self._write(f"{t_z:.1f}", (self.left - 58, y + 5))
        self._write("focal length f (mm)", (SHOWN_WIDTH // 2 - 60, self.height - 8))
        self._write("T_z (mm)", (4, self.top + int(0.375 * self.size[1]) + 5))

    def _write(self, text, corner):
        cv2.putText(self.background, text, corner, FONT, 0.45, (0, 0, 0), 1, cv2.LINE_AA)

    def draw(self, picture, chromosomes, best):
        """A population as dots, the best one ringed."""
        for index, chromosome in enumerate(chromosomes):
            place = np.rint(16 * self.place(chromosome)).astype(int).tolist()
            cv2.circle(picture, place, 16 * 3, _bgr(COLORS["genetic"]), -1, cv2.LINE_AA, 4)
            if index == best:
                cv2.circle(picture, place, 16 * 8, (255, 255, 255), 2, cv2.LINE_AA, 4)
