"""Approximate implicit integration, paper eqs. (4)-(10) with spring-wise stiffness: two gathers per step, no matrix.

`coefficients`, an array of one vec3d, holds the factors of the viscosity (0 or 1), of the velocity and of its change; with three ones it
is the paper's step.
"""

import warp as wp

from .cells import ACTING, CellForces, Cells
from .indices import natural
from .springs import Springs, sum_spring_viscosity, sum_springs

wp.set_module_options({"enable_backward": False})

# Every vertex may move this share of the least height of the cells around it. If all three corners of a cell approach
# each other, a fifth of its height remains, so no cell can be mirrored before the next check of all.
STEP_SHARE = wp.constant(wp.float64(0.4))


@wp.struct
class Bonds:
    """Further forces on the vertices, and the directions in which they may move.

    offset: #V+1, where each vertex's entries in `slot` begin. slot: into the arrays of the bonds' forces, say of seams.
    freedom: #V, (1, 1) for a free vertex, (0, 1) for one that keeps its x, as on a fold.
    """

    offset: wp.array(dtype=wp.int32)
    slot: wp.array(dtype=wp.int32)
    freedom: wp.array(dtype=wp.vec2d)


@wp.struct
class BondForces:
    """The bonds' forces and viscosities [N], and their stiffnesses [N/m], as `constraints.evaluate_seams` has them."""

    force: wp.array(dtype=wp.vec2d)
    viscosity: wp.array(dtype=wp.vec2d)
    stiffness: wp.array(dtype=wp.float64)


@wp.struct
class VertexForces:
    """What `gather_forces` finds at each vertex, #V.

    force: F [N]. power: F.v / K [m2/s]. driving_force: F~ [N], not written without viscosity, where it is F.
    first_guess: F~ h / (m + h^2 K) [m/s]. stiffness: K, the springs' and the cells' around the vertex [N/m].
    anchor, reach: how far from where it may move until all faces are evaluated again [m].
    guarded: 1 where a face around it acts.
    """

    force: wp.array(dtype=wp.vec2d)
    power: wp.array(dtype=wp.float64)
    driving_force: wp.array(dtype=wp.vec2d)
    first_guess: wp.array(dtype=wp.vec2d)
    stiffness: wp.array(dtype=wp.float64)
    anchor: wp.array(dtype=wp.vec2d)
    reach: wp.array(dtype=wp.float64)
    guarded: wp.array(dtype=wp.int8)


@wp.func
def sum_cells(i: int, cells: Cells, cell_forces: CellForces, viscous: bool):
    """Return the sums at vertex i of the forces, viscosities and stiffnesses of the cells that act; no viscosity unless `viscous`."""
    force = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    drag = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    stiffness = wp.float64(0.0)
    e = natural(cells.offset[i])
    end = cells.offset[i + 1]
    while e < end:
        slot = natural(cells.slot[e])
        if cell_forces.acting[slot / 4] != wp.int8(0):
            force += cell_forces.force[slot]
            stiffness += cell_forces.stiffness[slot]
            if viscous:
                drag += cell_forces.viscosity[slot]
        e += 1
    return force, drag, stiffness


@wp.func
def sum_bonds(i: int, bonds: Bonds, bond_forces: BondForces):
    """Return the sums at vertex i of the forces, viscosities and stiffnesses of its bonds."""
    force = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    drag = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    stiffness = wp.float64(0.0)
    b = natural(bonds.offset[i])
    end = bonds.offset[i + 1]
    while b < end:
        bond = natural(bonds.slot[b])
        force += bond_forces.force[bond]
        drag += bond_forces.viscosity[bond]
        stiffness += bond_forces.stiffness[bond]
        b += 1
    return force, drag, stiffness


@wp.kernel
def gather_forces(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    mass: wp.array(dtype=wp.float64),
    spring_stiffness: wp.array(dtype=wp.float64),
    springs: Springs,
    cells: Cells,
    cell_forces: CellForces,
    bonds: Bonds,
    bond_forces: BondForces,
    load: wp.array(dtype=wp.vec2d),
    time_step: wp.float64,
    coefficients: wp.array(dtype=wp.vec3d),
    scope: int,
    first: int,
    # outputs
    out: VertexForces,
):
    """Gather the force on each vertex, F~ = F + h sum k_ij (v_j - v_i) with viscosity, and eq. (9)'s neighbour term.

    position [m], velocity [m/s], mass [kg], spring_stiffness sum_j k_ij [N/m]: #V. load: #V, constant forces [N].
    scope: that in which the cells were evaluated at these positions; with ACTING anchor, reach and guarded stay what they were.
    """
    i = natural(wp.tid() + first)
    viscosity = coefficients[0][0]
    viscous = viscosity != wp.float64(0.0)
    total = load[i]
    driving = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    k = spring_stiffness[i]
    if springs.active[i] != wp.int8(0):
        _energy, _tension, force = sum_springs(i, position, springs)
        total += force
        if viscous:
            driving = time_step * sum_spring_viscosity(i, velocity, springs)
    if scope != ACTING:
        height = wp.float64(wp.inf)
        acting = wp.int8(0)
        e = natural(cells.offset[i])
        end = cells.offset[i + 1]
        while e < end:
            face = natural(cells.slot[e]) / 4
            height = wp.min(height, cell_forces.clearance[face])
            acting = wp.max(acting, cell_forces.acting[face])
            e += 1
        out.anchor[i] = position[i]
        out.reach[i] = STEP_SHARE * height
        out.guarded[i] = acting
    if out.guarded[i] != wp.int8(0):
        force, drag, stiffness = sum_cells(i, cells, cell_forces, viscous)
        total += force
        driving += drag
        k += stiffness
    force, drag, stiffness = sum_bonds(i, bonds, bond_forces)
    total += force
    driving += drag
    k += stiffness
    total = wp.cw_mul(total, bonds.freedom[i])
    driving = wp.cw_mul(driving, bonds.freedom[i]) * viscosity + total
    out.force[i] = total
    out.power[i] = wp.dot(total, velocity[i]) / k
    if viscosity != wp.float64(0.0):
        out.driving_force[i] = driving
    out.first_guess[i] = driving * (time_step / (mass[i] + time_step * time_step * k))
    out.stiffness[i] = k


