"""The cloth as a membrane that is measured as worn: energy, forces and a bound on their stiffness, per cell.

Warp and weft lie straight in the plane, F = dX/dx maps them to the body, and per flat area of cloth the energy is

    psi = W(e_warp, e_weft) + 1/2 G gamma^2,    e = |F t| - 1,    gamma = F t_warp . F t_weft,

with t a thread's unit vector over the stretch at which it is meant to be worn (1 where none is). W is that of an
orthotropic sheet in plane stress; a J-shaped curve adds what the tension differs from K e; and under compression cloth
wrinkles: W = f W_sheet + (1 - f) W_wrinkled, with W_wrinkled the least energy of any sheet that may shorten freely
(Pipkin 1986). The energy grows without bound as a cell collapses, so that no cell can be mirrored.
"""

import warp as wp

from .cells import Cells, flat_edges

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float64(1.0e-300))


@wp.struct
class Cloth:
    """The fabric, and what the step's matrix already holds of it.

    warp, weft: unit vectors in the plane.
    c_warp, c_weft, c_cross, shear: plane stress [N/m].
    k_warp, k_weft: K, the stiffness of a strip along one thread [N/m].
    compression: f, stiffness under compression over that under tension.
    strain_warp, tension_warp, strain_weft, tension_weft: points of the curves, the first at 0 [1, N/m]; beyond the last
    they go on straight.
    held: 3 #C, the share of each cell's corner in the sum of k_ij around the vertex [N/m].
    """

    warp: wp.vec2d
    weft: wp.vec2d
    c_warp: wp.float64
    c_weft: wp.float64
    c_cross: wp.float64
    shear: wp.float64
    k_warp: wp.float64
    k_weft: wp.float64
    compression: wp.float64
    strain_warp: wp.array(dtype=wp.float64)
    tension_warp: wp.array(dtype=wp.float64)
    strain_weft: wp.array(dtype=wp.float64)
    tension_weft: wp.array(dtype=wp.float64)
    held: wp.array(dtype=wp.float64)


@wp.func
def follow_curve(e: wp.float64, strain: wp.array(dtype=wp.float64), tension: wp.array(dtype=wp.float64)):
    """Tension [N/m], its integral from 0 [N/m] and its slope [N/m] at a strain e > 0."""
    count = strain.shape[0]
    pulled = wp.float64(0.0)
    energy = wp.float64(0.0)
    slope = wp.float64(0.0)
    for i in range(count - 1):
        if i == 0 or e > strain[i]:
            slope = (tension[i + 1] - tension[i]) / (strain[i + 1] - strain[i])
            upper = e
            if i < count - 2:
                upper = wp.min(e, strain[i + 1])
            d = upper - strain[i]
            pulled = tension[i] + slope * d
            energy += (tension[i] + wp.float64(0.5) * slope * d) * d
    return wp.vec3d(pulled, energy, slope)


@wp.func
def beyond_hooke(
    e: wp.float64, stiffness: wp.float64, strain: wp.array(dtype=wp.float64), tension: wp.array(dtype=wp.float64)
):
    """What the curve adds to K e: tension, energy, slope [N/m]; nothing under compression."""
    if e > wp.float64(0.0):
        hooke = wp.vec3d(stiffness * e, wp.float64(0.5) * stiffness * e * e, stiffness)
        return follow_curve(e, strain, tension) - hooke
    return wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))


@wp.func
def stretched_sheet(e: wp.vec2d, cloth: Cloth):
    """sigma_warp, sigma_weft [N/m] and W [J/m2] at the strains e."""
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
def thread_slope(
    e: wp.float64, c: wp.float64, k: wp.float64, strain: wp.array(dtype=wp.float64), tension: wp.array(dtype=wp.float64)
):
    """Bound on d sigma / d e along a thread [N/m]: the sheet's, and the curve's where that is steeper."""
    return c + wp.max(beyond_hooke(e, k, strain, tension)[2], wp.float64(0.0))


@wp.func
def corner_bound(w: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, q_warp: wp.float64, q_weft: wp.float64, psi: wp.float64):
    """Per area, a bound on the second derivative of the energy by a corner's place; w the gradient of its weight."""
    along_warp = wp.dot(w, warp)
    along_weft = wp.dot(w, weft)
    return q_warp * along_warp * along_warp + q_weft * along_weft * along_weft + psi * wp.dot(w, w)


