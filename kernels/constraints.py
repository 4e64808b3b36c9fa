"""Ties: what holds lengths and places of a layout to one another. Seams, straight lines, fixed lengths, symmetry.

Each tie is one equation c(x) = 0 on at most four vertices, held by 1/2 k (c + offset)^2. The stiffness k is finite, so
that the steps stay cheap; the offset grows until c is zero all the same (augmented Lagrangian), and k (c + offset) then is
the tie's force.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Kinds of ties.
LENGTHS = wp.constant(0)
STRAIGHT = wp.constant(1)
LINEAR = wp.constant(2)


@wp.struct
class Seams:
    """Ties.

    ends: #P, vertices: of the first edge, then of the second (LENGTHS); the vertex, then the ends of its line (STRAIGHT).
    kind: #P. LENGTHS: c = l_1 - ratio l_2 - target. STRAIGHT: the distance of the first vertex from the line through the
    second and the third, minus the target. LINEAR: c = sum_j lever_j . x_j - target.
    ratio: #P, of a seam the wished length of the first edge over the second (1, or with ease); 0 for the first edge alone.
    target: #P [m].
    lever: 4 #P, of LINEAR ties; zero for ends that take no part.
    stiffness: #P [N/m].
    offset: #P [m].
    """

    ends: wp.array(dtype=wp.vec4i)
    kind: wp.array(dtype=wp.int32)
    ratio: wp.array(dtype=wp.float64)
    target: wp.array(dtype=wp.float64)
    lever: wp.array(dtype=wp.vec2d)
    stiffness: wp.array(dtype=wp.float64)
    offset: wp.array(dtype=wp.float64)


@wp.struct
class Slope:
    """A tie's c and its gradient by the places of its four ends."""

    miss: wp.float64
    g0: wp.vec2d
    g1: wp.vec2d
    g2: wp.vec2d
    g3: wp.vec2d


@wp.func
def direction(d: wp.vec2d):
    """Unit vector, or zero of a zero vector."""
    length = wp.length(d)
    if length > wp.float64(0.0):
        return d / length
    return wp.vec2d(wp.float64(0.0), wp.float64(0.0))


@wp.func
def slope_of(position: wp.array(dtype=wp.vec2d), seams: Seams, p: int):
    """c and its gradient."""
    e = seams.ends[p]
    x0 = position[e[0]]
    x1 = position[e[1]]
    x2 = position[e[2]]
    x3 = position[e[3]]
    slope = Slope()
    slope.miss = -seams.target[p]
    if seams.kind[p] == LINEAR:
        slope.g0 = seams.lever[4 * p]
        slope.g1 = seams.lever[4 * p + 1]
        slope.g2 = seams.lever[4 * p + 2]
        slope.g3 = seams.lever[4 * p + 3]
        slope.miss += wp.dot(slope.g0, x0) + wp.dot(slope.g1, x1) + wp.dot(slope.g2, x2) + wp.dot(slope.g3, x3)
    elif seams.kind[p] == STRAIGHT:
        chord = x2 - x1
        u = direction(chord)
        across = wp.vec2d(-u[1], u[0])
        share = wp.dot(x0 - x1, u) / wp.max(wp.length(chord), wp.float64(1.0e-300))
        slope.miss += wp.dot(x0 - x1, across)
        slope.g0 = across
        slope.g1 = -(wp.float64(1.0) - share) * across
        slope.g2 = -share * across
    else:
        r = seams.ratio[p]
        u1 = direction(x1 - x0)
        u2 = direction(x3 - x2)
        slope.miss += wp.length(x1 - x0) - r * wp.length(x3 - x2)
        slope.g0 = -u1
        slope.g1 = u1
        slope.g2 = r * u2
        slope.g3 = -r * u2
    return slope


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
    """Forces on the four ends of a tie: minus the gradient of 1/2 k (c + offset)^2, and -h k times its rate.

    position: #V [m]. velocity: #V [m/s]. force, viscosity: 4 #P [N]. stiffness: 4 #P [N/m], at each end
    3/4 k |g_j| sum_i |g_i|, since all ends move at once: by Cauchy and Schwarz the step's matrix has no eigenvalue above
    4/3 (below 2 it is stable).
    """
    p = wp.tid() + first
    e = seams.ends[p]
    slope = slope_of(position, seams, p)
    k = seams.stiffness[p]
    rate = wp.dot(slope.g0, velocity[e[0]]) + wp.dot(slope.g1, velocity[e[1]])
    rate += wp.dot(slope.g2, velocity[e[2]]) + wp.dot(slope.g3, velocity[e[3]])
    pull = -k * (slope.miss + seams.offset[p])
    drag = -time_step * k * rate
    n0 = wp.length(slope.g0)
    n1 = wp.length(slope.g1)
    n2 = wp.length(slope.g2)
    n3 = wp.length(slope.g3)
    bound = wp.float64(0.75) * k * (n0 + n1 + n2 + n3)
    force[4 * p] = slope.g0 * pull
    force[4 * p + 1] = slope.g1 * pull
    force[4 * p + 2] = slope.g2 * pull
    force[4 * p + 3] = slope.g3 * pull
    viscosity[4 * p] = slope.g0 * drag
    viscosity[4 * p + 1] = slope.g1 * drag
    viscosity[4 * p + 2] = slope.g2 * drag
    viscosity[4 * p + 3] = slope.g3 * drag
    stiffness[4 * p] = bound * n0
    stiffness[4 * p + 1] = bound * n1
    stiffness[4 * p + 2] = bound * n2
    stiffness[4 * p + 3] = bound * n3


@wp.kernel
def compute_seam_misses(
    position: wp.array(dtype=wp.vec2d),
    seams: Seams,
    first: int,
    # outputs
    miss: wp.array(dtype=wp.float64),
):
    """c of each tie [m]. position: #V [m]. miss: #P."""
    p = wp.tid() + first
    slope = slope_of(position, seams, p)
    miss[p] = slope.miss
