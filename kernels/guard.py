"""The thread guard: the energy that keeps the threads of a spring network straight and its faces unfolded.

With it come the shear that the springs of long quads lack, and the hourglass modes of quads. `evaluate_face` has the
whole law of a face; the kernels differ only in what they ask of it.
"""

import warp as wp

from .cells import (
    ACTING,
    ENERGY,
    FORCES,
    STEP,
    CellForces,
    Cells,
    across,
    add_forces,
    add_stiffness,
    cell_places,
    cell_weight,
    clear_corners,
    combined,
    corner_at,
    count_cells,
    edge_matrix,
    laid_edges,
    longest_square,
    on_body,
    principal_direction,
    turned_left,
)
from .indices import natural

wp.set_module_options({"enable_backward": False})

# Height over longest side below which a cell is treated as slender.
SLENDER = wp.constant(wp.float64(0.1))
# States of a cell, and by bits of a face: the guard acts in it; it is collapsed or mirrored.
GUARDED = wp.constant(1)
MIRRORED = wp.constant(2)


@wp.struct
class ThreadGuard:
    """The energy that keeps threads straight and faces unfolded (see `warpflat.flat.model.network`).

    warp, weft: unit vectors in the plane.
    stiffness_warp, stiffness_weft: [N/m].
    onset: worn strain along warp and weft at which the guard begins to act.
    isotropic: 1 for a sheet without threads, in which the principal directions of each cell take the place of warp and weft.
    """

    warp: wp.vec2d
    weft: wp.vec2d
    stiffness_warp: wp.float64
    stiffness_weft: wp.float64
    onset: wp.vec2d
    isotropic: int


@wp.struct
class GuardedFace:
    """What all cells of a face have in common.

    warp, weft: unit vectors times the slack. onset: as `ThreadGuard.onset`.
    s, t: the directions of the shear deficit on the cloth at its intended stretch, at right angles; zero without a deficit.
    """

    warp: wp.vec2d
    weft: wp.vec2d
    onset: wp.vec2d
    s: wp.vec2d
    t: wp.vec2d


@wp.struct
class GuardedCell:
    """A cell as the guard sees it, with its share of the face's area.

    inv: inverse of its edges in the plane [1/m]. F: deformation. area: in the plane [m2].
    along, over: warp and weft, or the principal directions in an isotropic sheet. worn_warp, worn_weft: these, worn.
    y_warp, y_weft: their stretch beyond the onset. worn_s, worn_t: directions of the shear deficit, worn; angle: their product.
    density: energy of the guard per area without that of the shear deficit [J/m2]. energy: of the cell [J].
    """

    inv: wp.mat22d
    F: wp.mat22d
    area: wp.float64
    along: wp.vec2d
    over: wp.vec2d
    worn_warp: wp.vec2d
    worn_weft: wp.vec2d
    y_warp: wp.float64
    y_weft: wp.float64
    worn_s: wp.vec2d
    worn_t: wp.vec2d
    angle: wp.float64
    density: wp.float64
    energy: wp.float64


@wp.func
def is_beyond(worn: wp.vec2d, unit: wp.float64, stretch: wp.float64):
    """Return whether a worn thread, a vector of length `unit` mapped to `worn`, is stretched more than `stretch`."""
    length = (wp.float64(1.0) + stretch) * unit
    return length < wp.float64(0.0) or wp.dot(worn, worn) > length * length


@wp.func
def is_beyond_anywhere(a: wp.vec2d, b: wp.vec2d, unit: wp.float64, stretch: wp.float64):
    """Return `is_beyond` of the longest a v[0] + b v[1] with a unit vector v."""
    length = (wp.float64(1.0) + stretch) * unit
    aa = wp.dot(a, a)
    bb = wp.dot(b, b)
    half = wp.float64(0.5)
    short = length * length - half * (aa + bb)
    product = wp.dot(a, b)
    return (
        length < wp.float64(0.0)
        or short < wp.float64(0.0)
        or half * half * (aa - bb) * (aa - bb) + product * product > short * short
    )


