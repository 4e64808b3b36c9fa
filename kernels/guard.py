"""The thread guard: the energy that keeps the threads of a spring network straight and its faces unfolded.

With it come the shear that the springs of long quads lack, and the hourglass modes of quads.
"""

import warp as wp

from .cells import (
    ACTING,
    FORCES_ALONE,
    CellForces,
    Cells,
    across,
    add_to_corners,
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


@wp.struct
class ThreadGuard:
    """The energy that keeps threads straight and faces unfolded (see `warpflat.model.network`).

    warp, weft: unit vectors in the plane.
    stiffness_warp, stiffness_weft: [N/m].
    isotropic: 1 for a sheet without threads, in which the principal directions of each cell take the place of warp and weft.
    """

    warp: wp.vec2d
    weft: wp.vec2d
    stiffness_warp: wp.float64
    stiffness_weft: wp.float64
    isotropic: int


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
def early_share(det: wp.float64, longest2: wp.float64):
    """Return the share of the onset from which on a cell's stiffness counts.

    It is a half; in slender cells the stiffness always counts. A step can take these from far below the onset to far
    beyond it, and with the springs' stiffness alone they would oscillate for ever.
    """
    if det < SLENDER * longest2:
        return -wp.float64(wp.inf)
    return wp.float64(0.5)


@wp.func
def guard_acts(
    worn_warp: wp.vec2d, worn_weft: wp.vec2d, unit: wp.float64, share: wp.float64, onset: wp.vec2d, isotropic: int
):
    """Return whether a thread is stretched beyond a share of the onset; worn threads as in `is_beyond`."""
    if isotropic != 0:
        return is_beyond_anywhere(worn_warp, worn_weft, unit, share * onset[0])
    return is_beyond(worn_warp, unit, share * onset[0]) or is_beyond(worn_weft, unit, share * onset[1])


@wp.func
def check_cell(
    p0: wp.vec2d,
    p1: wp.vec2d,
    p2: wp.vec2d,
    laid: wp.vec3d,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    isotropic: int,
    scope: int,
):
    """Return the square of a cell's least height [m2], 0 if mirrored, and 1 where the guard acts or is about to."""
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    height2 = wp.float64(0.0)
    near = int(0)
    if det > wp.float64(0.0):
        longest2 = longest_square(D)
        height2 = det * det / longest2
        early = early_share(det, longest2)
        if scope == FORCES_ALONE:
            early = wp.float64(1.0)
        if guard_acts(on_body(laid, across(D, warp)), on_body(laid, across(D, weft)), det, early, onset, isotropic):
            near = int(1)
    return height2, near


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
    scope: int,
):
    """Return the least height and the largest flag of `check_cell` over the cells of a face; `begin`: the first."""
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    height2 = wp.float64(0.0)
    near = int(0)
    if face[3] < 0:
        height2, near = check_cell(p0, p1, p2, laid[begin], warp, weft, onset, isotropic, scope)
    else:
        p3 = position[natural(face[3])]
        h0, near0 = check_cell(p3, p0, p1, laid[begin], warp, weft, onset, isotropic, scope)
        h1, near1 = check_cell(p0, p1, p2, laid[natural(begin + 1)], warp, weft, onset, isotropic, scope)
        h2, near2 = check_cell(p1, p2, p3, laid[natural(begin + 2)], warp, weft, onset, isotropic, scope)
        h3, near3 = check_cell(p2, p3, p0, laid[natural(begin + 3)], warp, weft, onset, isotropic, scope)
        height2 = wp.min(wp.min(h0, h1), wp.min(h2, h3))
        near = near0 | near1 | near2 | near3
    return height2, near


@wp.func
def excess_stretch(worn: wp.vec2d, onset: wp.float64):
    """Return the stretch beyond the onset of a worn thread, a unit vector mapped to `worn`; 0 below it."""
    return wp.max(wp.length(worn) - wp.float64(1.0) - onset, wp.float64(0.0))


