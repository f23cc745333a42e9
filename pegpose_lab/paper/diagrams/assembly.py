"""Fig. 1: camera, robot, hub and wheel, with Eqs. 1 and 2 as arrows."""

import numpy as np
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Polygon
from scipy.spatial import ConvexHull
from scipy.spatial.transform import RigidTransform, Rotation

from ...camera import TsaiCamera
from ...checks import as_number
from ...lab.plotting import COLORS, SERIES
from ...targets import Hub

AXIS_COLORS = (SERIES[1], SERIES[2], SERIES[0])  # x, y, z of every frame: red, green, blue
MARKED = SERIES[5]  # what a drawing is about: the pose sought in Fig. 1, peg 1 in Fig. 5
INK = COLORS["paper"]
BODY, SHADE, EDGE = "0.93", "0.80", "0.45"  # greys of solid bodies: lit faces, shaded faces, outlines
SMALL = 8.0  # pt
_CENTERED = {"ha": "center", "va": "center"}

# What the diagrams name: Eqs. 1 and 2 as {(frame a, frame b): project's name of a_from_b}.
TRANSFORMS = {
    ("R", "C"): "robot_from_cam",
    ("C", "P"): "cam_from_hub",
    ("P", "E"): "hub_from_end_effector",
    ("C", "E"): "cam_from_end_effector",
    ("R", "E"): "robot_from_end_effector",
}

# Fig. 2 as (title, what happens, modules), from top to bottom.
CALIBRATION_STEPS = (
    ("Boards", "checkerboard, several orientations", "targets.py  render.py"),
    ("Corners", "sub-pixel, row by row", "corners.py"),
    ("Stage 1", "linear: $R$, $T_x$, $T_y$; first $f$, $T_z$", "tsai.py"),
    ("Stage 2", "genetic: $f$, $T_z$; $k_1$ (Eqs. 4$-$10)", "genetic.py  two_stage.py"),
    ("Camera", "a pixel to a ray, and back (Eq. 3)", "camera.py"),
)
FRAME_STEPS = (
    ("Image", "hub with pegs, bore and screws", "targets.py  render.py"),
    ("Mask", "Otsu's threshold, area filter", "segmentation.py"),
    ("Circles", "Hough transform, sub-pixel edges", "circles.py  edges.py"),
    ("Pegs", "labelled by the screws, tracked", "pegs.py"),
    ("Pose", "$x$, $y$, $\\theta$; to the robot (Eqs. 1, 2, 11)", "pose.py"),
)


def look_at(eye, target, up):
    """Return cam_from_world (RigidTransform) of a camera at `eye` that looks at `target`, `up` upwards."""
    forward = np.asarray(target, float) - eye
    right = np.cross(forward, up)
    axes = np.array([right, np.cross(forward, right), forward])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return RigidTransform.from_components(np.asarray(eye, float), Rotation.from_matrix(axes.T)).inv()


def draw_assembly(ax):
    """Fig. 1: a fixed camera sees the hub on its shaft, a robot brings the wheel; frames and Eqs. 1 and 2.

    An arrow from frame a to frame b is the pose of b in a, written as in the paper and as the project
    names it: ``a_from_b`` takes coordinates in b to coordinates in a.  Made for 7.0 x 4.6 inches.

    Returns
    -------
    dict
        {frame letter: (2,) position of its origin in the axes}, what the arrows connect.
    """
    view = _View(ax, eye=(62.0, -640.0, 215.0), target=(62.0, 0.0, 45.0))
    poses = _assembly_poses()
    _draw_table(view)
    _draw_hub_on_shaft(view, poses["P"])
    _draw_fixed_camera(view, poses["C"], poses["P"])
    _draw_robot(view, poses["E"])
    for name, pose in poses.items():
        names = ("$x$", "$y$", "$z$") if name == "R" else None
        view.triad(pose, 11.0, zorder=30, names=names, offsets=((5, 0), (-9, 0), (0, 6)))
    origins = {name: view.at(pose.translation) for name, pose in poses.items()}
    for letter, title, offset in (
        ("R", "robot base", (80, -12)), ("E", "end-effector\nwith the wheel", (-58, 38)),
        ("C", "fixed camera", (-62, 26)), ("P", "hub with pegs", (-75, -17)),
    ):
        view.label(poses[letter].translation, f"$\\mathbf{{{letter}}}$  {title}", offset)
    for (start, end), (bend, share) in zip(TRANSFORMS, _ARROW_SHAPES):
        _transform_arrow(ax, start, end, origins, bend, share)
    view.label(_SHAFT_END, "shaft, turns about $z$", (-12, 0), ha="right")
    view.finish(
        "Eq. 1:  ${}^{R}T_{E} = {}^{R}T_{C}\\;{}^{C}T_{P}\\;{}^{P}T_{E}$        "
        "Eq. 2:  ${}^{P}T_{E} = ({}^{C}T_{P})^{-1}\\;{}^{C}T_{E}$\n"
        "An arrow from frame $a$ to frame $b$ is the pose of $b$ in $a$, named a_from_b."
    )
    return origins


