"""The cloth as a membrane measured as worn: energy, forces and a bound on their stiffness, per cell.

Warp and weft lie straight in the plane, F = dX/dx maps them to the body, and per flat area of cloth the energy is

    psi = W(e_warp, e_weft) + 1/2 G gamma^2,    e = |F t| - 1,    gamma = F t_warp . F t_weft,

In an isotropic sheet the principal directions of each cell take the place of warp and weft, and gamma is 0.
Here t is a thread's unit vector over the stretch at which it is meant to be worn (1 where none is). W is that of an
orthotropic sheet in plane stress; a J-shaped curve adds what the tension differs from K e; and under compression cloth
wrinkles: W = f W_sheet + (1 - f) W_wrinkled, with W_wrinkled the least energy of any sheet that may shorten freely
(Pipkin 1986). The energy grows without bound as a cell collapses, so that no cell can be mirrored. Threads that have
been sheared by 45 degrees lock: 1/2 K_lock <|gamma| - sin 45>^2 is added, for gamma itself ends at 1, and at no more
than 1/2 G of energy soft cloth would let threads come to lie side by side, and tiny faces of the body would open into
palms of cloth.
"""

import warp as wp

from .cells import (
    ACTING,
    CellForces,
    Cells,
    add_drag,
    add_forces,
    add_to_corners,
    cell_corner,
    cell_places,
    cell_weight,
    clear_corners,
    clear_forces,
    count_cells,
    flat_edges,
    longest_square,
)
from .indices import natural
from .membrane_cell import (
    TINY,
    Cloth,
    bounds_beyond,
    membrane_energy,
    membrane_forces,
    membrane_viscosity,
    pair_bound,
    sheared_threads,
    stretched_sheet,
    thread_bounds,
    worn_cell,
)

wp.set_module_options({"enable_backward": False})


@wp.kernel
def evaluate_membrane(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    time_step: wp.float64,
    coefficients: wp.array(dtype=wp.vec3d),
    scope: int,
    first: int,
    # outputs
    out: CellForces,
):
    """Compute the forces of the membrane, minus the gradient of (flat area) psi, and its stiffness beyond the matrix.

    The approximate implicit step has the k_ij of the springs as its matrix, which bound the membrane's stiffness where
    they were last taken (`bound_membrane`). What a cell has beyond them by now, k = 2 max(bound - held, 0), goes to the
    diagonal.

    The viscosity is h (dF/dx) v of eq. (6) itself, without the part that the change of psi's area adds, which may be
    negative: a cell that moves as a whole is not held back, and one that shears only as much as it is stiff in shear.
    With the k_ij, which are as stiff in every direction as the threads are, soft cloth would lose its momentum and
    creep.

    position: #V [m]. velocity: #V [m/s]. coefficients, scope: as in `guard.evaluate_guard`. out: a face acts unless all of its
    cells are mirrored; a mirrored cell adds nothing.
    """
    f = natural(wp.tid() + first)
    if scope == ACTING and out.acting[f] == wp.int8(0):
        return
    face = cells.face[f]
    begin = natural(cells.first[f])
    slot = 4 * f
    viscous = coefficients[0][0] != wp.float64(0.0)
    acts = int(0)
    least = wp.float64(wp.inf)
    k = int(0)
    count = count_cells(face)
    while k < count:
        corner = cell_corner(face, k)
        D = flat_edges(position, corner)
        det = wp.max(wp.determinant(D), wp.float64(0.0))
        least = wp.min(least, det / wp.max(wp.sqrt(longest_square(D)), TINY))
        if det > wp.float64(0.0):
            if acts == 0:
                clear_corners(out, slot, viscous)
            acts = 1
            cell = worn_cell(D, cells.laid[natural(begin + k)], cloth, cells.slack[f])
            area = wp.float64(0.5) * det * cell_weight(face)
            pull, psi = membrane_forces(cell, area, cloth)
            at = cell_places(face, k)
            add_to_corners(out, slot, at, pull, bounds_beyond(cell, psi, area, 3 * (begin + k), cloth))
            if viscous:
                V = membrane_viscosity(cell, velocity[corner[0]], velocity[corner[1]], velocity[corner[2]], cloth)
                add_drag(out, slot, at, V * (area * time_step))
        k += 1
    out.acting[f] = wp.int8(acts)
    out.clearance[f] = least


