"""Stiffness of draped cloth: second derivatives of the energies of membrane, contact and friction, without what is negative."""

import warp as wp

from .drape import TINY, Contact, Motion, draped_cell, gap_of, mat32d, normal_of, push_of_plane
from .indices import natural
from .membrane_cell import Cloth

wp.set_module_options({"enable_backward": False})

# What holds a vertex that may not move [N/m].
HELD = wp.constant(wp.float64(1.0e6))


@wp.kernel
def stiffen_cloth(
    position: wp.array(dtype=wp.vec3d),
    corner: wp.array(dtype=wp.vec3i),
    gradient: wp.array(dtype=mat32d),
    area: wp.array(dtype=wp.float64),
    cloth: Cloth,
    pull: wp.float64,
    first: int,
    # outputs
    stiffness: wp.array(dtype=wp.mat33d),
):
    """Compute the second derivatives of each cell's energy by its corners, without what is negative.

    Of the stress, as a symmetric 2 by 2 matrix, the part under tension stiffens the cell across its threads.

    position, corner, gradient, area: as of `evaluate_cloth`. stiffness: 9 #C, of corners 00, 01, 02, 10, ... [N/m].
    """
    c = natural(wp.tid() + first)
    g = gradient[c]
    zero = wp.float64(0.0)
    half = wp.float64(0.5)
    cell = draped_cell(position, corner[c], g, cloth)
    law = cell.law
    shear = cloth.shear + law.locked
    # The part of the stress [[a, tau], [tau, b]] that pulls.
    a = law.sigma[0] / cell.length_warp
    b = law.sigma[1] / cell.length_weft
    middle = half * (a + b)
    radius = wp.max(wp.sqrt(half * half * (a - b) * (a - b) + law.tau * law.tau), TINY)
    high = wp.abs(middle + radius)
    low = wp.abs(middle - radius)
    across = half * (high - low) / radius
    mean = half * (high + low)
    a_pull = mean + across * half * (a - b)
    b_pull = mean - across * half * (a - b)
    tau_pull = across * law.tau
    u = cell.warp / cell.length_warp
    v = cell.weft / cell.length_weft
    unit = wp.identity(n=3, dtype=wp.float64)
    of_warp = wp.outer(u, u) * wp.max(law.slope[0] - a_pull, zero) + unit * (a_pull + pull)
    of_warp += wp.outer(cell.weft, cell.weft) * shear
    of_weft = wp.outer(v, v) * wp.max(law.slope[1] - b_pull, zero) + unit * (b_pull + pull)
    of_weft += wp.outer(cell.warp, cell.warp) * shear
    of_both = wp.outer(u, v) * law.slope[2] + unit * tau_pull + wp.outer(cell.weft, cell.warp) * shear
    for k in range(9):
        i = k / 3
        j = k % 3
        along_i = g[i]
        along_j = g[j]
        stiffness[natural(9 * c + k)] = (
            of_warp * (along_i[0] * along_j[0])
            + of_weft * (along_i[1] * along_j[1])
            + of_both * (along_i[0] * along_j[1])
            + wp.transpose(of_both) * (along_i[1] * along_j[0])
        ) * area[c]


@wp.kernel
def stiffen_contact(
    motion: Motion,
    contact: Contact,
    least: wp.float64,
    first: int,
    # outputs
    stiffness: wp.array(dtype=wp.mat33d),
):
    """Compute the second derivatives of the energy of contact and friction at each vertex, with a least stiffness everywhere.

    motion: of which position and fixed count. least: [N/m]. stiffness: #V [N/m].
    """
    i = natural(wp.tid() + first)
    zero = wp.float64(0.0)
    unit = wp.identity(n=3, dtype=wp.float64)
    total = unit * least
    x = motion.position[i]
    n = normal_of(contact, i, x)
    if wp.dot(n, n) > wp.float64(0.5):
        beside = unit - wp.outer(n, n)
        push = push_of_plane(gap_of(contact, i, x), contact.skin[i], contact.pressed[i])
        if push > zero:
            total += wp.outer(n, n) * contact.skin[i]
            if contact.ball[i] > zero:
                total += beside * (push / contact.ball[i])
        most = contact.most[i]
        if most > zero:
            off = beside * (x - contact.anchor[i])
            way = wp.length(off)
            if contact.grip[i] * way <= most:
                total += beside * contact.grip[i]
            else:
                total += (beside - wp.outer(off, off) / (way * way)) * (most / way)
    if motion.fixed[i] != wp.int8(0):
        total += unit * HELD
    stiffness[i] = total