@wp.func
def early_share(D: wp.mat22d):
    """Return the share of the onset from which on a cell's stiffness counts.

    It is a half; in slender cells the stiffness always counts. A step can take these from far below the onset to far
    beyond it, and with the springs' stiffness alone they would oscillate for ever.
    """
    if wp.determinant(D) < SLENDER * longest_square(D):
        return -wp.float64(wp.inf)
    return wp.float64(0.5)


@wp.func
def check_cell(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d, of: GuardedFace, isotropic: int, early: bool):
    """Return a cell's state and the square of its least height [m2], 0 if mirrored.

    early: the guard acts from where its stiffness counts; otherwise from its onset.
    """
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    state = int(MIRRORED)
    height2 = wp.float64(0.0)
    if det > wp.float64(0.0):
        height2 = det * det / longest_square(D)
        share = wp.float64(1.0)
        if early:
            share = early_share(D)
        worn_warp = on_body(laid, across(D, of.warp))
        worn_weft = on_body(laid, across(D, of.weft))
        acts = bool(False)
        if isotropic != 0:
            acts = is_beyond_anywhere(worn_warp, worn_weft, det, share * of.onset[0])
        else:
            acts = is_beyond(worn_warp, det, share * of.onset[0]) or is_beyond(worn_weft, det, share * of.onset[1])
        state = wp.where(acts, GUARDED, 0)
    return state, height2


@wp.func
def check_face(
    position: wp.array(dtype=wp.vec2d),
    face: wp.vec4i,
    laid: wp.array(dtype=wp.vec3d),
    begin: int,
    of: GuardedFace,
    isotropic: int,
    early: bool,
):
    """Return the states and the least height of `check_cell` over the cells of a face; `begin`: the first."""
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    state = int(0)
    height2 = wp.float64(0.0)
    if face[3] < 0:
        state, height2 = check_cell(p0, p1, p2, laid[begin], of, isotropic, early)
    else:
        p3 = position[natural(face[3])]
        state0, h0 = check_cell(p3, p0, p1, laid[begin], of, isotropic, early)
        state1, h1 = check_cell(p0, p1, p2, laid[natural(begin + 1)], of, isotropic, early)
        state2, h2 = check_cell(p1, p2, p3, laid[natural(begin + 2)], of, isotropic, early)
        state3, h3 = check_cell(p2, p3, p0, laid[natural(begin + 3)], of, isotropic, early)
        state = state0 | state1 | state2 | state3
        height2 = wp.min(wp.min(h0, h1), wp.min(h2, h3))
    return state, height2


@wp.func
def sheared(shear: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, slack: wp.vec2d):
    """Return `Cells.shear` on the cloth at its intended stretch; warp, weft: unit vectors times the slack."""
    along = wp.dot(shear, warp) / slack[0]
    over = wp.dot(shear, weft) / slack[1]
    return warp * along + weft * over


@wp.func
def excess_stretch(worn: wp.vec2d, onset: wp.float64):
    """Return the stretch beyond the onset of a worn thread, a unit vector mapped to `worn`; 0 below it."""
    return wp.max(wp.length(worn) - wp.float64(1.0) - onset, wp.float64(0.0))


@wp.func
def guarded_cell(D: wp.mat22d, weight: wp.float64, laid: wp.vec3d, of: GuardedFace, guard: ThreadGuard):
    """Return the cell with the edges D in the plane, of whose area `weight` counts, and its energy."""
    half = wp.float64(0.5)
    cell = GuardedCell()
    cell.area = half * wp.determinant(D) * weight
    cell.inv = wp.inverse(D)
    cell.F = laid_edges(laid) * cell.inv
    cell.along = of.warp
    cell.over = of.weft
    if guard.isotropic != 0:
        turn = principal_direction(cell.F * of.warp, cell.F * of.weft)
        cell.along = combined(turn, of.warp, of.weft)
        cell.over = combined(turned_left(turn), of.warp, of.weft)
    cell.worn_warp = cell.F * cell.along
    cell.worn_weft = cell.F * cell.over
    cell.y_warp = excess_stretch(cell.worn_warp, of.onset[0])
    cell.y_weft = excess_stretch(cell.worn_weft, of.onset[1])
    cell.worn_s = cell.F * of.s
    cell.worn_t = cell.F * of.t
    cell.angle = wp.dot(cell.worn_s, cell.worn_t)
    cell.density = half * (
        guard.stiffness_warp * cell.y_warp * cell.y_warp + guard.stiffness_weft * cell.y_weft * cell.y_weft
    )
    cell.energy = cell.area * (cell.density + half * cell.angle * cell.angle)
    return cell