def draw_overview(ax):
    """Fig. 2: the method as two columns of steps, calibration and frames, each with its module.

    Made for 7.0 x 4.4 inches.
    """
    width, height, gap, left, right = 3.2, 0.66, 0.24, 0.0, 3.7
    tops = -np.arange(len(FRAME_STEPS)) * (height + gap)
    columns = (
        (left, "Once: calibration", CALIBRATION_STEPS, SERIES[0]),
        (right, "Each frame: pose estimation", FRAME_STEPS, MARKED),
    )
    for x, heading, steps, color in columns:
        ax.text(x, 0.12, heading, color=color, weight="bold", fontsize=10, va="bottom")
        for top, step in zip(tops, steps):
            _draw_step(ax, (x, top - height), (width, height), step, color)
        for top in tops[1:]:
            _arrow(ax, (x + width / 2, top + gap), (x + width / 2, top), color=color, shrinkB=1)
    middle = tops[-1] - height / 2
    _arrow(ax, (left + width, middle), (right, middle), shrinkB=1)
    _bare(ax, (left - 0.05, right + width + 0.05), (tops[-1] - height - 0.08, 0.45))


def draw_camera_model(ax):
    r"""Fig. 4: camera model with radial distortion, Eq. 3: :math:`x_u = x_d (1 + k_1 r^2)`, in perspective.

    A point P goes along a straight ray to (x_u, y_u) in the image plane; the lens moves it to
    (x_d, y_d), towards the principal point O_i.  The grid in the image plane is a square grid as this
    lens shows it.  The distortion is exaggerated and the drawing says by how much it moves P's image.
    Made for 7.0 x 4.2 inches.

    Returns
    -------
    dict
        ``camera`` (TsaiCamera, mm), ``point`` (3,) P in the camera frame, ``undistorted`` and ``distorted``
        (2,) mm on the sensor, ``view`` (maps (n, 3) scene points to (n, 2) positions in the axes).
    """
    camera = TsaiCamera(100.0, kappa1=6e-5)
    point = np.array([-118.0, -96.0, 235.0])
    undistorted = camera.focal_length * point[:2] / point[2]
    distorted = camera.distort(undistorted)
    view = _View(ax, eye=(640.0, -290.0, -270.0), target=(0.0, 0.0, 130.0), up=(0.0, -1.0, 0.0))
    _draw_image_plane(view, camera)
    _draw_camera_frames(view, camera)
    _draw_ray(view, camera, point, undistorted, distorted)
    moved = 1 - np.hypot(*distorted) / np.hypot(*undistorted)
    view.finish(
        "$x_u = x_d\\,(1 + k_1 r^2)$,   $r^2 = x_d^2 + y_d^2$   (Eq. 3)\n"
        f"barrel distortion, exaggerated: it moves this image point {moved:.0%} inwards"
    )
    return {"camera": camera, "point": point, "undistorted": undistorted, "distorted": distorted, "view": view}


