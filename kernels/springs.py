"""Springs of the mass-spring model: their law, and its sums over the springs around each vertex."""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False})


@wp.struct
class Springs:
    """The springs around each vertex, every spring listed at both of its ends.

    offset: #V+1, where the springs of each vertex begin.
    neighbor: the vertex at the far end.
    rest_length: length on the surface in space [m].
    stiffness: k_ij [N/m].
    active: #V, 1 where the springs are the cloth; 0 in a membrane, whose step matrix consists of their k_ij.
    """

    offset: wp.array(dtype=wp.int32)
    neighbor: wp.array(dtype=wp.int32)
    rest_length: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)
    active: wp.array(dtype=wp.int8)


@wp.func
def spring_law(d: wp.vec2d, rest_length: wp.float64, stiffness: wp.float64):
    """Return a spring's energy 1/2 k (l - L)^2 [J], its tension k (l - L) [N], and the force on its near end [N].

    The force is minus the gradient of the energy, and zero at zero length. d: vector to the far end [m].
    """
    length = wp.sqrt(wp.max(wp.dot(d, d), wp.float64(1.0e-300)))
    stretch = length - rest_length
    tension = stiffness * stretch
    return wp.float64(0.5) * tension * stretch, tension, (tension / length) * d


@wp.func
def sum_springs(i: int, position: wp.array(dtype=wp.vec2d), springs: Springs):
    """Return the energy and the sum of |tension| of the springs from vertex i to later vertices, and the force of all on it.

    So the sums over the vertices count each spring once.
    """
    energy = wp.float64(0.0)
    tension = wp.float64(0.0)
    force = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    here = position[i]
    s = natural(springs.offset[i])
    end = springs.offset[i + 1]
    while s < end:
        there = natural(springs.neighbor[s])
        stored, pull, push = spring_law(position[there] - here, springs.rest_length[s], springs.stiffness[s])
        force += push
        if there > i:
            energy += stored
            tension += wp.abs(pull)
        s += 1
    return energy, tension, force


@wp.func
def sum_spring_viscosity(i: int, velocity: wp.array(dtype=wp.vec2d), springs: Springs):
    """Return sum_j k_ij (v_j - v_i), the viscosity of eq. (7) over the time step [N/s]."""
    viscosity = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    here = velocity[i]
    s = natural(springs.offset[i])
    end = springs.offset[i + 1]
    while s < end:
        viscosity += springs.stiffness[s] * (velocity[natural(springs.neighbor[s])] - here)
        s += 1
    return viscosity


@wp.kernel
def compute_spring_energy(
    position: wp.array(dtype=wp.vec2d),
    springs: Springs,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """Sum 1/2 k (l - L)^2 of each spring at the lower of its vertices; the sum over vertices is the network's energy.

    position: #V [m]. energy: #V [J].
    """
    i = natural(wp.tid() + first)
    stored, _tension, _force = sum_springs(i, position, springs)
    energy[i] = wp.where(springs.active[i] != wp.int8(0), stored, wp.float64(0.0))


@wp.kernel
def compute_spring_tension(
    position: wp.array(dtype=wp.vec2d),
    springs: Springs,
    first: int,
    # outputs
    tension: wp.array(dtype=wp.float64),
):
    """Sum k |l - L| of each spring at the lower of its vertices, also where springs are only the step's matrix.

    position: #V [m]. tension: #V [N].
    """
    i = natural(wp.tid() + first)
    _stored, pull, _force = sum_springs(i, position, springs)
    tension[i] = pull