@wp.kernel
def evaluate_membrane_potential(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
    out: CellForces,
):
    """Compute the energies of `compute_membrane_energy` and the forces of `evaluate_membrane` at once.

    position: #V [m]. energy: #F [J], infinite with collapsed or mirrored cells. out: `force` of every face, which is `acting`.
    """
    f = natural(wp.tid() + first)
    face = cells.face[f]
    begin = natural(cells.first[f])
    total = wp.float64(0.0)
    clear_forces(out, 4 * f)
    k = int(0)
    count = count_cells(face)
    while k < count:
        D = flat_edges(position, cell_corner(face, k))
        det = wp.determinant(D)
        if det > wp.float64(0.0):
            cell = worn_cell(D, cells.laid[natural(begin + k)], cloth, cells.slack[f])
            area = wp.float64(0.5) * det * cell_weight(face)
            pull, psi = membrane_forces(cell, area, cloth)
            add_forces(out, 4 * f, cell_places(face, k), pull)
            total += area * psi
        else:
            total = wp.float64(wp.inf)
        k += 1
    energy[f] = total
    out.acting[f] = wp.int8(1)


@wp.kernel
def bound_membrane(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    first: int,
    # outputs
    weight: wp.array(dtype=wp.float64),
):
    """Compute each cell's share of the k_ij along its sides, which bound the membrane's stiffness at these positions.

    It is what `warpflat.model.membrane.step_matrix` gives for a cell at rest: cotangents in the metric of the bounds
    along warp and weft, of which negative ones may be left out.

    position: #V [m]. weight: 3 #C, along the sides 0-1, 1-2, 2-0 [N/m]; a mirrored cell's is left as it was.
    """
    f = natural(wp.tid() + first)
    face = cells.face[f]
    begin = natural(cells.first[f])
    k = int(0)
    count = count_cells(face)
    while k < count:
        c = natural(begin + k)
        D = flat_edges(position, cell_corner(face, k))
        det = wp.determinant(D)
        if det > wp.float64(0.0):
            cell = worn_cell(D, cells.laid[c], cloth, cells.slack[f])
            psi = stretched_sheet(cell.e, cloth)[2] + sheared_threads(cell.gamma, cloth)[1]
            q = thread_bounds(cell, cloth)
            area = wp.float64(0.5) * det * cell_weight(face)
            none = wp.float64(0.0)
            weight[3 * c] = wp.max(-area * pair_bound(cell.w0, cell.w1, cell.warp, cell.weft, q, psi), none)
            weight[3 * c + 1] = wp.max(-area * pair_bound(cell.w1, cell.w2, cell.warp, cell.weft, q, psi), none)
            weight[3 * c + 2] = wp.max(-area * pair_bound(cell.w2, cell.w0, cell.warp, cell.weft, q, psi), none)
        k += 1


@wp.kernel
def compute_membrane_energy(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """Compute (flat area) psi per face; position: #V [m], energy: #F [J], infinite with collapsed or mirrored cells."""
    f = natural(wp.tid() + first)
    face = cells.face[f]
    c = natural(cells.first[f])
    warp = cloth.warp * cells.slack[f][0]
    weft = cloth.weft * cells.slack[f][1]
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    if face[3] < 0:
        energy[f] = membrane_energy(p0, p1, p2, cells.laid[c], warp, weft, cloth)
    else:
        p3 = position[natural(face[3])]
        energy[f] = wp.float64(0.5) * (
            membrane_energy(p3, p0, p1, cells.laid[c], warp, weft, cloth)
            + membrane_energy(p0, p1, p2, cells.laid[natural(c + 1)], warp, weft, cloth)
            + membrane_energy(p1, p2, p3, cells.laid[natural(c + 2)], warp, weft, cloth)
            + membrane_energy(p2, p3, p0, cells.laid[natural(c + 3)], warp, weft, cloth)
        )