def draw_orientation(ax, hub, theta):
    r"""Fig. 5: theta, the angle from the horizontal (line 2) to the line from the hub's centre to peg 1 (line 1).

    Drawn as the screen shows it, y down, so that theta counts positive clockwise, from x towards y, and the
    pegs are numbered clockwise; the arc's arrow runs the way of theta's sign.  Eq. 11's tangent is the same
    for theta and theta + pi; the project uses
    :math:`\theta = \operatorname{atan2}(y_1 - y_0, x_1 - x_0)`.  Made for 5.0 x 4.9 inches.

    Parameters
    ----------
    ax : Axes
    hub : Hub
    theta : float
        rad, about the hub's z axis.

    Returns
    -------
    (Line2D, Line2D)
        Line 1 and line 2, each from the hub's centre outwards.

    Raises
    ------
    ValueError
        If theta is not a finite number.
    """
    theta = as_number(theta, "theta")
    turn = Rotation.from_rotvec([0, 0, theta])
    pegs, screws = (turn.apply(points)[:, :2] for points in (hub.peg_centers, hub.screw_centers))
    reach = 1.28 * hub.radius
    _draw_hub_face(ax, hub, pegs, screws)
    line1, = ax.plot(*np.array([(0, 0), pegs[0]]).T, color=MARKED, linewidth=2.0, zorder=5)
    line2, = ax.plot([0, reach], [0, 0], color=SERIES[0], linewidth=2.0, linestyle=(0, (5, 2)), zorder=4)
    ax.plot(*np.array([(0, 0), pegs[0]]).T, "o", color=INK, markersize=4, zorder=6)
    _draw_theta(ax, theta, _arc_radius(hub))
    _label_orientation(ax, hub, pegs, screws, theta, reach)
    _draw_screen_axes(ax, hub)
    way = "clockwise" if theta >= 0 else "anticlockwise"
    _bare(
        ax, (-1.35 * hub.radius, 1.75 * hub.radius), (1.42 * hub.radius, -1.2 * hub.radius),
        "As on the screen, $y$ down: $\\theta$ counts positive clockwise, from $x$ towards $y$.\n"
        f"Drawn: $\\theta = {np.rad2deg(theta):.1f}$°, {way}. Pegs are numbered clockwise.",
    )
    return line1, line2


class _View:
    """Draws three-dimensional things into axes, seen by a pin-hole camera."""

    def __init__(self, ax, eye, target, up=(0.0, 0.0, 1.0)):
        self.ax = ax
        self.camera = TsaiCamera(1000.0)
        self.cam_from_world = look_at(eye, target, up)
        self.drawn = []

    def __call__(self, points):
        """Positions (n, 2) of scene points (n, 3)."""
        return self.camera.project(np.atleast_2d(points), self.cam_from_world)

    def at(self, point):
        """Position (2,) of one scene point."""
        return self(point)[0]

    def line(self, points, **style):
        places = self._note(self(points))
        return self.ax.plot(*places.T, **({"color": INK, "linewidth": 1.0, "solid_capstyle": "round"} | style))[0]

    def face(self, points, **style):
        """A flat polygon."""
        places = self._note(self(points))
        self.ax.add_patch(Polygon(places, **({"facecolor": BODY, "edgecolor": EDGE, "linewidth": 0.8} | style)))

    def solid(self, points, **style):
        """The outline of a convex body: the hull of its points' images."""
        places = self(points)
        self._note(places)
        outline = places[ConvexHull(places).vertices]
        self.ax.add_patch(Polygon(outline, **({"facecolor": BODY, "edgecolor": EDGE, "linewidth": 0.8} | style)))

    def cylinder(self, start, end, radius, *, zorder, shade=SHADE, cap=BODY):
        """A cylinder with the cap at `end` towards the viewer."""
        rings = [_ring(center, np.subtract(end, start), radius) for center in (start, end)]
        self.solid(np.vstack(rings), facecolor=shade, zorder=zorder)
        self.face(rings[1], facecolor=cap, zorder=zorder + 0.1)

    def capsule(self, start, end, radius, *, zorder):
        """A rounded link between two joints."""
        towards = self.cam_from_world.inv().translation
        rings = [_ring(center, towards - center, radius) for center in np.array([start, end], float)]
        self.solid(np.vstack(rings), zorder=zorder)
        for ring in rings:
            self.face(ring, facecolor=SHADE, zorder=zorder + 0.1)

    def arrow(self, start, end, **style):
        _arrow(self.ax, *self._note(self([start, end])), **({"linewidth": 1.2, "mutation_scale": 8} | style))

    def triad(self, world_from_frame, length, *, zorder, names=None, offsets=((0, 0),) * 3):
        """A frame's three axes in x, y, z colours."""
        ends = world_from_frame.apply(length * np.eye(3))
        for index, (end, color) in enumerate(zip(ends, AXIS_COLORS)):
            self.arrow(world_from_frame.translation, end, color=color, zorder=zorder, linewidth=1.5)
            if names:
                self.label(end, names[index], offsets[index], color=color)

    def label(self, point, text, offset, **style):
        """Text at a scene point, moved by `offset` points (right, up)."""
        place = self._note(self(point))[0]
        defaults = {"fontsize": SMALL + 0.5, "ha": "center", "va": "center", "zorder": 40, "linespacing": 1.15}
        self.ax.annotate(text, place, xytext=offset, textcoords="offset points", **(defaults | style))

    def finish(self, caption, margin=0.04):
        """Frame what was drawn, y down as in any picture of a camera, with a caption below."""
        low, high = np.min(self.drawn, axis=0), np.max(self.drawn, axis=0)
        left, top = low - margin * (high - low)
        right, bottom = high + margin * (high - low)
        _bare(self.ax, (left, right), (bottom, top), caption)

    def _note(self, places):
        self.drawn.extend(places)
        return places


