"""Seams: pairs of edges, of the same piece or of two, that must become equally long in the pattern."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Seams:
    """Pairs of edges that are sewn together.

    ends: #P, vertices of the first edge, then of the second.
    ratio: #P, wished length of the first over the second (1, or with ease).
    stiffness: #P [N/m].
    offset: #P [m], grows until the lengths agree although the stiffness is finite (augmented Lagrangian).
    """

    ends: wp.array(dtype=wp.vec4i)
    ratio: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)
    offset: wp.array(dtype=wp.float64)


@wp.func
def direction(d: wp.vec2d):
    """Unit vector, or zero of a zero vector."""
    length = wp.length(d)
    if length > wp.float64(0.0):
        return d / length
    return wp.vec2d(wp.float64(0.0), wp.float64(0.0))


@wp.kernel
def evaluate_seams(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    seams: Seams,
    time_step: wp.float64,
    first: int,
    # outputs
    force: wp.array(dtype=wp.vec2d),
    viscosity: wp.array(dtype=wp.vec2d),
    stiffness: wp.array(dtype=wp.float64),
):
    """Forces on the four ends of a pair: minus the gradient of 1/2 k (l_1 - r l_2 + offset)^2, and -h k times its rate.

    position: #V [m]. velocity: #V [m/s]. force, viscosity: 4 #P [N]. stiffness: 4 #P [N/m], thrice the second derivative
    at each end, since all four move at once.
    """
    p = wp.tid() + first
    e = seams.ends[p]
    d1 = position[e[1]] - position[e[0]]
    d2 = position[e[3]] - position[e[2]]
    u1 = direction(d1)
    r = seams.ratio[p]
    u2 = direction(d2) * r
    k = seams.stiffness[p]
    miss = wp.length(d1) - r * wp.length(d2) + seams.offset[p]
    rate = wp.dot(u1, velocity[e[1]] - velocity[e[0]]) - wp.dot(u2, velocity[e[3]] - velocity[e[2]])
    pull = k * miss
    drag = time_step * k * rate
    force[4 * p] = u1 * pull
    force[4 * p + 1] = -u1 * pull
    force[4 * p + 2] = -u2 * pull
    force[4 * p + 3] = u2 * pull
    viscosity[4 * p] = u1 * drag
    viscosity[4 * p + 1] = -u1 * drag
    viscosity[4 * p + 2] = -u2 * drag
    viscosity[4 * p + 3] = u2 * drag
    bound = wp.float64(3.0) * k
    stiffness[4 * p] = bound
    stiffness[4 * p + 1] = bound
    stiffness[4 * p + 2] = bound * r * r
    stiffness[4 * p + 3] = bound * r * r


@wp.kernel
def compute_seam_misses(
    position: wp.array(dtype=wp.vec2d),
    seams: Seams,
    first: int,
    # outputs
    miss: wp.array(dtype=wp.float64),
):
    """l_1 - r l_2 of each pair [m]. position: #V [m]. miss: #P."""
    p = wp.tid() + first
    e = seams.ends[p]
    miss[p] = wp.length(position[e[1]] - position[e[0]]) - seams.ratio[p] * wp.length(position[e[3]] - position[e[2]])
