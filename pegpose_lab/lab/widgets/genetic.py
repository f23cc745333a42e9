"""The explorer of the genetic algorithm: its population on the valley of its objective."""

import textwrap
from dataclasses import replace
from functools import lru_cache

import cv2
import ipywidgets
import numpy as np
from IPython.display import Image, display
from matplotlib.colors import to_rgb
from scipy.spatial.transform import RigidTransform, Rotation

from ...calibration import PENALTY, minimize_genetic
from ...camera import OpenCVCamera, TsaiCamera
from ...checks import CalibrationError, DetectionError, as_image
from ...circles import METHODS, find_circles
from ...pegs import locate_pegs
from ...pose import estimate_pose
from ...render import render_hub
from ...segmentation import segment
from ..plotting import COLORS

SHOWN_WIDTH = 800  # px, of every picture
RENDERED_WIDTH = 400  # px, of the hub's picture before it is enlarged
FONT, LINE_HEIGHT, TEXT_LINES, LINE_LENGTH = cv2.FONT_HERSHEY_SIMPLEX, 22, 3, 88


class Explorer(ipywidgets.VBox):
    """Controls over a picture that follows them.

    Parameters
    ----------
    name : str
    backdrop : callable
        Takes the controls' values by name; returns the (height, width, 3) uint8 picture, in OpenCV's order of
        colours, on which results are drawn.
    draw : callable
        Takes that picture and the values, draws the results into it and returns a text.  It may raise
        ValueError, DetectionError or CalibrationError: then the dimmed backdrop is shown with the error's text.
    controls : dict
        Name -> widget with a ``value``.

    Attributes
    ----------
    controls : dict
    picture : ipywidgets.Image
        Its ``value`` are the bytes of a PNG file.
    text : str
        What is written under the picture.
    failed : bool
        Whether `text` is an error's.
    """

    def __init__(self, name, backdrop, draw, controls):
        self.name, self.controls, self._backdrop, self._draw = name, controls, backdrop, draw
        self.picture = ipywidgets.Image(format="png", width=SHOWN_WIDTH)
        self.refresh()
        for control in controls.values():
            control.observe(self.refresh, names="value")
        super().__init__([*controls.values(), self.picture])

    def refresh(self, _change=None):
        """Compute the picture from the controls' present values."""
        values = {name: control.value for name, control in self.controls.items()}
        picture = self._backdrop(**values).copy()
        try:
            self.text, self.failed = self._draw(picture, **values), False
        except (ValueError, DetectionError, CalibrationError) as error:
            picture = self._backdrop(**values) // 2
            self.text, self.failed = f"No result: {error}", True
        self.picture.value = _as_png(np.vstack([picture, _text_strip(self.text, picture.shape[1])]))

    def __repr__(self):
        """Short and the same in every run: a notebook stores it beside the widget."""
        settings = ", ".join(f"{name} {control.value}" for name, control in self.controls.items())
        return f"{self.name}: {settings}"


def show(explorer):
    """Display an explorer, then its present picture as a PNG, and print its text.

    The picture and the text are stored in the notebook, so that they can be read without a kernel.
    """
    display(explorer)
    display(Image(data=bytes(explorer.picture.value), format="png", width=SHOWN_WIDTH))
    print(explorer.text)