def _arrow(ax, start, end, **style):
    """An arrow from point to point of the axes."""
    defaults = {"arrowstyle": "-|>", "mutation_scale": 10, "shrinkA": 0, "shrinkB": 0}
    ax.add_patch(FancyArrowPatch(start, end, **(defaults | {"color": INK, "linewidth": 1.3} | style)))


def _bare(ax, xlim, ylim, caption=None):
    """Axes without axes: equal scales, nothing round them but a caption below."""
    ax.set(xlim=xlim, ylim=ylim, aspect="equal", xticks=[], yticks=[])
    ax.spines[:].set_visible(False)
    ax.set_xlabel(caption, fontsize=SMALL + 1, linespacing=1.4)


def _ring(center, axis, radius, count=60):
    """Points (count, 3) on a circle about `axis` through `center`."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)[:, None]
    return center + radius * (np.cos(angles) * first + np.sin(angles) * np.cross(axis, first))


# ---- Fig. 1; lengths in cm, z up, the robot's base in the origin ----


_HUB_CENTER = np.array([104.0, 0.0, 26.0])
_SHAFT_END = np.array([104.0, 0.0, 4.0])
_WHEEL_CENTER = np.array([58.0, 0.0, 56.0])
_CAMERA_CENTER = np.array([114.0, 0.0, 96.0])
_ARROW_SHAPES = ((0.18, 0.24), (-0.14, 0.5), (0.17, 0.27), (0.12, 0.5), (-0.14, 0.5))  # bend, place of the names
_ENLARGED = 0.24  # cm per mm: the hub is drawn 2.4 times its size beside the robot


def _assembly_poses():
    """World poses of the frames R, E, C, P; E's and P's z axes point into the table, away from the camera."""
    downwards = Rotation.from_euler("x", np.pi)
    turned = downwards * Rotation.from_rotvec([0, 0, np.deg2rad(20.0)])
    return {
        "R": RigidTransform.identity(),
        "E": RigidTransform.from_components(_WHEEL_CENTER, turned),
        "C": look_at(_CAMERA_CENTER, _HUB_CENTER, (0.0, 1.0, 0.0)).inv(),
        "P": RigidTransform.from_components(_HUB_CENTER, turned),
    }


def _draw_table(view):
    corners = [(-24, -34, 0), (150, -34, 0), (150, 34, 0), (-24, 34, 0)]
    view.face(np.array(corners, float), facecolor="0.97", edgecolor="0.75", zorder=0)


def _draw_hub_on_shaft(view, world_from_hub):
    """Shaft, base, pegs from the back to the front, and the arrow of rotation."""
    hub = Hub()
    scale = _ENLARGED
    base, lower = (world_from_hub.apply([0, 0, scale * z]) for z in (hub.peg_height, hub.peg_height + 14))
    view.cylinder([*_SHAFT_END[:2], 0.0], lower, 3.0, zorder=2)
    view.cylinder(lower, base, scale * hub.radius, zorder=4)
    view.face(_ring(base, (0, 0, 1), scale * hub.bore_radius), facecolor=SHADE, zorder=4.3)
    feet = world_from_hub.apply(scale * (hub.peg_centers + [0, 0, hub.peg_height]))
    tops = world_from_hub.apply(scale * hub.peg_centers)
    for order, index in enumerate(np.argsort(-tops[:, 1])):
        view.cylinder(feet[index], tops[index], scale * hub.peg_radius, zorder=5 + order)
    arc = _ring([*_SHAFT_END[:2], 9.0], (0, 0, 1), 6.5)[np.arange(8, 44)]
    view.line(arc, color=INK, zorder=3)
    view.arrow(arc[-2], arc[-1], zorder=3)


def _draw_fixed_camera(view, world_from_cam, world_from_hub):
    """Body and lens along the camera's z axis, a bracket to a post, and the cone of view on the hub."""
    rim = _ring(world_from_hub.translation, (0, 0, 1), 1.18 * _ENLARGED * Hub().radius)
    view.solid(np.vstack([rim, world_from_cam.translation]), facecolor=COLORS["measured"], alpha=0.13,
               edgecolor="none", zorder=1)
    corners = np.array(np.meshgrid((-5, 5), (-5, 5), (-18, -4))).reshape(3, -1).T
    post = np.array([(142.0, 10.0, 0.0), (142.0, 10.0, 112.0), (114.0, 4.0, 112.0)])
    view.line(post, color=EDGE, linewidth=4.5, zorder=1.5, solid_joinstyle="round")
    view.line(post, color=BODY, linewidth=3.0, zorder=1.6, solid_joinstyle="round")
    view.solid(world_from_cam.apply(corners.astype(float)), facecolor=SHADE, zorder=12)
    view.cylinder(*world_from_cam.apply([[0.0, 0, -5], [0.0, 0, 0]]), 3.5, zorder=11)