@wp.kernel
def evaluate_membrane(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    time_step: wp.float64,
    first: int,
    # outputs
    acting: wp.array(dtype=wp.int32),
    clearance: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec2d),
    viscosity: wp.array(dtype=wp.vec2d),
    stiffness: wp.array(dtype=wp.float64),
):
    """Forces of the membrane, minus the gradient of (flat area) psi, and what its stiffness exceeds the matrix by.

    The approximate implicit step has the k_ij of the springs as its matrix, which bound the membrane's stiffness at small
    strain. What a strained cell has beyond them, k = 2 max(bound - held, 0), goes to the diagonal, with the viscosity
    -h k (v - v_cell), v_cell the mean velocity by stiffness, so that a cell that moves as a whole is not held back.

    position: #V [m]. velocity: #V [m/s]. acting: #C, 0 in a mirrored cell, whose last three are not written.
    clearance: #C, the cell's least height in the plane [m], 0 once it is mirrored. force, viscosity: 3 #C [N].
    stiffness: 3 #C [N/m].
    """
    c = wp.tid() + first
    corner = cells.corner[c]
    D = flat_edges(position, corner)
    det = D[0, 0] * D[1, 1] - D[0, 1] * D[1, 0]
    a = wp.vec2d(D[0, 0], D[1, 0])
    b = wp.vec2d(D[0, 1], D[1, 1])
    longest = wp.max(wp.length(a), wp.max(wp.length(b), wp.length(b - a)))
    acting[c] = 0
    clearance[c] = wp.float64(0.0)
    if det > wp.float64(0.0):
        acting[c] = 1
        clearance[c] = det / longest
        inv = wp.mat22d(D[1, 1], -D[0, 1], -D[1, 0], D[0, 0]) * (wp.float64(1.0) / det)
        F = cells.edges[c] * inv
        warp = cloth.warp * cells.slack[c][0]
        weft = cloth.weft * cells.slack[c][1]
        worn_warp = F * warp
        worn_weft = F * weft
        length_warp = wp.max(wp.length(worn_warp), TINY)
        length_weft = wp.max(wp.length(worn_weft), TINY)
        e = wp.vec2d(length_warp - wp.float64(1.0), length_weft - wp.float64(1.0))
        gamma = wp.dot(worn_warp, worn_weft)
        tau = cloth.shear * gamma
        law = stretched_sheet(e, cloth)
        psi = law[2] + wp.float64(0.5) * tau * gamma
        area = wp.float64(0.5) * det * cells.weight[c]
        P = wp.outer(worn_warp * (law[0] / length_warp) + tau * worn_weft, warp) + wp.outer(
            worn_weft * (law[1] / length_weft) + tau * worn_warp, weft
        )
        # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
        inv_t = wp.transpose(inv)
        G = (inv_t * psi - wp.transpose(F) * P * inv_t) * area
        f1 = wp.vec2d(-G[0, 0], -G[1, 0])
        f2 = wp.vec2d(-G[0, 1], -G[1, 1])
        force[3 * c] = -(f1 + f2)
        force[3 * c + 1] = f1
        force[3 * c + 2] = f2

        # The gradient of |F t| by a corner's place is -(F^T F t / |F t|) (w . t), w the gradient of its weight.
        back_warp = wp.transpose(F) * worn_warp
        back_weft = wp.transpose(F) * worn_weft
        size_warp = wp.dot(back_warp, back_warp)
        size_weft = wp.dot(back_weft, back_weft)
        slope_warp = thread_slope(e[0], cloth.c_warp, cloth.k_warp, cloth.strain_warp, cloth.tension_warp)
        slope_weft = thread_slope(e[1], cloth.c_weft, cloth.k_weft, cloth.strain_weft, cloth.tension_weft)
        twice_shear = wp.float64(2.0) * cloth.shear
        q_warp = wp.max((slope_warp + cloth.c_cross) * size_warp / (length_warp * length_warp), twice_shear * size_weft)
        q_weft = wp.max((slope_weft + cloth.c_cross) * size_weft / (length_weft * length_weft), twice_shear * size_warp)
        w1 = wp.vec2d(inv[0, 0], inv[0, 1])
        w2 = wp.vec2d(inv[1, 0], inv[1, 1])
        none = wp.float64(0.0)
        two = wp.float64(2.0)
        k0 = area * corner_bound(-(w1 + w2), warp, weft, q_warp, q_weft, psi)
        k1 = area * corner_bound(w1, warp, weft, q_warp, q_weft, psi)
        k2 = area * corner_bound(w2, warp, weft, q_warp, q_weft, psi)
        k0 = two * wp.max(k0 - cloth.held[3 * c], none)
        k1 = two * wp.max(k1 - cloth.held[3 * c + 1], none)
        k2 = two * wp.max(k2 - cloth.held[3 * c + 2], none)
        v0 = velocity[corner[0]]
        v1 = velocity[corner[1]]
        v2 = velocity[corner[2]]
        v_cell = (k0 * v0 + k1 * v1 + k2 * v2) / wp.max(k0 + k1 + k2, TINY)
        viscosity[3 * c] = (time_step * k0) * (v_cell - v0)
        viscosity[3 * c + 1] = (time_step * k1) * (v_cell - v1)
        viscosity[3 * c + 2] = (time_step * k2) * (v_cell - v2)
        stiffness[3 * c] = k0
        stiffness[3 * c + 1] = k1
        stiffness[3 * c + 2] = k2


