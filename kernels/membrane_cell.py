"""The membrane in one cell: its law, its energy, forces and viscosity, and bounds on its stiffness (see `membrane`)."""

import warp as wp

from .cells import (
    across,
    combined,
    edge_matrix,
    laid_edges,
    on_body,
    principal_direction,
    turned_left,
)
from .indices import natural

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float64(1.0e-300))
# Warp and weft of cloth lock, thread against thread, at shear angles of 30 to 60 degrees; taken as 45.
LOCKED = wp.constant(wp.float64(0.7071067811865476))


@wp.struct
class Cloth:
    """The fabric, and its stiffness in the step's matrix.

    warp, weft: unit vectors in the plane.
    isotropic: 1 for a sheet without threads.
    c_warp, c_weft, c_cross, shear: plane stress [N/m].
    k_warp, k_weft: K, the stiffness of a strip along one thread [N/m].
    lock: K_lock, what locked threads add to G [N/m].
    compression: f, stiffness under compression over that under tension.
    strain_warp, tension_warp, strain_weft, tension_weft: points of the curves, the first at 0 [1, N/m]; beyond the last
    they go on straight.
    held: 3 #C, the share of each cell's corner in the sum of k_ij around the vertex [N/m].
    """

    warp: wp.vec2d
    weft: wp.vec2d
    isotropic: int
    c_warp: wp.float64
    c_weft: wp.float64
    c_cross: wp.float64
    shear: wp.float64
    k_warp: wp.float64
    k_weft: wp.float64
    lock: wp.float64
    compression: wp.float64
    strain_warp: wp.array(dtype=wp.float64)
    tension_warp: wp.array(dtype=wp.float64)
    strain_weft: wp.array(dtype=wp.float64)
    tension_weft: wp.array(dtype=wp.float64)
    held: wp.array(dtype=wp.float64)


@wp.func
def follow_curve(e: wp.float64, strain: wp.array(dtype=wp.float64), tension: wp.array(dtype=wp.float64)):
    """Return tension [N/m], its integral from 0 [N/m] and its slope [N/m] at a strain e > 0."""
    count = strain.shape[0]
    pulled = wp.float64(0.0)
    energy = wp.float64(0.0)
    slope = wp.float64(0.0)
    i = int(0)
    while i < count - 1 and (i == 0 or e > strain[i]):
        here = natural(i)
        following = natural(i + 1)
        slope = (tension[following] - tension[here]) / (strain[following] - strain[here])
        upper = e
        if i < count - 2:
            upper = wp.min(e, strain[following])
        d = upper - strain[here]
        pulled = tension[here] + slope * d
        energy += (tension[here] + wp.float64(0.5) * slope * d) * d
        i += 1
    return wp.vec3d(pulled, energy, slope)


@wp.func
def beyond_hooke(
    e: wp.float64, stiffness: wp.float64, strain: wp.array(dtype=wp.float64), tension: wp.array(dtype=wp.float64)
):
    """Return the excess of the curve over K e: tension, energy, slope [N/m]; zero under compression."""
    if e > wp.float64(0.0):
        hooke = wp.vec3d(stiffness * e, wp.float64(0.5) * stiffness * e * e, stiffness)
        return follow_curve(e, strain, tension) - hooke
    return wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))


@wp.func
def stretched_sheet(e: wp.vec2d, cloth: Cloth):
    """Return sigma_warp, sigma_weft [N/m] and W [J/m2] at the strains e."""
    s = wp.vec2d(cloth.c_warp * e[0] + cloth.c_cross * e[1], cloth.c_weft * e[1] + cloth.c_cross * e[0])
    w = wp.float64(0.5) * wp.dot(s, e)
    if s[0] < wp.float64(0.0) or s[1] < wp.float64(0.0):
        # A thread under pressure wrinkles; the other one carries on alone if it is stretched.
        f = cloth.compression
        wrinkled = wp.vec2d(cloth.k_warp * wp.max(e[0], wp.float64(0.0)), cloth.k_weft * wp.max(e[1], wp.float64(0.0)))
        w = f * w + (wp.float64(1.0) - f) * wp.float64(0.5) * wp.dot(wrinkled, e)
        s = f * s + (wp.float64(1.0) - f) * wrinkled
    warp = beyond_hooke(e[0], cloth.k_warp, cloth.strain_warp, cloth.tension_warp)
    weft = beyond_hooke(e[1], cloth.k_weft, cloth.strain_weft, cloth.tension_weft)
    return wp.vec3d(s[0] + warp[0], s[1] + weft[0], w + warp[1] + weft[1])


@wp.func
def sheared_threads(gamma: wp.float64, cloth: Cloth):
    """Return tau [N/m], its integral from 0 [J/m2] and its slope [N/m]."""
    beyond = wp.max(wp.abs(gamma) - LOCKED, wp.float64(0.0))
    slope = cloth.shear
    if beyond > wp.float64(0.0):
        slope += cloth.lock
    tau = cloth.shear * gamma + wp.sign(gamma) * cloth.lock * beyond
    return wp.vec3d(tau, wp.float64(0.5) * (cloth.shear * gamma * gamma + cloth.lock * beyond * beyond), slope)


