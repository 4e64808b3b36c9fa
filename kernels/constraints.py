"""Seams and constraints on the lengths and places of a layout: straight lines, fixed lengths, symmetry.

Each is one equation c(x) = 0 on at most four vertices, with the energy 1/2 k (c + offset)^2. The stiffness k is finite,
so that the steps stay cheap. The offset grows until c is zero (augmented Lagrangian); k (c + offset) is then the
constraint's force.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Kinds of equations.
LENGTHS = wp.constant(0)
STRAIGHT = wp.constant(1)
LINEAR = wp.constant(2)


@wp.struct
class Seams:
    """Seam and constraint equations.

    ends: #P, vertices: of the first edge, then of the second (LENGTHS); the vertex, then the ends of its line
    (STRAIGHT).
    kind: #P. LENGTHS: c = l_1 - ratio l_2 - target. STRAIGHT: the distance of the first vertex from the line through
    the second and the third, minus the target. LINEAR: c = sum_j coefficient_j . x_j - target.
    ratio: #P, for a seam the intended length of the first edge over the second (1, or with ease); 0 for the first edge
    alone.
    target: #P [m].
    coefficient: 4 #P, of LINEAR equations; zero for ends that take no part.
    stiffness: #P [N/m].
    offset: #P [m].
    """

    ends: wp.array(dtype=wp.vec4i)
    kind: wp.array(dtype=wp.int32)
    ratio: wp.array(dtype=wp.float64)
    target: wp.array(dtype=wp.float64)
    coefficient: wp.array(dtype=wp.vec2d)
    stiffness: wp.array(dtype=wp.float64)
    offset: wp.array(dtype=wp.float64)


@wp.struct
class Gradient:
    """An equation's residual c, and its gradient by the places of its four ends."""

    residual: wp.float64
    g0: wp.vec2d
    g1: wp.vec2d
    g2: wp.vec2d
    g3: wp.vec2d


@wp.func
def direction(d: wp.vec2d):
    """Return the unit vector along d, or zero for a zero vector."""
    length = wp.length(d)
    if length > wp.float64(0.0):
        return d / length
    return wp.vec2d(wp.float64(0.0), wp.float64(0.0))


@wp.func
def gradient_of(position: wp.array(dtype=wp.vec2d), seams: Seams, p: int):
    """Return c of equation p, and its gradient."""
    e = seams.ends[p]
    x0 = position[e[0]]
    x1 = position[e[1]]
    x2 = position[e[2]]
    x3 = position[e[3]]
    gradient = Gradient()
    gradient.residual = -seams.target[p]
    if seams.kind[p] == LINEAR:
        gradient.g0 = seams.coefficient[4 * p]
        gradient.g1 = seams.coefficient[4 * p + 1]
        gradient.g2 = seams.coefficient[4 * p + 2]
        gradient.g3 = seams.coefficient[4 * p + 3]
        gradient.residual += (
            wp.dot(gradient.g0, x0) + wp.dot(gradient.g1, x1) + wp.dot(gradient.g2, x2) + wp.dot(gradient.g3, x3)
        )
    elif seams.kind[p] == STRAIGHT:
        chord = x2 - x1
        u = direction(chord)
        across = wp.vec2d(-u[1], u[0])
        share = wp.dot(x0 - x1, u) / wp.max(wp.length(chord), wp.float64(1.0e-300))
        gradient.residual += wp.dot(x0 - x1, across)
        gradient.g0 = across
        gradient.g1 = -(wp.float64(1.0) - share) * across
        gradient.g2 = -share * across
    else:
        r = seams.ratio[p]
        u1 = direction(x1 - x0)
        u2 = direction(x3 - x2)
        gradient.residual += wp.length(x1 - x0) - r * wp.length(x3 - x2)
        gradient.g0 = -u1
        gradient.g1 = u1
        gradient.g2 = r * u2
        gradient.g3 = -r * u2
    return gradient


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
    """Compute forces and viscosity on the four ends of an equation.

    Forces are minus the gradient of 1/2 k (c + offset)^2, viscosity is -h k times the rate of c.

    position: #V [m]. velocity: #V [m/s]. force, viscosity: 4 #P [N]. stiffness: 4 #P [N/m], at each end
    3/4 k |g_j| sum_i |g_i|, since all ends move at once: by Cauchy and Schwarz the step's matrix has no eigenvalue
    above 4/3 (below 2 it is stable).
    """
    p = wp.tid() + first
    e = seams.ends[p]
    gradient = gradient_of(position, seams, p)
    k = seams.stiffness[p]
    rate = wp.dot(gradient.g0, velocity[e[0]]) + wp.dot(gradient.g1, velocity[e[1]])
    rate += wp.dot(gradient.g2, velocity[e[2]]) + wp.dot(gradient.g3, velocity[e[3]])
    pull = -k * (gradient.residual + seams.offset[p])
    drag = -time_step * k * rate
    n0 = wp.length(gradient.g0)
    n1 = wp.length(gradient.g1)
    n2 = wp.length(gradient.g2)
    n3 = wp.length(gradient.g3)
    bound = wp.float64(0.75) * k * (n0 + n1 + n2 + n3)
    force[4 * p] = gradient.g0 * pull
    force[4 * p + 1] = gradient.g1 * pull
    force[4 * p + 2] = gradient.g2 * pull
    force[4 * p + 3] = gradient.g3 * pull
    viscosity[4 * p] = gradient.g0 * drag
    viscosity[4 * p + 1] = gradient.g1 * drag
    viscosity[4 * p + 2] = gradient.g2 * drag
    viscosity[4 * p + 3] = gradient.g3 * drag
    stiffness[4 * p] = bound * n0
    stiffness[4 * p + 1] = bound * n1
    stiffness[4 * p + 2] = bound * n2
    stiffness[4 * p + 3] = bound * n3


@wp.kernel
def compute_seam_residuals(
    position: wp.array(dtype=wp.vec2d),
    seams: Seams,
    first: int,
    # outputs
    residual: wp.array(dtype=wp.float64),
):
    """Compute c of each equation. position: #V [m]. residual: #P [m]."""
    p = wp.tid() + first
    gradient = gradient_of(position, seams, p)
    residual[p] = gradient.residual
