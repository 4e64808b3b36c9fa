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
    across,
    add_to_corners,
    cell_corner,
    cell_places,
    cell_weight,
    clear_corners,
    combined,
    count_cells,
    edge_matrix,
    flat_edges,
    laid_edges,
    longest_square,
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
def thread_bounds(F: wp.mat22d, worn_warp: wp.vec2d, worn_weft: wp.vec2d, e: wp.vec2d, gamma: wp.float64, cloth: Cloth):
    """Return bounds on the second derivatives [N/m] by (w . warp) and (w . weft), w the corners' weight gradients.

    The gradient of |F t| by a corner's place is -(F^T F t / |F t|) (w . t).
    """
    back_warp = wp.transpose(F) * worn_warp
    back_weft = wp.transpose(F) * worn_weft
    size_warp = wp.dot(back_warp, back_warp)
    size_weft = wp.dot(back_weft, back_weft)
    slope_warp = thread_slope(e[0], cloth.c_warp, cloth.k_warp, cloth.strain_warp, cloth.tension_warp)
    slope_weft = thread_slope(e[1], cloth.c_weft, cloth.k_weft, cloth.strain_weft, cloth.tension_weft)
    square_warp = wp.max(wp.dot(worn_warp, worn_warp), TINY)
    square_weft = wp.max(wp.dot(worn_weft, worn_weft), TINY)
    twice_shear = wp.float64(2.0) * cloth.shear
    # Threads that lock are far from crossing at right angles, so that both stiffnesses may act in one direction.
    twice_lock = wp.float64(2.0) * (sheared_threads(gamma, cloth)[2] - cloth.shear)
    return wp.vec2d(
        wp.max((slope_warp + cloth.c_cross) * size_warp / square_warp, twice_shear * size_weft)
        + twice_lock * size_weft,
        wp.max((slope_weft + cloth.c_cross) * size_weft / square_weft, twice_shear * size_warp)
        + twice_lock * size_warp,
    )


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
            inv = wp.inverse(D)
            F = laid_edges(cells.laid[natural(begin + k)]) * inv
            warp, weft = threads_in(F, cloth, cells.slack[f])
            worn_warp = F * warp
            worn_weft = F * weft
            length_warp = wp.max(wp.length(worn_warp), TINY)
            length_weft = wp.max(wp.length(worn_weft), TINY)
            e = wp.vec2d(length_warp - wp.float64(1.0), length_weft - wp.float64(1.0))
            gamma = wp.dot(worn_warp, worn_weft)
            across = sheared_threads(gamma, cloth)
            tau = across[0]
            law = stretched_sheet(e, cloth)
            psi = law[2] + across[1]
            area = wp.float64(0.5) * det * cell_weight(face)
            P = wp.outer(worn_warp * (law[0] / length_warp) + tau * worn_weft, warp) + wp.outer(
                worn_weft * (law[1] / length_weft) + tau * worn_warp, weft
            )
            # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
            inv_t = wp.transpose(inv)
            pull = (wp.transpose(F) * P * inv_t - inv_t * psi) * area
            at = cell_places(face, k)
            q = thread_bounds(F, worn_warp, worn_weft, e, gamma, cloth)
            w1 = wp.vec2d(inv[0, 0], inv[0, 1])
            w2 = wp.vec2d(inv[1, 0], inv[1, 1])
            w0 = -(w1 + w2)
            none = wp.float64(0.0)
            two = wp.float64(2.0)
            held = 3 * (begin + k)
            k0 = area * pair_bound(w0, w0, warp, weft, q, psi)
            k1 = area * pair_bound(w1, w1, warp, weft, q, psi)
            k2 = area * pair_bound(w2, w2, warp, weft, q, psi)
            beyond = wp.vec3d(
                two * wp.max(k0 - cloth.held[held], none),
                two * wp.max(k1 - cloth.held[held + 1], none),
                two * wp.max(k2 - cloth.held[held + 2], none),
            )
            add_to_corners(out, slot, at, pull, beyond)
            if viscous:
                # v changes F by -F A, with A the gradient of v in the plane.
                a1 = velocity[corner[1]] - velocity[corner[0]]
                a2 = velocity[corner[2]] - velocity[corner[0]]
                A = wp.mat22d(a1[0], a2[0], a1[1], a2[1]) * inv
                back_warp = wp.transpose(F) * worn_warp
                back_weft = wp.transpose(F) * worn_weft
                unit_warp = back_warp / length_warp
                unit_weft = back_weft / length_weft
                rate = stress_rates(-wp.dot(unit_warp, A * warp), -wp.dot(unit_weft, A * weft), e, cloth)
                tau_rate = -across[2] * (wp.dot(back_weft, A * warp) + wp.dot(back_warp, A * weft))
                R = wp.outer(unit_warp * rate[0] + back_weft * tau_rate, warp) + wp.outer(
                    unit_weft * rate[1] + back_warp * tau_rate, weft
                )
                V = (R * inv_t) * (area * time_step)
                d1 = wp.vec2d(V[0, 0], V[1, 0])
                d2 = wp.vec2d(V[0, 1], V[1, 1])
                out.viscosity[slot + at[0]] -= d1 + d2
                out.viscosity[slot + at[1]] += d1
                out.viscosity[slot + at[2]] += d2
        k += 1
    out.acting[f] = wp.int8(acts)
    out.clearance[f] = least


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
            inv = wp.inverse(D)
            F = laid_edges(cells.laid[c]) * inv
            warp, weft = threads_in(F, cloth, cells.slack[f])
            worn_warp = F * warp
            worn_weft = F * weft
            e = wp.vec2d(wp.length(worn_warp) - wp.float64(1.0), wp.length(worn_weft) - wp.float64(1.0))
            gamma = wp.dot(worn_warp, worn_weft)
            psi = stretched_sheet(e, cloth)[2] + sheared_threads(gamma, cloth)[1]
            q = thread_bounds(F, worn_warp, worn_weft, e, gamma, cloth)
            area = wp.float64(0.5) * det * cell_weight(face)
            w1 = wp.vec2d(inv[0, 0], inv[0, 1])
            w2 = wp.vec2d(inv[1, 0], inv[1, 1])
            w0 = -(w1 + w2)
            none = wp.float64(0.0)
            weight[3 * c] = wp.max(-area * pair_bound(w0, w1, warp, weft, q, psi), none)
            weight[3 * c + 1] = wp.max(-area * pair_bound(w1, w2, warp, weft, q, psi), none)
            weight[3 * c + 2] = wp.max(-area * pair_bound(w2, w0, warp, weft, q, psi), none)
        k += 1


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