@wp.kernel
def compute_membrane_energy(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """(Flat area) psi per cell. position: #V [m]. energy: #C [J], infinite in a collapsed or mirrored cell."""
    c = wp.tid() + first
    D = flat_edges(position, cells.corner[c])
    det = D[0, 0] * D[1, 1] - D[0, 1] * D[1, 0]
    energy[c] = wp.float64(wp.inf)
    if det > wp.float64(0.0):
        inv = wp.mat22d(D[1, 1], -D[0, 1], -D[1, 0], D[0, 0]) * (wp.float64(1.0) / det)
        F = cells.edges[c] * inv
        worn_warp = F * (cloth.warp * cells.slack[c][0])
        worn_weft = F * (cloth.weft * cells.slack[c][1])
        e = wp.vec2d(wp.length(worn_warp) - wp.float64(1.0), wp.length(worn_weft) - wp.float64(1.0))
        gamma = wp.dot(worn_warp, worn_weft)
        law = stretched_sheet(e, cloth)
        psi = law[2] + wp.float64(0.5) * cloth.shear * gamma * gamma
        energy[c] = wp.float64(0.5) * det * cells.weight[c] * psi


@wp.kernel
def compute_membrane_strain(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    first: int,
    # outputs
    strain: wp.array(dtype=wp.vec3d),
    stress: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
    area: wp.array(dtype=wp.float64),
):
    """Worn strain against the unstretched cloth, with the membrane's stresses and energy; as `strain.compute_worn_strain`.

    position: #V [m]. strain: #C (e_warp, e_weft, gamma). stress: #C (sigma_warp, sigma_weft, tau) [N/m]. energy: #C [J].
    area: #C, the weighted flat area [m2], 0 or less in a mirrored cell, whose strain is then given as 0.
    """
    c = wp.tid() + first
    D = flat_edges(position, cells.corner[c])
    det = D[0, 0] * D[1, 1] - D[0, 1] * D[1, 0]
    area[c] = wp.float64(0.5) * det * cells.weight[c]
    e = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    if det > wp.float64(0.0):
        inv = wp.mat22d(D[1, 1], -D[0, 1], -D[1, 0], D[0, 0]) * (wp.float64(1.0) / det)
        F = cells.edges[c] * inv
        worn_warp = F * cloth.warp
        worn_weft = F * cloth.weft
        e = wp.vec3d(
            wp.length(worn_warp) - wp.float64(1.0),
            wp.length(worn_weft) - wp.float64(1.0),
            wp.dot(worn_warp, worn_weft),
        )
    law = stretched_sheet(wp.vec2d(e[0], e[1]), cloth)
    tau = cloth.shear * e[2]
    strain[c] = e
    stress[c] = wp.vec3d(law[0], law[1], tau)
    energy[c] = (law[2] + wp.float64(0.5) * tau * e[2]) * area[c]
