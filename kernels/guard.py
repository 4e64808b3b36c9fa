"""The thread guard: the energy that keeps the threads of a spring network straight and its faces unfolded.

With it come the shear that the springs of long quads lack, and the hourglass modes of quads.
"""

import warp as wp

from .cells import (
    ACTING,
    CellForces,
    Cells,
    across,
    add_forces,
    add_to_corners,
    cell_places,
    cell_weight,
    clear_corners,
    clear_forces,
    corner_at,
    count_cells,
    edge_matrix,
    on_body,
    turned_left,
)
from .guard_cell import (
    ThreadGuard,
    cell_bounds,
    cell_energy,
    cell_forces,
    check_cell,
    guard_acts,
    guard_energy,
    guarded_cell,
    sheared,
)
from .indices import natural

wp.set_module_options({"enable_backward": False})


@wp.func
def check_face(
    position: wp.array(dtype=wp.vec2d),
    face: wp.vec4i,
    laid: wp.array(dtype=wp.vec3d),
    begin: int,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    isotropic: int,
):
    """Return the least height and the largest flag of `check_cell` over the cells of a face; `begin`: the first."""
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    height2 = wp.float64(0.0)
    near = int(0)
    if face[3] < 0:
        height2, near = check_cell(p0, p1, p2, laid[begin], warp, weft, onset, isotropic)
    else:
        p3 = position[natural(face[3])]
        h0, near0 = check_cell(p3, p0, p1, laid[begin], warp, weft, onset, isotropic)
        h1, near1 = check_cell(p0, p1, p2, laid[natural(begin + 1)], warp, weft, onset, isotropic)
        h2, near2 = check_cell(p1, p2, p3, laid[natural(begin + 2)], warp, weft, onset, isotropic)
        h3, near3 = check_cell(p2, p3, p0, laid[natural(begin + 3)], warp, weft, onset, isotropic)
        height2 = wp.min(wp.min(h0, h1), wp.min(h2, h3))
        near = near0 | near1 | near2 | near3
    return height2, near


@wp.func
def add_viscosity(out: CellForces, slot: int, at: wp.vec3i, v0: wp.vec2d, v1: wp.vec2d, v2: wp.vec2d, drag: wp.vec3d):
    """Add a cell's viscosity; v0 to v2: its corners' velocities [m/s], drag: h k [Ns/m]."""
    v_cell = (drag[0] * v0 + drag[1] * v1 + drag[2] * v2) / wp.max(drag[0] + drag[1] + drag[2], wp.float64(1.0e-300))
    out.viscosity[slot + at[0]] += drag[0] * (v_cell - v0)
    out.viscosity[slot + at[1]] += drag[1] * (v_cell - v1)
    out.viscosity[slot + at[2]] += drag[2] * (v_cell - v2)


@wp.func
def add_hourglass(
    out: CellForces,
    slot: int,
    face: wp.vec4i,
    wave: wp.vec4d,
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    time_step: wp.float64,
    viscous: bool,
):
    """Add what a quad's hourglass mode does to its corners; wave: `Cells.hourglass`."""
    amplitude = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    moving = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    total = wp.float64(0.0)
    for k in range(4):
        amplitude += wave[k] * position[face[k]]
        total += wp.abs(wave[k])
        if viscous:
            moving += wave[k] * velocity[face[k]]
    for k in range(4):
        out.force[slot + k] -= wave[k] * amplitude
        out.stiffness[slot + k] += wp.abs(wave[k]) * total
        if viscous:
            out.viscosity[slot + k] -= (time_step * wave[k]) * moving


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
    face = cells.face[f]
    warp = guard.warp * cells.slack[f][0]
    weft = guard.weft * cells.slack[f][1]
    onset = cells.onset[f]
    begin = natural(cells.first[f])
    height2, any_near = check_face(position, face, cells.laid, begin, warp, weft, onset, guard.isotropic)
    lacks_shear = wp.dot(cells.shear[f], cells.shear[f]) > wp.float64(0.0)
    wave = cells.hourglass[f]
    is_held = wp.dot(wave, wave) > wp.float64(0.0)
    is_strained = any_near != 0 or lacks_shear
    out.acting[f] = wp.int8(wp.where(is_strained or is_held, 1, 0))
    out.clearance[f] = wp.sqrt(height2)
    if not (is_strained or is_held):
        return
    viscous = coefficients[0][0] != wp.float64(0.0)
    clear_corners(out, 4 * f, viscous)
    if is_strained:
        s = sheared(cells.shear[f], warp, weft, cells.slack[f])
        t = sheared(turned_left(cells.shear[f]), warp, weft, cells.slack[f])
        k = int(0)
        end = count_cells(face)
        while k < end:
            at = cell_places(face, k)
            i0 = corner_at(face, at[0])
            i1 = corner_at(face, at[1])
            i2 = corner_at(face, at[2])
            q0 = position[i0]
            q1 = position[i1]
            q2 = position[i2]
            laid = cells.laid[natural(begin + k)]
            cell_height2, near = check_cell(q0, q1, q2, laid, warp, weft, onset, guard.isotropic)
            if near != 0 or (lacks_shear and cell_height2 > wp.float64(0.0)):
                D = edge_matrix(q0, q1, q2)
                cell = guarded_cell(D, laid, warp, weft, onset, s, t, guard)
                pull = cell_forces(cell, onset, s, t, guard) * cell_weight(face)
                bounds = cell_bounds(cell, D, onset, s, t, guard) * cell_weight(face)
                add_to_corners(out, 4 * f, at, pull, bounds)
                if viscous:
                    drag = bounds * time_step
                    add_viscosity(out, 4 * f, at, velocity[i0], velocity[i1], velocity[i2], drag)
            k += 1
    if is_held:
        add_hourglass(out, 4 * f, face, wave, position, velocity, time_step, viscous)


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
    face = cells.face[f]
    warp = guard.warp * cells.slack[f][0]
    weft = guard.weft * cells.slack[f][1]
    onset = cells.onset[f]
    s = wp.vec2d()
    t = wp.vec2d()
    if wp.dot(cells.shear[f], cells.shear[f]) > wp.float64(0.0):
        s = sheared(cells.shear[f], warp, weft, cells.slack[f])
        t = sheared(turned_left(cells.shear[f]), warp, weft, cells.slack[f])
    begin = natural(cells.first[f])
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    if face[3] < 0:
        energy[f] = guard_energy(p0, p1, p2, cells.laid[begin], warp, weft, onset, s, t, guard)
    else:
        p3 = position[natural(face[3])]
        energy[f] = wp.float64(0.5) * (
            guard_energy(p3, p0, p1, cells.laid[begin], warp, weft, onset, s, t, guard)
            + guard_energy(p0, p1, p2, cells.laid[natural(begin + 1)], warp, weft, onset, s, t, guard)
            + guard_energy(p1, p2, p3, cells.laid[natural(begin + 2)], warp, weft, onset, s, t, guard)
            + guard_energy(p2, p3, p0, cells.laid[natural(begin + 3)], warp, weft, onset, s, t, guard)
        )
        wave = cells.hourglass[f]
        if wp.dot(wave, wave) > wp.float64(0.0):
            amplitude = wave[0] * p0 + wave[1] * p1 + wave[2] * p2 + wave[3] * p3
            energy[f] += wp.float64(0.5) * wp.dot(amplitude, amplitude)


