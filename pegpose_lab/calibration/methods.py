"""The table of calibration methods: `study` repeats and compares them, and the notebooks show them."""

import importlib
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Method:
    """A calibration method, called as ``method(object_points, image_points, camera, rng)`` with lists of views.

    Attributes
    ----------
    function : str
        The file below `calibration` and the function in it, for example ``"zhang.calibrate_zhang"``.  The function
        takes object_points and image_points (of one view, or lists of all views) and `camera`, from which it may use
        what is known before a calibration.  It returns a `Calibration`.
    label : str
        The name in tables and figures.
    all_views : bool
        Whether it takes all views; otherwise it gets the first one.
    draws : bool
        Whether it has an argument ``rng``.
    options : dict
        Further arguments.
    """

    function: str
    label: str
    all_views: bool = True
    draws: bool = False
    options: dict = field(default_factory=dict)

    def __call__(self, object_points, image_points, camera, rng=0):
        file, _, name = self.function.rpartition(".")
        calibrate = getattr(importlib.import_module(f"{__package__}.{file}"), name)
        views = (object_points, image_points) if self.all_views else (object_points[0], image_points[0])
        seed = {"rng": rng} if self.draws else {}
        return calibrate(*views, camera, **seed, **self.options)


CALIBRATION_METHODS = {
    "tsai": Method("two_stage.stages.calibrate_tsai", "linear only", all_views=False),
    "genetic": Method("two_stage.stages.calibrate_genetic", "GA, genes (m, T_z)", all_views=False, draws=True),
    "zhang": Method("zhang.calibrate_zhang", "Zhang (OpenCV), k1", options={"coefficients": ("k1",)}),
    "joint": Method("joint.calibrate.calibrate_joint", "joint"),
}