def _draw_robot(view, world_from_effector):
    """Base, two links, wrist, and the wheel with its four holes."""
    hub = Hub()
    center = world_from_effector.translation
    shoulder, elbow, wrist = np.array([0.0, 0, 26]), np.array([14.0, 0, 88]), center + [0, 0, 34]
    view.cylinder((0, 0, 0), (0, 0, 12), 12.0, zorder=3)
    view.cylinder((0, 0, 12), shoulder, 7.0, zorder=4)
    view.capsule(shoulder, elbow, 5.0, zorder=6)
    view.capsule(elbow, wrist, 4.2, zorder=8)
    view.cylinder(center + [0, 0, 4], wrist, 2.6, zorder=7.5)
    lower, upper = center, center + [0, 0, 5.0]
    view.cylinder(lower, upper, 1.25 * _ENLARGED * hub.radius, zorder=5)
    holes = world_from_effector.apply(_ENLARGED * hub.peg_centers) + [0, 0, 5.0]
    for hole in holes:
        view.face(_ring(hole, (0, 0, 1), 1.15 * _ENLARGED * hub.peg_radius), facecolor="white", zorder=5.5)


def _transform_arrow(ax, start, end, places, bend, share):
    """An arrow from frame to frame, its names at `share` of its way; the sought one in colour."""
    color = MARKED if (start, end) == ("C", "P") else INK
    first, last = places[start], places[end]
    _arrow(ax, first, last, connectionstyle=f"arc3,rad={bend}", shrinkA=5, shrinkB=5, color=color, zorder=25)
    dx, dy = last - first
    control = (first + last) / 2 + bend * np.array([-dy, dx])  # of arc3's quadratic curve, in axes with y down
    middle = (1 - share) ** 2 * first + 2 * share * (1 - share) * control + share**2 * last
    name = TRANSFORMS[start, end].replace("_from_end", "_from_\nend")
    text = f"${{}}^{{{start}}}T_{{{end}}}$\n{name}"
    ax.annotate(
        text, middle, ha="center", va="center", fontsize=SMALL, color=color, zorder=35, linespacing=1.1,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"},
    )


# ---- Fig. 2 ----