@wp.func
def cell_state(
    p0: wp.vec2d,
    p1: wp.vec2d,
    p2: wp.vec2d,
    laid: wp.vec3d,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    isotropic: int,
):
    """Return 2 for a cell that is collapsed or mirrored, 1 for one in which the guard acts, 0 for any other."""
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    if det <= wp.float64(0.0):
        return 2
    if guard_acts(
        on_body(laid, across(D, warp)), on_body(laid, across(D, weft)), det, wp.float64(1.0), onset, isotropic
    ):
        return 1
    return 0


@wp.func
def face_state(
    position: wp.array(dtype=wp.vec2d),
    face: wp.vec4i,
    laid: wp.array(dtype=wp.vec3d),
    begin: int,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    isotropic: int,
):
    """Return the `cell_state` of all cells of a face together, by bits; `begin`: the first."""
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    if face[3] < 0:
        return cell_state(p0, p1, p2, laid[begin], warp, weft, onset, isotropic)
    p3 = position[natural(face[3])]
    return (
        cell_state(p3, p0, p1, laid[begin], warp, weft, onset, isotropic)
        | cell_state(p0, p1, p2, laid[natural(begin + 1)], warp, weft, onset, isotropic)
        | cell_state(p1, p2, p3, laid[natural(begin + 2)], warp, weft, onset, isotropic)
        | cell_state(p2, p3, p0, laid[natural(begin + 3)], warp, weft, onset, isotropic)
    )


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
    face = cells.face[f]
    warp = guard.warp * cells.slack[f][0]
    weft = guard.weft * cells.slack[f][1]
    onset = cells.onset[f]
    begin = natural(cells.first[f])
    state = face_state(position, face, cells.laid, begin, warp, weft, onset, guard.isotropic)
    lacks_shear = wp.dot(cells.shear[f], cells.shear[f]) > wp.float64(0.0)
    wave = cells.hourglass[f]
    is_held = wp.dot(wave, wave) > wp.float64(0.0)
    acts = state == 1 or (state == 0 and (lacks_shear or is_held))
    out.acting[f] = wp.int8(wp.where(acts, 1, 0))
    if not acts:
        energy[f] = wp.where(state > 1, wp.float64(wp.inf), wp.float64(0.0))
        return
    clear_forces(out, 4 * f)
    total = wp.float64(0.0)
    if state == 1 or lacks_shear:
        s = sheared(cells.shear[f], warp, weft, cells.slack[f])
        t = sheared(turned_left(cells.shear[f]), warp, weft, cells.slack[f])
        k = int(0)
        end = count_cells(face)
        while k < end:
            at = cell_places(face, k)
            p0 = position[corner_at(face, at[0])]
            D = edge_matrix(p0, position[corner_at(face, at[1])], position[corner_at(face, at[2])])
            cell = guarded_cell(D, cells.laid[natural(begin + k)], warp, weft, onset, s, t, guard)
            add_forces(out, 4 * f, at, cell_forces(cell, onset, s, t, guard) * cell_weight(face))
            total += cell_energy(cell) * cell_weight(face)
            k += 1
    if is_held:
        amplitude = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
        for k in range(4):
            amplitude += wave[k] * position[face[k]]
        for k in range(4):
            out.force[4 * f + k] -= wave[k] * amplitude
        total += wp.float64(0.5) * wp.dot(amplitude, amplitude)
    energy[f] = total
