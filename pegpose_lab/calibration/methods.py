"""The table of calibration methods: `study` repeats and compares what stands in it, and the notebooks show it."""

import importlib
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Method:
    """A calibration method, called as ``method(object_points, image_points, camera, rng)`` with lists of views.

    Attributes
    ----------
    function : str
        The file below `calibration` and the function in it, for example ``"zhang.calibrate_zhang"``.  It is given
        object_points and image_points, of one view or lists of all, and `camera`, of which it may use what is known
        of a camera before it is calibrated; it returns a `Calibration`.
    label : str
        The name in tables and figures.
    all_views : bool
        Whether it takes all views; else it gets the first one.
    unknowns : int
        How many numbers of the camera it estimates, without the six of each view's pose.
    draws : bool
        Whether it has an argument ``rng``.
    given : str
        The attribute of the camera that it gets in place of the camera, if it is not empty.
    options : dict
        Further arguments.
    """

    function: str
    label: str
    all_views: bool = True
    unknowns: int = 4
    draws: bool = False
    given: str = ""
    options: dict = field(default_factory=dict)

    def __call__(self, object_points, image_points, camera, rng=0):
        file, _, name = self.function.rpartition(".")
        calibrate = getattr(importlib.import_module(f"{__package__}.{file}"), name)
        views = (object_points, image_points) if self.all_views else (object_points[0], image_points[0])
        seed = {"rng": rng} if self.draws else {}
        return calibrate(*views, getattr(camera, self.given) if self.given else camera, **seed, **self.options)


CALIBRATION_METHODS = {
    "tsai": Method("two_stage.stages.calibrate_tsai", "linear only", all_views=False, unknowns=1),
    "genetic": Method("two_stage.stages.calibrate_genetic", "GA, genes (m, T_z)", False, unknowns=2, draws=True),
    "zhang": Method("zhang.calibrate_zhang", "Zhang (OpenCV), k1", unknowns=5, given="image_size", options={"radial": 1}),
    "joint": Method("joint.calibrate.calibrate_joint", "joint"),
}