@wp.func
def thread_slope(
    e: wp.float64, c: wp.float64, k: wp.float64, strain: wp.array(dtype=wp.float64), tension: wp.array(dtype=wp.float64)
):
    """Return a bound on d sigma / d e along a thread [N/m]: the sheet's, or the curve's where that is steeper."""
    return c + wp.max(beyond_hooke(e, k, strain, tension)[2], wp.float64(0.0))


@wp.func
def pair_bound(a: wp.vec2d, b: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, q: wp.vec2d, psi: wp.float64):
    """Return, per area, a bound on the second derivative of the energy by the places of two corners.

    a, b: gradients of their weights; of one corner, if both are the same.
    """
    along_warp = wp.dot(a, warp) * wp.dot(b, warp)
    along_weft = wp.dot(a, weft) * wp.dot(b, weft)
    return q[0] * along_warp + q[1] * along_weft + psi * wp.dot(a, b)


@wp.func
def stress_rates(rate_warp: wp.float64, rate_weft: wp.float64, e: wp.vec2d, cloth: Cloth):
    """Return the rates of sigma_warp and sigma_weft for rates of the strains e, without wrinkling under compression."""
    slope_warp = thread_slope(e[0], cloth.c_warp, cloth.k_warp, cloth.strain_warp, cloth.tension_warp)
    slope_weft = thread_slope(e[1], cloth.c_weft, cloth.k_weft, cloth.strain_weft, cloth.tension_weft)
    return wp.vec2d(
        slope_warp * rate_warp + cloth.c_cross * rate_weft, slope_weft * rate_weft + cloth.c_cross * rate_warp
    )


@wp.func
def threads_in(F: wp.mat22d, cloth: Cloth, slack: wp.vec2d):
    """Return warp and weft times the slack; the principal directions of a cell in an isotropic sheet."""
    warp = cloth.warp * slack[0]
    weft = cloth.weft * slack[1]
    if cloth.isotropic != 0:
        turn = principal_direction(F * warp, F * weft)
        longest = combined(turn, warp, weft)
        weft = combined(turned_left(turn), warp, weft)
        warp = longest
    return warp, weft


@wp.struct
class WornCell:
    """A cell as worn.

    inv: inverse of its edges in the plane [1/m]. F: deformation. warp, weft: threads in the plane; worn_warp, worn_weft: worn.
    e: strains along them. gamma: their product. w0, w1, w2: gradients of the corners' barycentric weights [1/m].
    """

    inv: wp.mat22d
    F: wp.mat22d
    warp: wp.vec2d
    weft: wp.vec2d
    worn_warp: wp.vec2d
    worn_weft: wp.vec2d
    e: wp.vec2d
    gamma: wp.float64
    w0: wp.vec2d
    w1: wp.vec2d
    w2: wp.vec2d


@wp.func
def worn_cell(D: wp.mat22d, laid: wp.vec3d, cloth: Cloth, slack: wp.vec2d):
    """Return the cell with the edges D in the plane."""
    cell = WornCell()
    cell.inv = wp.inverse(D)
    cell.F = laid_edges(laid) * cell.inv
    warp, weft = threads_in(cell.F, cloth, slack)
    cell.warp = warp
    cell.weft = weft
    cell.worn_warp = cell.F * warp
    cell.worn_weft = cell.F * weft
    cell.e = wp.vec2d(
        wp.max(wp.length(cell.worn_warp), TINY) - wp.float64(1.0),
        wp.max(wp.length(cell.worn_weft), TINY) - wp.float64(1.0),
    )
    cell.gamma = wp.dot(cell.worn_warp, cell.worn_weft)
    cell.w1 = wp.vec2d(cell.inv[0, 0], cell.inv[0, 1])
    cell.w2 = wp.vec2d(cell.inv[1, 0], cell.inv[1, 1])
    cell.w0 = -(cell.w1 + cell.w2)
    return cell


@wp.func
def membrane_forces(cell: WornCell, area: wp.float64, cloth: Cloth):
    """Return the forces on corners 1 and 2, as columns [N], and psi [J/m2]."""
    one = wp.float64(1.0)
    law = stretched_sheet(cell.e, cloth)
    sheared = sheared_threads(cell.gamma, cloth)
    psi = law[2] + sheared[1]
    P = wp.outer(cell.worn_warp * (law[0] / (cell.e[0] + one)) + sheared[0] * cell.worn_weft, cell.warp) + wp.outer(
        cell.worn_weft * (law[1] / (cell.e[1] + one)) + sheared[0] * cell.worn_warp, cell.weft
    )
    # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
    inv_t = wp.transpose(cell.inv)
    return (wp.transpose(cell.F) * P * inv_t - inv_t * psi) * area, psi