@wp.func
def cell_forces(cell: GuardedCell, of: GuardedFace, guard: ThreadGuard):
    """Return the forces on corners 1 and 2 of a cell, as columns [N]."""
    tiny = wp.float64(1.0e-300)
    pull_warp = guard.stiffness_warp * cell.y_warp / wp.max(wp.length(cell.worn_warp), tiny)
    pull_weft = guard.stiffness_weft * cell.y_weft / wp.max(wp.length(cell.worn_weft), tiny)
    # P = d(psi)/dF
    P = wp.outer(cell.worn_warp, cell.along) * pull_warp + wp.outer(cell.worn_weft, cell.over) * pull_weft
    P += (wp.outer(cell.worn_t, of.s) + wp.outer(cell.worn_s, of.t)) * cell.angle
    # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
    inv_t = wp.transpose(cell.inv)
    return wp.transpose(cell.F) * P * inv_t * cell.area - inv_t * cell.energy


@wp.func
def thread_curvature(worn: wp.vec2d, F: wp.mat22d, stiffness: wp.float64, onset: wp.float64):
    """Return K |F^T F e|^2 / |F e|^2, or 0 where the guard is not about to act on the thread.

    The gradient of psi's stretch by a corner's place is -(F^T F e / |F e|) (grad w . e) for the barycentric weight w.
    """
    length = wp.length(worn)
    if length - wp.float64(1.0) - onset <= wp.float64(0.0):
        return wp.float64(0.0)
    back = wp.transpose(F) * worn
    return stiffness * wp.dot(back, back) / (length * length)


@wp.func
def turning_share(longer: wp.vec2d, shorter: wp.vec2d, excess: wp.float64):
    """Return the stiffness, over K, with which the longer principal stretch resists what turns the shorter one.

    It is the derivative f / (s + t) + f / (s - t), halved, of the force f = K excess at the stretches s > t.
    """
    square = wp.dot(longer, longer)
    apart = square - wp.dot(shorter, shorter)
    turning = excess * wp.sqrt(square)
    return wp.where(turning < apart, turning / wp.max(apart, wp.float64(1.0e-300)), wp.float64(1.0))


@wp.func
def corner_bound(w: wp.vec2d, cell: GuardedCell, of: GuardedFace, q_warp: wp.float64, q_weft: wp.float64):
    """Return a bound, per area, on the second derivative of the energy by the place of a corner; w: its weight's gradient.

    It is twice the Gauss-Newton part of the second derivative, plus the part due to the change of the area: at least the
    second derivative of a corner that moves alone, and, since the three corners of a cell move at once, enough for the
    step to be stable (eigenvalues of the step's matrix below 2).

    For the deficit, 1/2 (F s . F t)^2, the second derivative along a unit vector u, with that of the area, is
    (u . g)^2 + 2 (F s . F t) (w . s) (w . t) |F u|^2 with g = (w . s) F^T F t + (w . t) F^T F s.
    """
    along_warp = wp.dot(w, cell.along)
    along_weft = wp.dot(w, cell.over)
    along_s = wp.dot(w, of.s)
    along_t = wp.dot(w, of.t)
    g = wp.transpose(cell.F) * (cell.worn_t * along_s + cell.worn_s * along_t)
    bent = wp.abs(cell.angle) * wp.ddot(cell.F, cell.F)
    return wp.float64(2.0) * (
        q_warp * along_warp * along_warp
        + q_weft * along_weft * along_weft
        + cell.density * wp.dot(w, w)
        + wp.dot(g, g)
        + bent * (along_s * along_s + along_t * along_t)
    )