def _draw_step(ax, corner, size, step, color):
    """A box: title at the left, what happens below it, the modules at the right."""
    title, text, modules = step
    (x, y), (width, height) = corner, size
    style = {"boxstyle": "round,pad=0,rounding_size=0.07", "facecolor": "white", "linewidth": 1.2}
    ax.add_patch(FancyBboxPatch(corner, width, height, edgecolor=color, **style))
    ax.text(x + 0.12, y + 0.68 * height, title, weight="bold", fontsize=9.5, va="center")
    ax.text(x + width - 0.12, y + 0.68 * height, modules, fontsize=SMALL - 0.5, family="monospace", color=color,
            ha="right", va="center")
    ax.text(x + 0.12, y + 0.28 * height, text, fontsize=SMALL + 0.5, va="center", color="0.25")


# ---- Fig. 4; lengths in mm, in the camera frame ----


_HALO = {"boxstyle": "round,pad=0.05", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
_PLANE = np.array([80.0, 60.0])  # half width and height of the image plane


def _draw_image_plane(view, camera):
    """The plane z = f with a square grid as the lens distorts it."""
    f = camera.focal_length
    corners = _PLANE * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    view.face(_lift(corners, f), facecolor=COLORS["measured"], alpha=0.12, edgecolor="none", zorder=2)
    view.face(_lift(corners, f), fill=False, edgecolor=EDGE, zorder=2.1)
    along = np.linspace(-1, 1, 61)
    for level in np.linspace(-1, 1, 9):
        for line in (np.column_stack([along, np.full(61, level)]), np.column_stack([np.full(61, level), along])):
            view.line(_lift(_PLANE * line, f), color="0.8", linewidth=0.5, zorder=2.2)
            view.line(_lift(camera.distort(_PLANE * line), f), color=COLORS["measured"], linewidth=0.8, zorder=2.3)
    view.label((*(_PLANE * (1, -1)), f), "image plane", (30, 6), color=EDGE)


def _draw_camera_frames(view, camera):
    """Camera frame, optical axis with f, image frame and world frame."""
    f = camera.focal_length
    camera_pose, image_pose = RigidTransform.identity(), RigidTransform.from_translation([0, 0, f])
    turned = Rotation.from_euler("yx", [-25.0, 15.0], degrees=True)
    world = RigidTransform.from_components([30.0, 60.0, 330.0], turned)
    view.line([(0, 0, 0), (0, 0, 300.0)], color=EDGE, linestyle=(0, (6, 2, 1, 2)), linewidth=0.9, zorder=1)
    view.triad(camera_pose, 40.0, zorder=10, names=("$X_c$", "$Y_c$", "$Z_c$"), offsets=((8, -4), (-9, 2), (0, 8)))
    view.triad(world, 48.0, zorder=10, names=("$X_w$", "$Y_w$", "$Z_w$"), offsets=((0, 8), (0, -8), (0, 8)))
    for end, name, color in zip(image_pose.apply(36.0 * np.eye(3)), ("$X_i$", "$Y_i$"), AXIS_COLORS):
        view.arrow(image_pose.translation, end, color=color, zorder=9)
        view.label(end, name, (0, -8), color=color, bbox=_HALO)
    view.label((0, 0, 0), "$O_c$", (-12, 0))
    view.label((0, 0, f), "$O_i$", (-10, -9), bbox=_HALO)
    view.arrow((0, 0, 0), world.translation, color="0.5", linestyle=(0, (3, 2)), zorder=1)
    view.label(0.7 * world.translation, "$R$, $T$: cam_from_world", (0, 8), color="0.4")
    _draw_focal_length(view, f)


def _draw_focal_length(view, f):
    """Dimension line of f, below the optical axis."""
    start, end = np.array([(0, 62.0, 0), (0, 62.0, f)])
    for end_point in (start, end):
        view.line([end_point * (1, 0, 1), end_point], color="0.6", linewidth=0.6, zorder=3)
    view.arrow(start, end, arrowstyle="<|-|>", linewidth=0.8, zorder=8)
    view.label((start + end) / 2, "$f$", (0, -7), fontsize=SMALL + 2)


def _draw_ray(view, camera, point, undistorted, distorted):
    """P, its straight ray, and where the lens shows it instead."""
    f = camera.focal_length
    seen, shown = _lift([undistorted, distorted], f)
    view.line([(0, 0, 0), seen, point], color=MARKED, zorder=6)
    view.line([(0, 0, f), seen], color=INK, linewidth=0.8, linestyle=":", zorder=6)
    for place, color in ((point, INK), (seen, SERIES[0]), (shown, MARKED)):
        view.ax.plot(*view.at(place), "o", color=color, markersize=5, zorder=12)
    view.label(point, "$P\\,(x_w, y_w, z_w)$", (0, 10))
    view.label(seen, "$(x_u, y_u)$", (-25, 3), color=SERIES[0])
    view.label(shown, "$(x_d, y_d)$", (24, -9), color=MARKED, bbox=_HALO)


def _lift(points, z):
    """Points (n, 2) of a plane z = const as (n, 3)."""
    points = np.atleast_2d(points)
    return np.column_stack([points, np.full(len(points), z)])


# ---- Fig. 5; lengths in mm, x to the right, y down ----


def _draw_hub_face(ax, hub, pegs, screws):
    """Base, pitch circle, bore, screws and pegs as the camera sees them."""
    def disc(center, radius, face, **style):
        defaults = {"facecolor": face, "edgecolor": EDGE, "linewidth": 1.0, "zorder": 2}
        ax.add_patch(Circle(center, radius, **(defaults | style)))

    disc((0, 0), hub.radius, BODY, zorder=1)
    disc((0, 0), hub.pitch_circle_diameter / 2, "none", linestyle=(0, (4, 3)), linewidth=0.8, zorder=1.5)
    disc((0, 0), hub.bore_radius, "white")
    for center in screws:
        disc(center, hub.screw_radius, SHADE)
    for index, center in enumerate(pegs):
        disc(center, hub.peg_radius, "white", edgecolor=MARKED if index == 0 else INK, linewidth=1.5)


def _draw_theta(ax, theta, radius):
    """The arc from line 2 to line 1, with its arrow in the direction of the sign."""
    angles = np.linspace(0, theta, 80)
    path = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    ax.plot(*path[:-3].T, color=INK, linewidth=1.2, zorder=6)
    _arrow(ax, path[-4], path[-1], zorder=6)


def _label_orientation(ax, hub, pegs, screws, theta, reach):
    """Names of pegs, screws, lines and the angle, each beside its thing."""
    pitch_radius = hub.pitch_circle_diameter / 2
    for number, center in enumerate(pegs, 1):
        ax.text(*center * (1.13 * hub.radius / pitch_radius), f"peg {number}", **_CENTERED, fontsize=9.5,
                color=MARKED if number == 1 else INK)
    for number, center in enumerate(screws, 1):
        place = center / np.hypot(*center) * (pitch_radius + hub.radius) / 2
        ax.text(*place, f"screw {number}", **_CENTERED, fontsize=SMALL)
    along = np.array([np.cos(theta), np.sin(theta)])
    away = (1.0 if theta >= 0 else -1.0) * np.array([-along[1], along[0]])  # the side of line 1 without the arc
    slope = (-np.rad2deg(theta) + 90) % 180 - 90
    ax.text(*(0.58 * pitch_radius * along + 4.5 * away), "line 1", rotation=slope, **_CENTERED,
            fontsize=9, color=MARKED)
    ax.text(reach, 0, " line 2,\n horizontal", ha="left", va="center", fontsize=9, color=SERIES[0])
    radius = _arc_radius(hub) + 5.0
    ax.text(radius * np.cos(theta / 2), radius * np.sin(theta / 2), "$\\theta$", **_CENTERED, fontsize=13)


def _arc_radius(hub):
    """Of theta's arc: half-way between the bore and the pegs."""
    return (hub.bore_radius + hub.pitch_circle_diameter / 2 - hub.peg_radius) / 2


def _draw_screen_axes(ax, hub):
    """Directions of the picture's axes, in the corner."""
    corner = hub.radius * np.array([-1.25, 1.0])
    for step, name in (((0.3, 0.0), "x"), ((0.0, 0.3), "y")):
        end = corner + hub.radius * np.array(step)
        _arrow(ax, corner, end)
        ax.text(*(end + 0.2 * (end - corner)), f"${name}$", fontsize=10, **_CENTERED)
