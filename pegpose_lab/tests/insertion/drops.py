"""A wheel pushed onto pegs in MuJoCo: the same holes and chamfers as rings of boxes, a compliant hand, dry friction.

Lengths are mm and the wheel weighs 1; the hand pushes with a constant force along the wheel's axis, and gives way sideways
and to a turn about it far more easily than to a tilt, as a remote centre compliance does.
"""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

FACETS = 32  # of a hole: the polygon is within 0.02 mm of the circle
WALL = 4.0  # mm, of the boxes
PUSH = 400.0
SPEED = 20.0  # mm/s, at which damping balances the push
START = 0.3  # mm before the wheel's face reaches the foremost peg
STEP = 0.002  # s
SECONDS = 0.9
ENTERED = 1.0  # mm of every peg in the straight part of its hole


def model_of(hub, wheel, friction):
    """The compiled model; the wheel's pose is set for each drop."""
    pegs = "".join(
        f'<geom type="cylinder" size="{hub.peg_radius} {hub.peg_height / 2}" pos="{x} {y} {hub.peg_height / 2}"/>'
        for x, y, _ in hub.peg_centers
    )
    radius, chamfer = hub.peg_radius + wheel.clearance, wheel.chamfer
    rings = (  # radius and height of the middle of the inner face, its tilt, and half of its height
        (radius, -(chamfer + wheel.thickness) / 2, 0.0, (wheel.thickness - chamfer) / 2),
        (radius + chamfer / 2, -chamfer / 2, np.pi / 4, chamfer / np.sqrt(2)),
        (radius + chamfer, -WALL / 4, 0.0, WALL / 4),
    )
    boxes = "".join(
        _box(center, inner, z, tilt, height, angle)
        for center in wheel.hole_centers
        for inner, z, tilt, height in rings
        for angle in 2 * np.pi * np.arange(FACETS) / FACETS
    )
    stiff, soft, inertia = PUSH * 48 / 0.0005, PUSH * 48 / 0.1, 1000.0
    joints = "".join(
        f'<joint type="{kind}" axis="{axis}" stiffness="{stiffness}" damping="{damping}"/>'
        for kind, axis, stiffness, damping in (
            ("slide", "1 0 0", PUSH / 5, PUSH / SPEED),
            ("slide", "0 1 0", PUSH / 5, PUSH / SPEED),
            ("slide", "0 0 1", 0.0, PUSH / SPEED),
            ("hinge", "1 0 0", stiff, 2 * np.sqrt(stiff * inertia)),
            ("hinge", "0 1 0", stiff, 2 * np.sqrt(stiff * inertia)),
            ("hinge", "0 0 1", soft, 2 * np.sqrt(soft * inertia)),
        )
    )
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <compiler autolimits="true" angle="radian"/>
      <option timestep="{STEP}" gravity="0 0 0" integrator="implicitfast" cone="elliptic"/>
      <default><geom friction="{friction} 0 0" condim="3" solref="0.005 1" solimp="0.99 0.999 0.001"/></default>
      <worldbody>
        {pegs}
        <body name="wheel">
          <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
          {joints}{boxes}
        </body>
      </worldbody>
    </mujoco>""")


def _box(center, inner, z, tilt, height, angle):
    """One facet: a box whose inner face has its middle at (inner, z) and is tilted outwards towards the hub."""
    inner = inner * (1 - (np.pi / FACETS) ** 2 / 6)  # the polygon's mean radius is the circle's
    turn = Rotation.from_euler("ZY", [angle, tilt])
    outwards = turn.apply([1.0, 0.0, 0.0])
    place = np.array([*center, z]) + inner * np.array([np.cos(angle), np.sin(angle), 0]) + WALL / 2 * outwards
    x, y, z, w = turn.as_quat()
    half = (inner + 2 * WALL) * np.tan(np.pi / FACETS)
    return (
        f'<geom type="box" size="{WALL / 2} {half} {height}" pos="{place[0]} {place[1]} {place[2]}" '
        f'quat="{w} {x} {y} {z}"/>'
    )


def enters(model, hub_from_wheel, hub, wheel):
    """Whether every peg of the hub comes into the straight part of its hole."""
    tops = hub_from_wheel.inv().apply(hub.peg_centers)
    back = hub_from_wheel.apply([0.0, 0.0, tops[:, 2].min() - START])  # the face just before the foremost peg
    body = model.body("wheel").id
    model.body_pos[body] = back
    model.body_quat[body] = np.roll(hub_from_wheel.rotation.as_quat(), 1)
    data = mujoco.MjData(model)
    data.qfrc_applied[2] = PUSH
    for _ in range(round(SECONDS / STEP)):
        mujoco.mj_step(model, data)
        turn = data.xmat[body].reshape(3, 3)
        depths = -((hub.peg_centers - data.xpos[body]) @ turn)[:, 2]
        if depths.min() > wheel.chamfer + ENTERED:
            return True
    return False
