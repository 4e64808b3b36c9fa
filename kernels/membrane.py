"""The cloth as a membrane measured as worn: energy, forces and a bound on their stiffness, per cell.

Warp and weft lie straight in the plane, F = dX/dx maps them to the body, and per flat area of cloth the energy is

    psi = W(e_warp, e_weft) + 1/2 G gamma^2 + 1/2 K_lock <|gamma| - gamma_on>^2,    e = |F t| - 1,    gamma = F t_warp . F t_weft.

t is a thread's unit vector over the stretch at which it is meant to be worn (1 where none is). In an isotropic sheet
the principal directions of each cell take the place of warp and weft, and gamma is 0.

W is that of an orthotropic sheet in plane stress. A J-shaped curve adds the difference between its tension and K e.
Under compression cloth wrinkles: W = f W_sheet + (1 - f) W_wrinkled, with W_wrinkled the least energy of any sheet that
may shorten freely (Pipkin 1986).

The energy grows without bound as a cell collapses, so that no cell can be mirrored. Threads that have been sheared as far as
the fabric lets them lie against each other and lock, from gamma_on on, the sine of that angle. gamma cannot exceed 1, so G alone would
resist full shear with at most 1/2 G per area. Threads of soft cloth would then come to lie side by side, and a tiny face of the
body would become a hand's breadth of cloth.
"""

import warp as wp

from .cells import (
    ACTING,
    ENERGY,
    FORCES,
    STEP,
    CellForces,
    Cells,
    add_forces,
    add_stiffness,
    cell_corner,
    cell_places,
    cell_weight,
    clear_corners,
    count_cells,
    flat_edges,
    longest_square,
)
from .indices import natural
from .membrane_cell import TINY, Cloth, WornCell, membrane_forces, membrane_viscosity, pair_bound, worn_cell

wp.set_module_options({"enable_backward": False})


