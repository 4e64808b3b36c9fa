"""Springs of the mass-spring model: forces, viscosity, energy, gathered per vertex."""

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
    pull: 1 where the springs are the cloth, 0 where a membrane is and their k_ij only are the matrix of the step.
    """

    offset: wp.array(dtype=wp.int32)
    neighbor: wp.array(dtype=wp.int32)
    rest_length: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)
    pull: wp.float64


@wp.func
def spring_force(d: wp.vec2d, rest_length: wp.float64, stiffness: wp.float64):
    """Force on the near end of a spring, d the vector to its far end: -grad of 1/2 k (l - L)^2. Zero at zero length."""
    length = wp.sqrt(wp.max(wp.dot(d, d), wp.float64(1.0e-300)))
    return stiffness * (wp.float64(1.0) - rest_length / length) * d


@wp.func
def spring_forces_on(
    i: int,
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    springs: Springs,
    time_step: wp.float64,
    viscous: bool,
):
    """Sum of the spring forces on vertex i, and, if it is asked for, paper, eq. (7) with spring-wise stiffness: h sum_j k_ij (v_j - v_i)
    [N]; a membrane has forces and viscosity of its own."""
    force = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    viscosity = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    if springs.pull != wp.float64(0.0):
        here = position[i]
        s = natural(springs.offset[i])
        end = springs.offset[i + 1]
        if viscous:
            moving = velocity[i]
            while s < end:
                there = natural(springs.neighbor[s])
                stiffness = springs.stiffness[s]
                force += spring_force(position[there] - here, springs.rest_length[s], stiffness)
                viscosity += stiffness * (velocity[there] - moving)
                s += 1
        while s < end:
            there = natural(springs.neighbor[s])
            force += spring_force(position[there] - here, springs.rest_length[s], springs.stiffness[s])
            s += 1
    return force, time_step * viscosity


@wp.kernel
def compute_spring_energy(
    position: wp.array(dtype=wp.vec2d),
    springs: Springs,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """1/2 k (l - L)^2 of each spring, at the lower of its vertices, so that the sum over vertices is the network's.

    position: #V [m]. energy: #V [J].
    """
    i = natural(wp.tid() + first)
    here = position[i]
    total = wp.float64(0.0)
    s = natural(springs.offset[i])
    end = springs.offset[i + 1]
    while s < end:
        there = natural(springs.neighbor[s])
        if there > i:
            stretch = wp.length(position[there] - here) - springs.rest_length[s]
            total += wp.float64(0.5) * springs.stiffness[s] * stretch * stretch
        s += 1
    energy[i] = springs.pull * total


@wp.kernel
def compute_spring_pull(
    position: wp.array(dtype=wp.vec2d),
    springs: Springs,
    first: int,
    # outputs
    pull: wp.array(dtype=wp.float64),
):
    """k |l - L| of each spring, at the lower of its vertices, whether springs pull or are but the step's matrix.

    position: #V [m]. pull: #V [N].
    """
    i = natural(wp.tid() + first)
    here = position[i]
    total = wp.float64(0.0)
    s = natural(springs.offset[i])
    end = springs.offset[i + 1]
    while s < end:
        there = natural(springs.neighbor[s])
        if there > i:
            total += springs.stiffness[s] * wp.abs(wp.length(position[there] - here) - springs.rest_length[s])
        s += 1
    pull[i] = total