@wp.kernel
def gather_potential(
    position: wp.array(dtype=wp.vec2d),
    springs: Springs,
    cells: Cells,
    cell_forces: CellForces,
    bonds: Bonds,
    bond_forces: BondForces,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec2d),
):
    """Gather the force on each vertex at rest, without a load, and the springs' energy of `compute_spring_energy`.

    position: #V [m]. energy: #V [J]. force: #V [N]. Cells and bonds have been evaluated at these positions.
    """
    i = natural(wp.tid() + first)
    stored = wp.float64(0.0)
    total = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    if springs.active[i] != wp.int8(0):
        stored, _tension, total = sum_springs(i, position, springs)
    of_cells, _drag, _stiffness = sum_cells(i, cells, cell_forces, False)
    of_bonds, _viscosity, _k = sum_bonds(i, bonds, bond_forces)
    energy[i] = stored
    force[i] = wp.cw_mul(total + of_cells + of_bonds, bonds.freedom[i])


@wp.func
def stop_vertex(
    i: int,
    mass: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec2d),
    stiffness: wp.array(dtype=wp.float64),
    time_step: wp.float64,
    velocity: wp.array(dtype=wp.vec2d),
    driving_force: wp.array(dtype=wp.vec2d),
    first_guess: wp.array(dtype=wp.vec2d),
):
    """Set the velocity of a vertex to zero, and the results of `gather_forces` to those at zero velocity."""
    velocity[i] = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    driving_force[i] = force[i]
    first_guess[i] = force[i] * (time_step / (mass[i] + time_step * time_step * stiffness[i]))


@wp.kernel
def stop(
    mass: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec2d),
    stiffness: wp.array(dtype=wp.float64),
    time_step: wp.float64,
    first: int,
    # outputs
    velocity: wp.array(dtype=wp.vec2d),
    driving_force: wp.array(dtype=wp.vec2d),
    first_guess: wp.array(dtype=wp.vec2d),
):
    """Set velocities, and the results of `gather_forces`, to those of the state at rest. Arguments as there, all #V."""
    i = natural(wp.tid() + first)
    stop_vertex(i, mass, force, stiffness, time_step, velocity, driving_force, first_guess)


@wp.kernel
def advance(
    mass: wp.array(dtype=wp.float64),
    springs: Springs,
    bonds: Bonds,
    at: VertexForces,
    time_step: wp.float64,
    coefficients: wp.array(dtype=wp.vec3d),
    first: int,
    # outputs
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
):
    """Advance velocities by eq. (10) and positions by eq. (4), with the coefficients.

    dv_i = [F~_i h + h^2 sum_j k_ij F~_j h / (m_j + h^2 K_j)] / (m_i + h^2 K_i).

    A vertex moves no further from its anchor than its reach. Arguments as in `gather_forces`, all #V.
    """
    i = natural(wp.tid() + first)
    coupling = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    s = natural(springs.offset[i])
    end = springs.offset[i + 1]
    while s < end:
        coupling += springs.stiffness[s] * at.first_guess[natural(springs.neighbor[s])]
        s += 1
    driving = at.force[i]
    if coefficients[0][0] != wp.float64(0.0):
        driving = at.driving_force[i]
    h2 = time_step * time_step
    dv = (driving * time_step + h2 * wp.cw_mul(coupling, bonds.freedom[i])) / (mass[i] + h2 * at.stiffness[i])
    v = velocity[i] * coefficients[0][1] + dv * coefficients[0][2]
    here = position[i]
    away = here - at.anchor[i] + v * time_step
    distance = wp.length(away)
    if distance > at.reach[i]:
        v = (at.anchor[i] - here + away * (at.reach[i] / distance)) / time_step
    velocity[i] = v
    position[i] = here + v * time_step
