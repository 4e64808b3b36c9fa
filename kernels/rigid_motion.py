"""Measurement and removal of the rotation of each piece, on devices from which copying arrays would be slow.

See `warpflat.solver.grain_alignment`.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


MOMENTS = 12
"""Number of sums of a block of vertices: w, w x (2), w |x|^2, x (2), f (2), x x f, w v (2), w x x v.

f is the force without the load.
"""


@wp.struct
class Turn:
    """The rotation of each piece (#P).

    centre: of the rotation [m]. by: its angle, as (cos, sin). middle: the weighted centre before [m]. spin: angular
    velocity [rad/s].
    torque: of the cloth, over the inertia.
    """

    centre: wp.array(dtype=wp.vec2d)
    by: wp.array(dtype=wp.vec2d)
    middle: wp.array(dtype=wp.vec2d)
    spin: wp.array(dtype=wp.float64)
    torque: wp.array(dtype=wp.float64)


@wp.func
def cross(a: wp.vec2d, b: wp.vec2d):
    """Return the cross product of two vectors in the plane."""
    return a[0] * b[1] - a[1] * b[0]


@wp.func
def turned(a: wp.vec2d, by: wp.vec2d):
    """Return a turned by an angle of this cosine and sine."""
    return wp.vec2d(by[0] * a[0] - by[1] * a[1], by[1] * a[0] + by[0] * a[1])


@wp.kernel
def sum_moments(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    force: wp.array(dtype=wp.vec2d),
    load: wp.array(dtype=wp.vec2d),
    weight: wp.array(dtype=wp.float64),
    begin: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    moments: wp.array(dtype=wp.float64),
):
    """Sum the moments of each block of vertices.

    position [m], velocity [m/s], force, load [N], weight: #V. begin: #B+1, where blocks begin and the last one ends.
    moments: 12 #B."""
    b = wp.tid() + first
    w = wp.float64(0.0)
    wx = wp.vec2d()
    wxx = wp.float64(0.0)
    place = wp.vec2d()
    pull = wp.vec2d()
    torque = wp.float64(0.0)
    motion = wp.vec2d()
    swing = wp.float64(0.0)
    for i in range(begin[b], begin[b + 1]):
        x = position[i]
        f = force[i] - load[i]
        wv = weight[i] * velocity[i]
        w += weight[i]
        wx += weight[i] * x
        wxx += weight[i] * wp.dot(x, x)
        place += x
        pull += f
        torque += cross(x, f)
        motion += wv
        swing += cross(x, wv)
    at = 12 * b
    moments[at] = w
    moments[at + 1] = wx[0]
    moments[at + 2] = wx[1]
    moments[at + 3] = wxx
    moments[at + 4] = place[0]
    moments[at + 5] = place[1]
    moments[at + 6] = pull[0]
    moments[at + 7] = pull[1]
    moments[at + 8] = torque
    moments[at + 9] = motion[0]
    moments[at + 10] = motion[1]
    moments[at + 11] = swing


@wp.kernel
def turn_pieces(
    weight: wp.array(dtype=wp.float64),
    piece: wp.array(dtype=wp.int32),
    turn: Turn,
    first: int,
    # outputs
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    load: wp.array(dtype=wp.vec2d),
):
    """Turn each piece, remove its angular velocity, and balance the torque of its cloth by the load.

    piece: #V, the piece of each vertex, -1 where its grain is not held. All #V.
    """
    i = wp.tid() + first
    p = piece[i]
    if p >= 0:
        arm = position[i] - turn.middle[p]
        across = wp.vec2d(-arm[1], arm[0])
        position[i] = turn.centre[p] + turned(position[i] - turn.centre[p], turn.by[p])
        velocity[i] = turned(velocity[i] - turn.spin[p] * across, turn.by[p])
        load[i] = -turn.torque[p] * weight[i] * turned(across, turn.by[p])


@wp.kernel
def largest_force_of_blocks(
    position: wp.array(dtype=wp.vec2d),
    force: wp.array(dtype=wp.vec2d),
    load: wp.array(dtype=wp.vec2d),
    weight: wp.array(dtype=wp.float64),
    piece: wp.array(dtype=wp.int32),
    turn: Turn,
    begin: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    least: wp.array(dtype=wp.float64),
):
    """Compute minus the largest squared force in each block, without load and rotation [N2]. Arguments as above."""
    b = wp.tid() + first
    s = wp.float64(0.0)
    for i in range(begin[b], begin[b + 1]):
        f = force[i] - load[i]
        p = piece[i]
        if p >= 0:
            arm = position[i] - turn.middle[p]
            f = f - turn.torque[p] * weight[i] * wp.vec2d(-arm[1], arm[0])
        s = wp.max(s, wp.dot(f, f))
    least[b] = -s