@wp.func
def thread_bounds(cell: WornCell, cloth: Cloth):
    """Return bounds on the second derivatives [N/m] by (w . warp) and (w . weft), w the corners' weight gradients.

    The gradient of |F t| by a corner's place is -(F^T F t / |F t|) (w . t).
    """
    back_warp = wp.transpose(cell.F) * cell.worn_warp
    back_weft = wp.transpose(cell.F) * cell.worn_weft
    size_warp = wp.dot(back_warp, back_warp)
    size_weft = wp.dot(back_weft, back_weft)
    slope_warp = thread_slope(cell.e[0], cloth.c_warp, cloth.k_warp, cloth.strain_warp, cloth.tension_warp)
    slope_weft = thread_slope(cell.e[1], cloth.c_weft, cloth.k_weft, cloth.strain_weft, cloth.tension_weft)
    square_warp = wp.max(wp.dot(cell.worn_warp, cell.worn_warp), TINY)
    square_weft = wp.max(wp.dot(cell.worn_weft, cell.worn_weft), TINY)
    twice_shear = wp.float64(2.0) * cloth.shear
    # Threads that lock are far from crossing at right angles, so that both stiffnesses may act in one direction.
    twice_lock = wp.float64(2.0) * (sheared_threads(cell.gamma, cloth)[2] - cloth.shear)
    return wp.vec2d(
        wp.max((slope_warp + cloth.c_cross) * size_warp / square_warp, twice_shear * size_weft)
        + twice_lock * size_weft,
        wp.max((slope_weft + cloth.c_cross) * size_weft / square_weft, twice_shear * size_warp)
        + twice_lock * size_warp,
    )


@wp.func
def bounds_beyond(cell: WornCell, psi: wp.float64, area: wp.float64, held: int, cloth: Cloth):
    """Return what the corners' bounds are beyond those in the step's matrix, twice [N/m]; held: the first of `Cloth.held`."""
    none = wp.float64(0.0)
    two = wp.float64(2.0)
    q = thread_bounds(cell, cloth)
    k0 = area * pair_bound(cell.w0, cell.w0, cell.warp, cell.weft, q, psi)
    k1 = area * pair_bound(cell.w1, cell.w1, cell.warp, cell.weft, q, psi)
    k2 = area * pair_bound(cell.w2, cell.w2, cell.warp, cell.weft, q, psi)
    return wp.vec3d(
        two * wp.max(k0 - cloth.held[held], none),
        two * wp.max(k1 - cloth.held[held + 1], none),
        two * wp.max(k2 - cloth.held[held + 2], none),
    )


@wp.func
def membrane_viscosity(cell: WornCell, v0: wp.vec2d, v1: wp.vec2d, v2: wp.vec2d, cloth: Cloth):
    """Return (dF/dx) v on corners 1 and 2 per area, as columns; v0 to v2: the corners' velocities [m/s]."""
    # v changes F by -F A, with A the gradient of v in the plane.
    A = edge_matrix(v0, v1, v2) * cell.inv
    one = wp.float64(1.0)
    back_warp = wp.transpose(cell.F) * cell.worn_warp
    back_weft = wp.transpose(cell.F) * cell.worn_weft
    unit_warp = back_warp / (cell.e[0] + one)
    unit_weft = back_weft / (cell.e[1] + one)
    along_warp = A * cell.warp
    along_weft = A * cell.weft
    rate = stress_rates(-wp.dot(unit_warp, along_warp), -wp.dot(unit_weft, along_weft), cell.e, cloth)
    slope = sheared_threads(cell.gamma, cloth)[2]
    tau_rate = -slope * (wp.dot(back_weft, along_warp) + wp.dot(back_warp, along_weft))
    R = wp.outer(unit_warp * rate[0] + back_weft * tau_rate, cell.warp) + wp.outer(
        unit_weft * rate[1] + back_warp * tau_rate, cell.weft
    )
    return R * wp.transpose(cell.inv)


@wp.func
def membrane_energy(
    p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d, warp: wp.vec2d, weft: wp.vec2d, cloth: Cloth
):
    """Return (flat area) psi of a cell with all of its area [J]; infinite if it is collapsed or mirrored."""
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    if det <= wp.float64(0.0):
        return wp.float64(wp.inf)
    worn_warp = on_body(laid, across(D, warp)) / det
    worn_weft = on_body(laid, across(D, weft)) / det
    if cloth.isotropic != 0:
        turn = principal_direction(worn_warp, worn_weft)
        longest = combined(turn, worn_warp, worn_weft)
        worn_weft = combined(turned_left(turn), worn_warp, worn_weft)
        worn_warp = longest
    e = wp.vec2d(wp.length(worn_warp) - wp.float64(1.0), wp.length(worn_weft) - wp.float64(1.0))
    law = stretched_sheet(e, cloth)
    return wp.float64(0.5) * det * (law[2] + sheared_threads(wp.dot(worn_warp, worn_weft), cloth)[1])