@wp.func
def thread_stress(worn: wp.vec2d, thread: wp.vec2d, stiffness: wp.float64, onset: wp.float64):
    """Return d(psi)/dF of psi = 1/2 K max(|F e| - 1 - onset, 0)^2."""
    length = wp.length(worn)
    excess = wp.max(length - wp.float64(1.0) - onset, wp.float64(0.0))
    return wp.outer(worn, thread) * (stiffness * excess / wp.max(length, wp.float64(1.0e-300)))


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
def sheared(shear: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, slack: wp.vec2d):
    """Return `Cells.shear` on the cloth at its intended stretch; warp, weft: unit vectors times the slack."""
    along = wp.dot(shear, warp) / slack[0]
    over = wp.dot(shear, weft) / slack[1]
    return warp * along + weft * over


@wp.func
def guard_bound(
    w: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, q_warp: wp.float64, q_weft: wp.float64, density: wp.float64
):
    """Return a bound, per area, on the second derivative of the guard's energy by a corner's place.

    It is twice the Gauss-Newton part of the second derivative, plus the part due to the change of the area: at least the
    second derivative of a corner that moves alone, and, since the three corners of a cell move at once, enough for the
    step to be stable (eigenvalues of the step's matrix below 2).
    """
    along_warp = wp.dot(w, warp)
    along_weft = wp.dot(w, weft)
    return wp.float64(2.0) * (
        q_warp * along_warp * along_warp + q_weft * along_weft * along_weft + density * wp.dot(w, w)
    )


@wp.func
def shear_bound(w: wp.vec2d, s: wp.vec2d, t: wp.vec2d, back_s: wp.vec2d, back_t: wp.vec2d, bent: wp.float64):
    """Return the bound of `guard_bound` for 1/2 (F s . F t)^2.

    Its second derivative along a unit vector u by the place of the corner, with that of the area, is
    (u . g)^2 + 2 (F s . F t) (w . s) (w . t) |F u|^2 with g = (w . s) F^T F t + (w . t) F^T F s.

    back_s, back_t: F^T F s, F^T F t. bent: |F s . F t| times the square of F's norm.
    """
    along_s = wp.dot(w, s)
    along_t = wp.dot(w, t)
    g = back_t * along_s + back_s * along_t
    return wp.float64(2.0) * (wp.dot(g, g) + bent * (along_s * along_s + along_t * along_t))


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


