"""The membrane in one cell: its law, its energy, forces and viscosity, and bounds on its stiffness (see `membrane`)."""

import warp as wp

from .cells import (
    combined,
    edge_matrix,
    laid_edges,
    principal_direction,
    turned_left,
)
from .indices import natural

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float64(1.0e-300))


@wp.struct
class Cloth:
    """The fabric, and its stiffness in the step's matrix.

    warp, weft: unit vectors in the plane.
    isotropic: 1 for a sheet without threads.
    c_warp, c_weft, c_cross, shear: plane stress [N/m].
    k_warp, k_weft: K, the stiffness of a strip along one thread [N/m].
    onset: of gamma, from where threads lock: the sine of the angle at which they do.
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
    onset: wp.float64
    lock: wp.float64
    compression: wp.float64
    strain_warp: wp.array(dtype=wp.float64)
    tension_warp: wp.array(dtype=wp.float64)
    strain_weft: wp.array(dtype=wp.float64)
    tension_weft: wp.array(dtype=wp.float64)
    held: wp.array(dtype=wp.float64)


@wp.struct
class ClothLaw:
    """What the cloth does at given strains.

    energy: W(e_warp, e_weft) and that of shear [J/m2]. sigma: stresses along warp and weft [N/m]. tau: shear stress [N/m].
    slope: second derivatives of W by e_warp, by e_weft, and by both [N/m].
    bound: on the second derivatives by e_warp and e_weft, without what wrinkling takes away [N/m].
    locked: what locked threads add to G, or 0 [N/m].
    """

    energy: wp.float64
    sigma: wp.vec2d
    tau: wp.float64
    slope: wp.vec3d
    bound: wp.vec2d
    locked: wp.float64


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
def cloth_law(e: wp.vec2d, gamma: wp.float64, cloth: Cloth):
    """Return the law of the cloth at the strains e and gamma: energy, stresses and slopes, and bounds on the slopes."""
    one = wp.float64(1.0)
    half = wp.float64(0.5)
    none = wp.float64(0.0)
    law = ClothLaw()
    law.sigma = wp.vec2d(cloth.c_warp * e[0] + cloth.c_cross * e[1], cloth.c_weft * e[1] + cloth.c_cross * e[0])
    law.energy = half * wp.dot(law.sigma, e)
    law.slope = wp.vec3d(cloth.c_warp, cloth.c_weft, cloth.c_cross)
    if law.sigma[0] < none or law.sigma[1] < none:
        # A thread under pressure wrinkles; the other one carries on alone if it is stretched.
        f = cloth.compression
        alone = wp.vec2d(wp.where(e[0] > none, cloth.k_warp, none), wp.where(e[1] > none, cloth.k_weft, none))
        wrinkled = wp.cw_mul(alone, e)
        law.energy = f * law.energy + (one - f) * half * wp.dot(wrinkled, e)
        law.sigma = f * law.sigma + (one - f) * wrinkled
        law.slope = f * law.slope + (one - f) * wp.vec3d(alone[0], alone[1], none)
    warp = beyond_hooke(e[0], cloth.k_warp, cloth.strain_warp, cloth.tension_warp)
    weft = beyond_hooke(e[1], cloth.k_weft, cloth.strain_weft, cloth.tension_weft)
    law.sigma += wp.vec2d(warp[0], weft[0])
    law.energy += warp[1] + weft[1]
    law.slope += wp.vec3d(warp[2], weft[2], none)
    law.bound = wp.vec2d(cloth.c_warp + wp.max(warp[2], none), cloth.c_weft + wp.max(weft[2], none))
    beyond = wp.max(wp.abs(gamma) - cloth.onset, none)
    law.tau = cloth.shear * gamma + wp.sign(gamma) * cloth.lock * beyond
    law.energy += half * (cloth.shear * gamma * gamma + cloth.lock * beyond * beyond)
    law.locked = wp.where(beyond > none, cloth.lock, none)
    return law


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
    length_warp, length_weft: these two's lengths. law: of the cloth there. q: bounds on the second derivatives of the
    energy by (w . warp) and (w . weft), w the corners' weight gradients [N/m].
    w0, w1, w2: gradients of the corners' barycentric weights [1/m].
    """

    inv: wp.mat22d
    F: wp.mat22d
    warp: wp.vec2d
    weft: wp.vec2d
    worn_warp: wp.vec2d
    worn_weft: wp.vec2d
    length_warp: wp.float64
    length_weft: wp.float64
    law: ClothLaw
    q: wp.vec2d
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
    cell.length_warp = wp.max(wp.length(cell.worn_warp), TINY)
    cell.length_weft = wp.max(wp.length(cell.worn_weft), TINY)
    one = wp.float64(1.0)
    e = wp.vec2d(cell.length_warp - one, cell.length_weft - one)
    cell.law = cloth_law(e, wp.dot(cell.worn_warp, cell.worn_weft), cloth)
    cell.w1 = wp.vec2d(cell.inv[0, 0], cell.inv[0, 1])
    cell.w2 = wp.vec2d(cell.inv[1, 0], cell.inv[1, 1])
    cell.w0 = -(cell.w1 + cell.w2)
    # The gradient of |F t| by a corner's place is -(F^T F t / |F t|) (w . t).
    back_warp = wp.transpose(cell.F) * cell.worn_warp
    back_weft = wp.transpose(cell.F) * cell.worn_weft
    size_warp = wp.dot(back_warp, back_warp)
    size_weft = wp.dot(back_weft, back_weft)
    pull_warp = (cell.law.bound[0] + cloth.c_cross) * size_warp / wp.max(cell.length_warp * cell.length_warp, TINY)
    pull_weft = (cell.law.bound[1] + cloth.c_cross) * size_weft / wp.max(cell.length_weft * cell.length_weft, TINY)
    shear = wp.float64(2.0) * cloth.shear
    # Threads that lock are far from crossing at right angles, so that both stiffnesses may act in one direction.
    lock = wp.float64(2.0) * cell.law.locked
    cell.q = wp.vec2d(
        wp.max(pull_warp, shear * size_weft) + lock * size_weft,
        wp.max(pull_weft, shear * size_warp) + lock * size_warp,
    )
    return cell