@wp.func
def evaluate_face(
    f: int,
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    time_step: wp.float64,
    viscous: bool,
    wanted: int,
    out: CellForces,
):
    """Return the energy of a face [J], infinite if a cell is collapsed or mirrored.

    wanted: ENERGY alone; or FORCES, too, written to `out`; or what a STEP takes. A mirrored cell adds nothing to these.
    """
    face = cells.face[f]
    begin = natural(cells.first[f])
    slot = 4 * f
    energy = wp.float64(0.0)
    least = wp.float64(wp.inf)
    acts = int(0)
    if wanted != ENERGY:
        clear_corners(out, slot, wanted, viscous)
    k = int(0)
    count = count_cells(face)
    while k < count:
        corner = cell_corner(face, k)
        at = cell_places(face, k)
        D = flat_edges(position, corner)
        det = wp.max(wp.determinant(D), wp.float64(0.0))
        least = wp.min(least, det / wp.max(wp.sqrt(longest_square(D)), TINY))
        if det > wp.float64(0.0):
            acts = 1
            cell = worn_cell(D, cells.laid[natural(begin + k)], cloth, cells.slack[f])
            area = wp.float64(0.5) * det * cell_weight(face)
            energy += area * cell.law.energy
            if wanted != ENERGY:
                add_forces(out.force, slot, at, membrane_forces(cell) * area)
            if wanted == STEP:
                none = wp.float64(0.0)
                held = natural(3 * (begin + k))
                beyond = wp.vec3d(
                    wp.max(area * pair_bound(cell, cell.w0, cell.w0) - cloth.held[held], none),
                    wp.max(area * pair_bound(cell, cell.w1, cell.w1) - cloth.held[held + 1], none),
                    wp.max(area * pair_bound(cell, cell.w2, cell.w2) - cloth.held[held + 2], none),
                )
                add_stiffness(out, slot, at, wp.float64(2.0) * beyond)
                if viscous:
                    V = membrane_viscosity(cell, velocity[corner[0]], velocity[corner[1]], velocity[corner[2]], cloth)
                    add_forces(out.viscosity, slot, at, V * (area * time_step))
        else:
            energy = wp.float64(wp.inf)
        k += 1
    if wanted != ENERGY:
        out.acting[f] = wp.int8(acts)
    if wanted == STEP:
        out.clearance[f] = least
    return energy


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
    viscous = coefficients[0][0] != wp.float64(0.0)
    _energy = evaluate_face(f, position, velocity, cells, cloth, time_step, viscous, STEP, out)


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

    position: #V [m]. energy: #F [J], infinite with collapsed or mirrored cells. out: `force` where a face is `acting`.
    """
    f = natural(wp.tid() + first)
    energy[f] = evaluate_face(f, position, position, cells, cloth, wp.float64(0.0), False, FORCES, out)


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

    It is what `warpflat.flat.model.membrane.step_matrix` gives for a cell at rest: cotangents in the metric of the bounds
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
            area = wp.float64(0.5) * det * cell_weight(face)
            none = wp.float64(0.0)
            weight[3 * c] = wp.max(-area * pair_bound(cell, cell.w0, cell.w1), none)
            weight[3 * c + 1] = wp.max(-area * pair_bound(cell, cell.w1, cell.w2), none)
            weight[3 * c + 2] = wp.max(-area * pair_bound(cell, cell.w2, cell.w0), none)
        k += 1


@wp.func
def second_derivative(cell: WornCell, cloth: Cloth):
    """Return the second derivative of det(I + A) psi(F (I + A)^-1) by A = du/dx at A = 0, rows and columns A00, A01, A10, A11 [N/m].

    With S = F^T P, P = d(psi)/dF, it is, for A along B, that of psi by the worn threads, - tr A (S : B) - tr B (S : A)
    + tr(S^T (A B + B A)) + psi (tr A tr B - tr(A B)). In an isotropic sheet the principal directions are held: what they turn with A
    is left out, so that it is not that of the energy there.
    """
    law = cell.law
    back = wp.transpose(cell.F)
    unit = wp.identity(n=2, dtype=wp.float64)
    u = cell.worn_warp / cell.length_warp
    v = cell.worn_weft / cell.length_weft
    a = law.sigma[0] / cell.length_warp
    b = law.sigma[1] / cell.length_weft
    shear = cloth.shear + law.locked
    ww = wp.outer(u, u) * (law.slope[0] - a) + unit * a + wp.outer(cell.worn_weft, cell.worn_weft) * shear
    ff = wp.outer(v, v) * (law.slope[1] - b) + unit * b + wp.outer(cell.worn_warp, cell.worn_warp) * shear
    wf = wp.outer(u, v) * law.slope[2] + unit * law.tau + wp.outer(cell.worn_weft, cell.worn_warp) * shear
    ww = back * ww * cell.F
    ff = back * ff * cell.F
    wf = back * wf * cell.F
    P = wp.outer(cell.worn_warp * a + cell.worn_weft * law.tau, cell.warp)
    P += wp.outer(cell.worn_weft * b + cell.worn_warp * law.tau, cell.weft)
    S = back * P
    found = wp.mat44d()
    for m in range(4):
        i = m / 2
        p = m % 2
        for n in range(4):
            j = n / 2
            q = n % 2
            value = ww[i, j] * cell.warp[p] * cell.warp[q] + ff[i, j] * cell.weft[p] * cell.weft[q]
            value += wf[i, j] * cell.warp[p] * cell.weft[q] + wf[j, i] * cell.weft[p] * cell.warp[q]
            if i == p:
                value -= S[j, q]
            if j == q:
                value -= S[i, p]
            if p == j:
                value += S[i, q]
            if q == i:
                value += S[j, p]
            if i == p and j == q:
                value += law.energy
            if i == q and j == p:
                value -= law.energy
            found[m, n] = value
    return found


@wp.kernel
def differentiate_membrane(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    first: int,
    # outputs
    second: wp.array(dtype=wp.mat44d),
    gradient: wp.array(dtype=wp.mat22d),
):
    """Compute the second derivative of each cell's energy by the gradient of a displacement [J], and its corners' weight gradients.

    position: #V [m]. second: #C, as of `second_derivative`, times the cell's area. gradient: #C, of corners 1 and 2 as rows [1/m]. Of a
    mirrored cell both are left as they were.
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
            second[c] = second_derivative(cell, cloth) * (wp.float64(0.5) * det * cell_weight(face))
            gradient[c] = cell.inv
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
    energy[f] = evaluate_face(f, position, position, cells, cloth, wp.float64(0.0), False, ENERGY, CellForces())
