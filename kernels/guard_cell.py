"""The thread guard in one cell: its energy, its forces and bounds on its stiffness, with the shear that the springs of long quads lack."""

import warp as wp

from .cells import (
    across,
    combined,
    edge_matrix,
    laid_edges,
    longest_square,
    on_body,
    principal_direction,
    turned_left,
)

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
        if guard_acts(on_body(laid, across(D, warp)), on_body(laid, across(D, weft)), det, early, onset, isotropic):
            near = int(1)
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


@wp.struct
class GuardedCell:
    """A cell as the guard sees it.

    inv: inverse of its edges in the plane [1/m]. F: deformation. area: in the plane [m2].
    along, over: warp and weft, or the principal directions in an isotropic sheet. worn_warp, worn_weft: these, worn.
    y_warp, y_weft: their stretch beyond the onset. worn_s, worn_t: directions of the shear deficit, worn; angle: their product.
    density: energy of the guard per area [J/m2].
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


@wp.func
def guarded_cell(
    D: wp.mat22d,
    laid: wp.vec3d,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    s: wp.vec2d,
    t: wp.vec2d,
    guard: ThreadGuard,
):
    """Return the cell with the edges D in the plane."""
    half = wp.float64(0.5)
    cell = GuardedCell()
    cell.area = half * wp.determinant(D)
    cell.inv = wp.inverse(D)
    cell.F = laid_edges(laid) * cell.inv
    cell.along = warp
    cell.over = weft
    if guard.isotropic != 0:
        turn = principal_direction(cell.F * warp, cell.F * weft)
        cell.along = combined(turn, warp, weft)
        cell.over = combined(turned_left(turn), warp, weft)
    cell.worn_warp = cell.F * cell.along
    cell.worn_weft = cell.F * cell.over
    cell.y_warp = excess_stretch(cell.worn_warp, onset[0])
    cell.y_weft = excess_stretch(cell.worn_weft, onset[1])
    cell.worn_s = cell.F * s
    cell.worn_t = cell.F * t
    cell.angle = wp.dot(cell.worn_s, cell.worn_t)
    cell.density = half * (
        guard.stiffness_warp * cell.y_warp * cell.y_warp + guard.stiffness_weft * cell.y_weft * cell.y_weft
    )
    return cell


@wp.func
def cell_energy(cell: GuardedCell):
    """Return the energy of a cell with all of its area [J]."""
    return cell.area * (cell.density + wp.float64(0.5) * cell.angle * cell.angle)


@wp.func
def cell_forces(cell: GuardedCell, onset: wp.vec2d, s: wp.vec2d, t: wp.vec2d, guard: ThreadGuard):
    """Return the forces on corners 1 and 2 of a cell with all of its area, as columns [N]."""
    P = thread_stress(cell.worn_warp, cell.along, guard.stiffness_warp, onset[0])
    P += thread_stress(cell.worn_weft, cell.over, guard.stiffness_weft, onset[1])
    P += (wp.outer(cell.worn_t, s) + wp.outer(cell.worn_s, t)) * cell.angle
    # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
    inv_t = wp.transpose(cell.inv)
    psi = cell.density + wp.float64(0.5) * cell.angle * cell.angle
    return (wp.transpose(cell.F) * P * inv_t - inv_t * psi) * cell.area


@wp.func
def cell_bounds(cell: GuardedCell, D: wp.mat22d, onset: wp.vec2d, s: wp.vec2d, t: wp.vec2d, guard: ThreadGuard):
    """Return bounds on the stiffness of a cell with all of its area, one a corner [N/m]."""
    F = cell.F
    early = early_share(wp.determinant(D), longest_square(D))
    q_warp = thread_curvature(cell.worn_warp, F, guard.stiffness_warp, early * onset[0])
    q_weft = thread_curvature(cell.worn_weft, F, guard.stiffness_weft, early * onset[1])
    if guard.isotropic != 0:
        # The principal directions turn with the cell, against the longer one's excess.
        q_weft = wp.max(q_weft, q_warp * turning_share(cell.worn_warp, cell.worn_weft, cell.y_warp))
    # rows of D^-1 are the gradients of the barycentric weights of corners 1 and 2
    w1 = wp.vec2d(cell.inv[0, 0], cell.inv[0, 1])
    w2 = wp.vec2d(cell.inv[1, 0], cell.inv[1, 1])
    w0 = -(w1 + w2)
    back_s = wp.transpose(F) * cell.worn_s
    back_t = wp.transpose(F) * cell.worn_t
    bent = wp.abs(cell.angle) * wp.ddot(F, F)
    density = cell.density
    along = cell.along
    over = cell.over
    return (
        wp.vec3d(
            guard_bound(w0, along, over, q_warp, q_weft, density) + shear_bound(w0, s, t, back_s, back_t, bent),
            guard_bound(w1, along, over, q_warp, q_weft, density) + shear_bound(w1, s, t, back_s, back_t, bent),
            guard_bound(w2, along, over, q_warp, q_weft, density) + shear_bound(w2, s, t, back_s, back_t, bent),
        )
        * cell.area
    )


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