@wp.func
def membrane_forces(cell: WornCell):
    """Return the forces on corners 1 and 2 per area, as columns [N/m2]."""
    law = cell.law
    P = wp.outer(cell.worn_warp * (law.sigma[0] / cell.length_warp) + law.tau * cell.worn_weft, cell.warp)
    P += wp.outer(cell.worn_weft * (law.sigma[1] / cell.length_weft) + law.tau * cell.worn_warp, cell.weft)
    # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
    inv_t = wp.transpose(cell.inv)
    return wp.transpose(cell.F) * P * inv_t - inv_t * law.energy


@wp.func
def pair_bound(cell: WornCell, a: wp.vec2d, b: wp.vec2d):
    """Return, per area, a bound on the second derivative of the energy by the places of two corners.

    a, b: gradients of their weights; of one corner, if both are the same.
    """
    along_warp = wp.dot(a, cell.warp) * wp.dot(b, cell.warp)
    along_weft = wp.dot(a, cell.weft) * wp.dot(b, cell.weft)
    return cell.q[0] * along_warp + cell.q[1] * along_weft + cell.law.energy * wp.dot(a, b)


@wp.func
def membrane_viscosity(cell: WornCell, v0: wp.vec2d, v1: wp.vec2d, v2: wp.vec2d, cloth: Cloth):
    """Return (dF/dx) v on corners 1 and 2 per area, as columns; v0 to v2: the corners' velocities [m/s].

    Wrinkling under compression is left out.
    """
    # v changes F by -F A, with A the gradient of v in the plane.
    A = edge_matrix(v0, v1, v2) * cell.inv
    back_warp = wp.transpose(cell.F) * cell.worn_warp
    back_weft = wp.transpose(cell.F) * cell.worn_weft
    unit_warp = back_warp / cell.length_warp
    unit_weft = back_weft / cell.length_weft
    along_warp = A * cell.warp
    along_weft = A * cell.weft
    e_warp = -wp.dot(unit_warp, along_warp)
    e_weft = -wp.dot(unit_weft, along_weft)
    rate_warp = cell.law.bound[0] * e_warp + cloth.c_cross * e_weft
    rate_weft = cell.law.bound[1] * e_weft + cloth.c_cross * e_warp
    tau_rate = -(cloth.shear + cell.law.locked) * (wp.dot(back_weft, along_warp) + wp.dot(back_warp, along_weft))
    R = wp.outer(unit_warp * rate_warp + back_weft * tau_rate, cell.warp)
    R += wp.outer(unit_weft * rate_weft + back_warp * tau_rate, cell.weft)
    return R * wp.transpose(cell.inv)
