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
    active: 1 where the springs are the cloth; 0 with a membrane, whose step matrix consists of their k_ij.
    """

    offset: wp.array(dtype=wp.int32)
    neighbor: wp.array(dtype=wp.int32)
    rest_length: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)
    active: wp.float64


@wp.func
def spring_force(d: wp.vec2d, rest_length: wp.float64, stiffness: wp.float64):
    """Return the force on the near end of a spring, minus the gradient of 1/2 k (l - L)^2; zero at zero length.

    d: vector to the far end [m].
    """
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
    """Return the sum of the spring forces on vertex i, and, if `viscous`, the viscosity of eq. (7) [N].

    The viscosity is h sum_j k_ij (v_j - v_i).

    Both are zero with a membrane, which has forces and viscosity of its own.
    """
    force = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    viscosity = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    if springs.active != wp.float64(0.0):
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
    """Sum 1/2 k (l - L)^2 of each spring at the lower of its vertices; the sum over vertices is the network's energy.

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
    energy[i] = springs.active * total


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
    here = position[i]
    total = wp.float64(0.0)
    s = natural(springs.offset[i])
    end = springs.offset[i + 1]
    while s < end:
        there = natural(springs.neighbor[s])
        if there > i:
            total += springs.stiffness[s] * wp.abs(wp.length(position[there] - here) - springs.rest_length[s])
        s += 1
    tension[i] = total