def threshold_explorer(image):
    """Sliders for `segment` (Sect. 3.1): threshold and minimum area; the parts in colour over the picture.

    Parameters
    ----------
    image : (height, width) uint8

    Returns
    -------
    Explorer
        Controls ``automatic`` (Otsu's threshold, with the fallback of `segment`), ``threshold``, ``min_area``.
    """
    image = as_image(image)
    canvas, scale = _canvas(image)

    def draw(picture, automatic, threshold, min_area):
        found = segment(image, min_area=min_area, threshold=None if automatic else threshold)
        _paint_parts(picture, scale, found)
        return _describe_parts(found, min_area)

    return Explorer("threshold explorer", lambda **_: canvas, draw, {
        "automatic": ipywidgets.Checkbox(True, description="automatic (Otsu)", indent=True, **_look()),
        "threshold": _slider(ipywidgets.IntSlider, "threshold (grey value)", int(_otsu(image)), 0, 255),
        "min_area": _slider(ipywidgets.IntSlider, "minimum area (px)", max(4, image.size // 10_000), 1,
                            max(5, image.size // 500)),
    })


def circle_explorer(image, *, radius_range=(20, 60), polarity="bright"):
    """Controls for `find_circles` (Sect. 3.1): radius range, sensitivity, method; the circles over the picture.

    The picture is searched as it is shown, `SHOWN_WIDTH` px wide, and for bright discs only round the parts
    that `segment` finds, where it finds any.  All radii are in px of `image`.

    Parameters
    ----------
    image : (height, width) uint8
    radius_range : (int, int)
        Where the radius slider stands first, px.
    polarity : {"bright", "dark"}

    Returns
    -------
    Explorer
        Controls ``radius_range``, ``sensitivity``, ``method``.
    """
    image = as_image(image)
    canvas, scale = _canvas(image)
    small = _resized(image, scale)
    regions = _regions(small) if polarity == "bright" else None

    def draw(picture, radius_range, sensitivity, method):
        circles = find_circles(small, scale * np.array(radius_range), method=method, polarity=polarity,
                               sensitivity=sensitivity, regions=regions)
        for center, radius in zip(circles.centers, circles.radii):
            _circle(picture, center, radius, 1.0, COLORS["genetic"])
        return _describe_circles(circles, scale)

    return Explorer("circle explorer", lambda **_: canvas, draw, {
        "radius_range": _slider(ipywidgets.IntRangeSlider, "radius range (px)", radius_range, 2,
                                max(min(image.shape) // 4, radius_range[1]), live=False),
        "sensitivity": _slider(ipywidgets.FloatSlider, "sensitivity (0 to 1)", 0.85, 0.0, 1.0, step=0.01,
                               live=False),
        "method": ipywidgets.Dropdown(options=METHODS, description="method", **_look()),
    })


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


def hub_explorer(camera, hub, cam_from_plane, *, angle=-140.0, shift=0.0, blur=0.9, noise=2.0):
    """Sliders for the hub's angle and shift (Sect. 3.2): renders it, locates the pegs and estimates the pose.

    The picture is rendered `RENDERED_WIDTH` px wide, for speed.  Labels are carried over from the picture before,
    as from frame to frame, because the two screws leave a half turn open: at the first angle screw 1 is the one
    further left, and a jump by too large an angle is refused.

    Parameters
    ----------
    camera : TsaiCamera or OpenCVCamera
    hub : Hub
    cam_from_plane : RigidTransform
        The plane of the peg tops.
    angle, shift : float
        Where the sliders stand first, deg and mm.
    blur, noise : float
        px and grey values, of the picture as it is rendered.

    Returns
    -------
    Explorer
        Controls ``angle`` (deg about z), ``shift`` (mm along x).
    """
    camera = _smaller(camera, RENDERED_WIDTH)
    previous = None

    @lru_cache(maxsize=2)
    def render(angle, shift):
        turn = Rotation.from_rotvec([0, 0, np.deg2rad(angle)])
        truth = cam_from_plane * RigidTransform.from_components([shift, 0, 0], turn)
        return render_hub(camera, truth, hub, blur=blur, noise=noise, rng=0)

    def backdrop(angle, shift):
        return _canvas(render(angle, shift))[0]

    def draw(picture, angle, shift):
        nonlocal previous
        previous = locate_pegs(render(angle, shift), hub, previous=previous)
        pose = estimate_pose(previous, camera, hub, plane=cam_from_plane)
        _paint_pegs(picture, SHOWN_WIDTH / camera.image_size[0], previous)
        return _compare_poses(angle, shift, pose)

    return Explorer("hub explorer", backdrop, draw, {
        "angle": _slider(ipywidgets.FloatSlider, "hub angle (deg)", angle, -180.0, 180.0, step=1.0),
        "shift": _slider(ipywidgets.FloatSlider, "shift (mm)", shift, -10.0, 70.0, step=0.5),
    })


# ---- controls ----


def _look():
    return {"style": {"description_width": "12em"}, "layout": {"width": f"{SHOWN_WIDTH}px"}}


def _slider(kind, description, value, low, high, *, step=1, live=True):
    """A slider; `live` ones follow the mouse, the others wait until it is released."""
    limits = {"min": low, "max": high, "step": step}
    return kind(value=value, description=description, continuous_update=live, **limits, **_look())


# ---- pictures; (x, y) px of the full image lies at scale * (x + 0.5) - 0.5 in the shown one ----


def _bgr(color):
    """A colour of `COLORS` as OpenCV orders it."""
    return tuple(round(255 * part) for part in reversed(to_rgb(color)))


def _canvas(image):
    """A picture `SHOWN_WIDTH` px wide, in colour, and its scale.

    Grey values are rounded to multiples of 8: noise would make the PNG files several times larger.
    """
    scale = SHOWN_WIDTH / image.shape[1]
    return cv2.cvtColor(cv2.add(_resized(image, scale), 4) & 0xF8, cv2.COLOR_GRAY2BGR), scale


def _resized(image, scale):
    size = round(scale * image.shape[1]), max(1, round(scale * image.shape[0]))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)


def _as_png(picture):
    return cv2.imencode(".png", picture)[1].tobytes()


def _text_strip(text, width):
    """A white strip with up to `TEXT_LINES` lines of text."""
    strip = np.full((TEXT_LINES * LINE_HEIGHT + 8, width, 3), 255, np.uint8)
    lines = [part for line in text.splitlines() for part in textwrap.wrap(line, LINE_LENGTH)]
    if len(lines) > TEXT_LINES:
        rest = " ".join(lines[TEXT_LINES - 1 :])
        lines = [*lines[: TEXT_LINES - 1], textwrap.shorten(rest, LINE_LENGTH, placeholder=" ...")]
    for number, line in enumerate(lines, 1):
        printable = line.encode("ascii", "replace").decode()
        cv2.putText(strip, printable, (8, number * LINE_HEIGHT), FONT, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return strip


def _place(point, scale, bits=4):
    """Position in the shown picture, in units of 1/16 px as cv2's drawing functions take it."""
    x, y = np.rint((scale * (np.asarray(point) + 0.5) - 0.5) * (1 << bits)).astype(int).tolist()
    return x, y


def _circle(picture, center, radius, scale, color, label=None):
    """A circle with its centre and, if given, a label beside it."""
    place = _place(center, scale)
    cv2.circle(picture, place, round(16 * scale * radius), _bgr(color), 2, cv2.LINE_AA, 4)
    cv2.circle(picture, place, 16 * 2, _bgr(color), -1, cv2.LINE_AA, 4)
    if label is not None:
        corner = np.add(np.floor_divide(place, 16), round(0.75 * scale * radius) * np.array([1, -1])).tolist()
        cv2.putText(picture, label, corner, FONT, 0.7, _bgr(color), 2, cv2.LINE_AA)


# ---- segmentation and circles ----


def _otsu(image):
    return cv2.threshold(image, 0, 255, cv2.THRESH_OTSU)[0]


def _regions(image):
    """Boxes of the picture's bright parts, or None where there are none."""
    try:
        boxes = segment(image).boxes
    except DetectionError:
        return None
    return boxes if len(boxes) else None


def _paint_parts(picture, scale, found):
    """Tint each part with one of the project's colours and number it."""
    palette = np.array([_bgr(color) for name, color in COLORS.items() if name not in ("paper", "truth")], np.uint8)
    labels = cv2.resize(found.labels, picture.shape[1::-1], interpolation=cv2.INTER_NEAREST)
    white = labels > 0
    picture[white] = picture[white] // 2 + palette[labels[white] % len(palette)] // 2
    for number, centroid in enumerate(found.centroids[:99], 1):
        x, y = _place(centroid, scale, 0)
        cv2.putText(picture, str(number), (x - 6, y + 6), FONT, 0.6, (255, 255, 255), 2, cv2.LINE_AA)


def _describe_parts(found, min_area):
    areas = f"; areas {found.areas.min()} to {found.areas.max()} px" if len(found.areas) else ""
    return f"threshold {found.threshold:.0f}: {len(found.areas)} parts of {min_area} px or more{areas}"


def _describe_circles(circles, scale):
    number, radii = len(circles.radii), circles.radii / scale
    if number == 0:
        return "no circles: widen the radius range or raise the sensitivity"
    return (f"{number} circle{'s' * (number > 1)}; radii {radii.min():.1f} to {radii.max():.1f} px, "
            f"scores {circles.scores.min():.2f} to {circles.scores.max():.2f}")


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


# ---- the hub ----


def _smaller(camera, width):
    """The same camera with pixels so large that its picture is at most `width` px wide."""
    scale = min(1.0, width / camera.image_size[0])
    size = tuple(max(1, round(scale * side)) for side in camera.image_size)
    if isinstance(camera, TsaiCamera):
        pitch = np.array(camera.pixel_pitch) / scale
        middle = scale * (np.array(camera.principal_point) + 0.5) - 0.5
        return replace(camera, pixel_pitch=pitch, principal_point=middle, image_size=size)
    to_small = np.array([[scale, 0, 0.5 * scale - 0.5], [0, scale, 0.5 * scale - 0.5], [0, 0, 1]])
    return OpenCVCamera(to_small @ camera.camera_matrix, camera.dist_coeffs, size)


def _paint_pegs(picture, scale, seen):
    """Labelled pegs, screws, and line 1 of Fig. 5 from the hub's centre to peg 1."""
    ends = (_place(point, scale) for point in (seen.hub_center, seen.peg_centers[0]))
    cv2.line(picture, *ends, _bgr(COLORS["genetic"]), 2, cv2.LINE_AA, 4)
    for number, (center, radius) in enumerate(zip(seen.peg_centers, seen.peg_radii), 1):
        _circle(picture, center, radius, scale, COLORS["genetic"], str(number))
    for number, center in enumerate(seen.screw_centers, 1):
        _circle(picture, center, 6.0 / scale, scale, COLORS["linear"], f"s{number}")


def _compare_poses(angle, shift, pose):
    """Truth and estimate; says so where the labels are a half turn off, as the screws allow."""
    found = np.rad2deg(pose.theta)
    error = (found - angle + 180) % 360 - 180
    half_turn_off = abs(error) > 90
    theta = found if half_turn_off else angle + error
    lines = [
        f"truth: theta = {angle:.2f} deg, x = {shift:.2f} mm, y = 0.00 mm",
        f"estimate: theta = {theta:.2f} deg, x = {pose.x:.2f} mm, y = {pose.y:.2f} mm",
    ]
    if half_turn_off:
        lines.append("The labels are a half turn off: the hub looks the same after a half turn.")
    return "\n".join(lines).replace("-0.00", "0.00")