@wp.func
def cell_bounds(cell: GuardedCell, D: wp.mat22d, of: GuardedFace, guard: ThreadGuard):
    """Return bounds on the stiffness of a cell, one a corner [N/m]."""
    early = early_share(D)
    q_warp = thread_curvature(cell.worn_warp, cell.F, guard.stiffness_warp, early * of.onset[0])
    q_weft = thread_curvature(cell.worn_weft, cell.F, guard.stiffness_weft, early * of.onset[1])
    if guard.isotropic != 0:
        # The principal directions turn with the cell, against the longer one's excess.
        q_weft = wp.max(q_weft, q_warp * turning_share(cell.worn_warp, cell.worn_weft, cell.y_warp))
    # rows of D^-1 are the gradients of the barycentric weights of corners 1 and 2
    w1 = wp.vec2d(cell.inv[0, 0], cell.inv[0, 1])
    w2 = wp.vec2d(cell.inv[1, 0], cell.inv[1, 1])
    return cell.area * wp.vec3d(
        corner_bound(-(w1 + w2), cell, of, q_warp, q_weft),
        corner_bound(w1, cell, of, q_warp, q_weft),
        corner_bound(w2, cell, of, q_warp, q_weft),
    )


@wp.func
def add_viscosity(out: CellForces, slot: int, at: wp.vec3i, v0: wp.vec2d, v1: wp.vec2d, v2: wp.vec2d, drag: wp.vec3d):
    """Add a cell's viscosity; v0 to v2: its corners' velocities [m/s], drag: h k [Ns/m]."""
    v_cell = (drag[0] * v0 + drag[1] * v1 + drag[2] * v2) / wp.max(drag[0] + drag[1] + drag[2], wp.float64(1.0e-300))
    out.viscosity[slot + at[0]] += drag[0] * (v_cell - v0)
    out.viscosity[slot + at[1]] += drag[1] * (v_cell - v1)
    out.viscosity[slot + at[2]] += drag[2] * (v_cell - v2)


@wp.func
def evaluate_face(
    f: int,
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    time_step: wp.float64,
    viscous: bool,
    wanted: int,
    out: CellForces,
):
    """Return the energy of a face [J], infinite if a cell is collapsed or mirrored.

    wanted: ENERGY alone; or FORCES, too, written to `out`; or what a STEP takes, which passes over mirrored cells.
    """
    face = cells.face[f]
    begin = natural(cells.first[f])
    slack = cells.slack[f]
    of = GuardedFace()
    of.warp = guard.warp * slack[0]
    of.weft = guard.weft * slack[1]
    of.onset = guard.onset
    state, height2 = check_face(position, face, cells.laid, begin, of, guard.isotropic, wanted == STEP)
    shear = cells.shear[f]
    wave = cells.hourglass[f]
    is_mirrored = (state & MIRRORED) != 0
    is_strained = (state & GUARDED) != 0 or wp.dot(shear, shear) > wp.float64(0.0)
    is_held = wp.dot(wave, wave) > wp.float64(0.0)
    acts = (is_strained or is_held) and (wanted == STEP or not is_mirrored)
    if wanted != ENERGY:
        out.acting[f] = wp.int8(wp.where(acts, 1, 0))
    if wanted == STEP:
        out.clearance[f] = wp.sqrt(height2)
    if not acts:
        return wp.where(is_mirrored, wp.float64(wp.inf), wp.float64(0.0))
    slot = 4 * f
    energy = wp.float64(0.0)
    if wanted != ENERGY:
        clear_corners(out, slot, wanted, viscous)
    if is_strained:
        of.s = sheared(shear, of.warp, of.weft, slack)
        of.t = sheared(turned_left(shear), of.warp, of.weft, slack)
        k = int(0)
        end = count_cells(face)
        while k < end:
            at = cell_places(face, k)
            i0 = corner_at(face, at[0])
            i1 = corner_at(face, at[1])
            i2 = corner_at(face, at[2])
            D = edge_matrix(position[i0], position[i1], position[i2])
            if wp.determinant(D) > wp.float64(0.0):
                cell = guarded_cell(D, cell_weight(face), cells.laid[natural(begin + k)], of, guard)
                energy += cell.energy
                if wanted != ENERGY:
                    add_forces(out.force, slot, at, cell_forces(cell, of, guard))
                if wanted == STEP:
                    bounds = cell_bounds(cell, D, of, guard)
                    add_stiffness(out, slot, at, bounds)
                    if viscous:
                        add_viscosity(out, slot, at, velocity[i0], velocity[i1], velocity[i2], bounds * time_step)
            k += 1
    if is_held:
        amplitude = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
        moving = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
        total = wp.float64(0.0)
        for k in range(4):
            amplitude += wave[k] * position[face[k]]
            total += wp.abs(wave[k])
            if viscous:
                moving += wave[k] * velocity[face[k]]
        energy += wp.float64(0.5) * wp.dot(amplitude, amplitude)
        for k in range(4):
            if wanted != ENERGY:
                out.force[slot + k] -= wave[k] * amplitude
            if wanted == STEP:
                out.stiffness[slot + k] += wp.abs(wave[k]) * total
                if viscous:
                    out.viscosity[slot + k] -= (time_step * wave[k]) * moving
    return energy