@wp.func
def guard_on_cell(
    D: wp.mat22d,
    laid: wp.vec3d,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    s: wp.vec2d,
    t: wp.vec2d,
    guard: ThreadGuard,
    bounded: bool,
):
    """Return the forces on corners 1 and 2 of a cell with all of its area, as columns [N], and its bounds, one a corner [N/m].

    D: the cell's edges in the plane. bounded: False leaves the bounds at zero.
    """
    half = wp.float64(0.5)
    area = half * wp.determinant(D)
    inv = wp.inverse(D)
    F = laid_edges(laid) * inv
    along = warp
    over = weft
    if guard.isotropic != 0:
        turn = principal_direction(F * warp, F * weft)
        along = combined(turn, warp, weft)
        over = combined(turned_left(turn), warp, weft)
    worn_warp = F * along
    worn_weft = F * over
    y_warp = excess_stretch(worn_warp, onset[0])
    y_weft = excess_stretch(worn_weft, onset[1])
    worn_s = F * s
    worn_t = F * t
    angle = wp.dot(worn_s, worn_t)
    density = half * (guard.stiffness_warp * y_warp * y_warp + guard.stiffness_weft * y_weft * y_weft)
    P = thread_stress(worn_warp, along, guard.stiffness_warp, onset[0])
    P += thread_stress(worn_weft, over, guard.stiffness_weft, onset[1])
    P += (wp.outer(worn_t, s) + wp.outer(worn_s, t)) * angle
    # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
    inv_t = wp.transpose(inv)
    G = (wp.transpose(F) * P * inv_t - inv_t * (density + half * angle * angle)) * area
    bounds = wp.vec3d()
    if bounded:
        early = early_share(wp.determinant(D), longest_square(D))
        q_warp = thread_curvature(worn_warp, F, guard.stiffness_warp, early * onset[0])
        q_weft = thread_curvature(worn_weft, F, guard.stiffness_weft, early * onset[1])
        if guard.isotropic != 0:
            # The principal directions turn with the cell, against the longer one's excess.
            q_weft = wp.max(q_weft, q_warp * turning_share(worn_warp, worn_weft, y_warp))
        # rows of D^-1 are the gradients of the barycentric weights of corners 1 and 2
        w1 = wp.vec2d(inv[0, 0], inv[0, 1])
        w2 = wp.vec2d(inv[1, 0], inv[1, 1])
        w0 = -(w1 + w2)
        back_s = wp.transpose(F) * worn_s
        back_t = wp.transpose(F) * worn_t
        bent = wp.abs(angle) * wp.ddot(F, F)
        bounds = wp.vec3d(
            guard_bound(w0, along, over, q_warp, q_weft, density) + shear_bound(w0, s, t, back_s, back_t, bent),
            guard_bound(w1, along, over, q_warp, q_weft, density) + shear_bound(w1, s, t, back_s, back_t, bent),
            guard_bound(w2, along, over, q_warp, q_weft, density) + shear_bound(w2, s, t, back_s, back_t, bent),
        )
    return G, bounds * area


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
    scope: ACTING passes over the faces in which the guard did not act; FORCES_ALONE leaves stiffness and viscosity at zero.
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
    height2, any_near = check_face(position, face, cells.laid, begin, warp, weft, onset, guard.isotropic, scope)
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
            cell_height2, near = check_cell(q0, q1, q2, laid, warp, weft, onset, guard.isotropic, scope)
            if near != 0 or (lacks_shear and cell_height2 > wp.float64(0.0)):
                D = edge_matrix(q0, q1, q2)
                bounded = scope != FORCES_ALONE
                pull, bounds = guard_on_cell(D, laid, warp, weft, onset, s, t, guard, bounded)
                add_to_corners(out, 4 * f, at, pull * cell_weight(face), bounds * cell_weight(face))
                if viscous:
                    drag = bounds * (time_step * cell_weight(face))
                    add_viscosity(out, 4 * f, at, velocity[i0], velocity[i1], velocity[i2], drag)
            k += 1
    if is_held:
        add_hourglass(out, 4 * f, face, wave, position, velocity, time_step, viscous)


@wp.func
def guard_energy(
    p0: wp.vec2d,
    p1: wp.vec2d,
    p2: wp.vec2d,
    laid: wp.vec3d,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    s: wp.vec2d,
    t: wp.vec2d,
    guard: ThreadGuard,
):
    """Return the guard's energy of a cell [J], infinite if collapsed or mirrored; s, t: as in `evaluate_guard`."""
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    if det <= wp.float64(0.0):
        return wp.float64(wp.inf)
    worn_warp = on_body(laid, across(D, warp))
    worn_weft = on_body(laid, across(D, weft))
    density = wp.float64(0.0)
    if guard_acts(worn_warp, worn_weft, det, wp.float64(1.0), onset, guard.isotropic):
        if guard.isotropic != 0:
            turn = principal_direction(worn_warp, worn_weft)
            longest = combined(turn, worn_warp, worn_weft)
            worn_weft = combined(turned_left(turn), worn_warp, worn_weft)
            worn_warp = longest
        y_warp = excess_stretch(worn_warp / det, onset[0])
        y_weft = excess_stretch(worn_weft / det, onset[1])
        density = guard.stiffness_warp * y_warp * y_warp + guard.stiffness_weft * y_weft * y_weft
    if wp.dot(s, s) > wp.float64(0.0):
        angle = wp.dot(on_body(laid, across(D, s)), on_body(laid, across(D, t))) / (det * det)
        density += angle * angle
    return wp.float64(0.25) * det * density


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
