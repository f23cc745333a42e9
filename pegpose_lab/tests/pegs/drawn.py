"""Drawn rings whose truth is known: discs of a pattern in perspective, on plain or textured ground."""

import cv2
import numpy as np

SIZE = (640, 480)


def homography(pattern, rng, *, tilt=40.0, radius=140.0, turn=None):
    """A random view (3, 3) of a pattern whose pitch circle has about that radius, px; `tilt` in degrees at most."""
    angle = rng.uniform(0, 2 * np.pi) if turn is None else turn
    lean, azimuth = np.deg2rad(rng.uniform(0, tilt)), rng.uniform(0, 2 * np.pi)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    spin = cv2.Rodrigues(lean * axis)[0] @ cv2.Rodrigues(np.array([0, 0, angle]))[0]
    distance = 6.0
    camera = np.array([[radius * distance, 0, 320 + rng.uniform(-20, 20)], [0, radius * distance, 240], [0, 0, 1]])
    unit = np.diag([1 / pattern.scale, 1 / pattern.scale, 1])
    return camera @ np.column_stack([spin[:, 0], spin[:, 1], [0, 0, distance]]) @ unit


def images_of(h, points):
    """Images (n, 2) of points of the pattern's plane."""
    full = np.column_stack([points, np.ones(len(points))]) @ h.T
    return full[:, :2] / full[:, 2:]


def ellipse_centers(h, points, radius):
    """Centres (n, 2) of the images of circles."""
    centers = []
    for x, y in points:
        frame = h @ np.array([[radius, 0, x], [0, radius, y], [0, 0, 1]])
        dual = frame @ np.diag([1.0, 1.0, -1.0]) @ frame.T
        centers.append(dual[:2, 2] / dual[2, 2])
    return np.array(centers)


def drawn(discs, h, *, ground=90.0, noise=3.0, blur=0.9, rng=0, size=SIZE, texture=0.0):
    """A picture (height, width) of discs (x, y, radius, grey value) in a plane seen through the homography `h`."""
    rng = np.random.default_rng(rng)
    y, x = np.mgrid[: size[1], : size[0]].astype(float)
    full = np.dstack([x, y, np.ones_like(x)]) @ np.linalg.inv(h).T
    plane = full[:, :, :2] / full[:, :, 2:]
    image = np.full(size[::-1], float(ground))
    if texture:
        image += cv2.GaussianBlur(rng.normal(0, texture, size[::-1]), (0, 0), 2.0) * 7
    step = np.hypot(*(np.diff(plane, axis=1, prepend=plane[:, :1] - plane[:, 1:2] + plane[:, :1]).transpose(2, 0, 1)))
    for cx, cy, radius, value in discs:
        inside = np.hypot(plane[:, :, 0] - cx, plane[:, :, 1] - cy) - radius
        image += (value - image) * np.clip(0.5 - inside / step, 0, 1)
    image = cv2.GaussianBlur(image, (0, 0), blur) + rng.normal(0, noise, image.shape)
    return np.clip(image.round(), 0, 255).astype(np.uint8)


def ring_discs(pattern, values, missing=()):
    """Discs of a pattern's places, with one grey value or one for each; without the missing ones."""
    values = np.broadcast_to(values, pattern.n_places)
    return [
        (x, y, pattern.disc_radius, value)
        for k, ((x, y), value) in enumerate(zip(pattern.places, values, strict=True))
        if k not in missing
    ]