@wp.kernel
def evaluate_guard(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    time_step: wp.float64,
    coefficients: wp.array(dtype=wp.vec3d),
    scope: int,
    first: int,
    # outputs
    out: CellForces,
):
    """Compute the forces of the thread guard, minus the gradient of its energy.

    The energy of a cell is a [1/2 K_warp <|F e_warp| - 1 - onset>^2 + the same for weft]; in an isotropic sheet warp
    and weft are the cell's principal directions.

    Added are the energies of the shear deficit of long quads, a 1/2 (F s . F s')^2 with s' at right angles to s =
    `Cells.shear`, and of hourglass modes, 1/2 |sum of hourglass_k p_k|^2.

    a is the flat area of the cell. The energy grows without bound as the cell collapses. Its viscosity, the share of
    the guard in h H v of eq. (6), is taken as -h k (v - v_cell), with v_cell the mean velocity by stiffness, so that a
    cell that moves as a whole is not held back.

    position: #V [m]. velocity: #V [m/s]. coefficients: as `implicit` has it; without viscosity none is written.
    scope: ACTING passes over the faces in which the guard did not act.
    out: a face acts where the guard acts in a cell or is about to, and in long quads; elsewhere the last three are not written.
    """
    f = natural(wp.tid() + first)
    if scope == ACTING and out.acting[f] == wp.int8(0):
        return
    viscous = coefficients[0][0] != wp.float64(0.0)
    _energy = evaluate_face(f, position, velocity, cells, guard, time_step, viscous, STEP, out)


@wp.kernel
def compute_guard_energy(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """Compute the energy of the thread guard per face, with that of shear deficits and hourglass modes.

    position: #V [m]. energy: #F [J], infinite where a cell is collapsed or mirrored.
    """
    f = natural(wp.tid() + first)
    energy[f] = evaluate_face(f, position, position, cells, guard, wp.float64(0.0), False, ENERGY, CellForces())


@wp.kernel
def evaluate_guard_potential(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
    out: CellForces,
):
    """Compute the energies of `compute_guard_energy` and the forces of `evaluate_guard` at once, for minimisers that take both.

    position: #V [m]. energy: #F [J], infinite where a cell is collapsed or mirrored. out: `force` where a face is `acting`.
    """
    f = natural(wp.tid() + first)
    energy[f] = evaluate_face(f, position, position, cells, guard, wp.float64(0.0), False, FORCES, out)
