"""Cloth in space: energy and forces of the membrane, bending, weight, and contact with a body under friction.

The membrane is that of `membrane.py`, with F = dX/dx now a 3 by 2 matrix: psi = W(e_warp, e_weft) + 1/2 G gamma^2 per
flat area, where the rest state is the flat pattern in its own thread directions. Bending is the quadratic energy of
cloth that hardly stretches, 1/2 B |Laplacian of x|^2 (Wardetzky et al. 2007), with the cotangent Laplacian of the flat
pieces at the vertices inside. By edges, as Bergou et al. 2006 have it, grids are three times too stiff along their
lines. Contact is a plane beside a vertex with a stiff skin: the body's, which is fixed, or that of another layer of cloth, which its
triangle carries. Friction is Coulomb's: a spring to an anchor in the plane, whose force is bounded.
"""

import warp as wp

from .indices import natural
from .membrane_cell import Cloth, ClothLaw, cloth_law

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float64(1.0e-30))
mat32d = wp.types.matrix(shape=(3, 2), dtype=wp.float64)


@wp.struct
class Motion:
    """The state of the vertices, each #V.

    position: [m]. velocity: way per step [m]. mass: fictitious [N/m]. weight: [N]. fixed: 1 where a vertex is held.
    """

    position: wp.array(dtype=wp.vec3d)
    velocity: wp.array(dtype=wp.vec3d)
    mass: wp.array(dtype=wp.float64)
    weight: wp.array(dtype=wp.float64)
    fixed: wp.array(dtype=wp.int8)


@wp.struct
class Contact:
    """The body as one plane per vertex, and where friction holds the cloth; each #V but for friction and longest_step.

    In a groove it is the inside of a ball that touches both sides of it: planes of one side and the other would take turns.

    centre: the nearest place of the body [m]. normal: outwards; zero where no body is near. ball: radius of the ball, which touches the
    plane from outside in `centre`, 0 elsewhere [m]. friction: Coulomb's coefficient.
    longest_step: bound of the way in one step of relaxation [m]. skin: stiffness of the body [N/m]. pressed: the normal force at
    no depth [N]. rubbed: the force of friction when the planes were last renewed [N]. anchor: where friction does not act [m].
    grip: stiffness of friction before it slides [N/m]. most: the largest force of friction [N]. depth: how far off its plane what
    presses lay when the planes were last renewed [m].
    """

    centre: wp.array(dtype=wp.vec3d)
    normal: wp.array(dtype=wp.vec3d)
    ball: wp.array(dtype=wp.float64)
    friction: wp.float64
    longest_step: wp.float64
    skin: wp.array(dtype=wp.float64)
    pressed: wp.array(dtype=wp.float64)
    rubbed: wp.array(dtype=wp.vec3d)
    anchor: wp.array(dtype=wp.vec3d)
    grip: wp.array(dtype=wp.float64)
    most: wp.array(dtype=wp.float64)
    depth: wp.array(dtype=wp.float64)


@wp.struct
class Bending:
    """The rows of the flat cloth's symmetric Laplacian L, and its stiffness: the energy is 1/2 sum_i s_i |sum_j L_ij x_j|^2.

    offset: #V+1. neighbor, weight: the vertices and entries of each row. stiffness: #V, s, zero at a border [N/m].
    """

    offset: wp.array(dtype=wp.int32)
    neighbor: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)


@wp.struct
class DrapedCell:
    """A cell in space. warp, weft: its threads, worn; length_warp, length_weft: their lengths. law: of the cloth there."""

    warp: wp.vec3d
    weft: wp.vec3d
    length_warp: wp.float64
    length_weft: wp.float64
    law: ClothLaw


@wp.func
def draped_cell(position: wp.array(dtype=wp.vec3d), corner: wp.vec3i, gradient: mat32d, cloth: Cloth):
    """Return the cell with these corners; gradient: as of `evaluate_cloth`."""
    origin = position[natural(corner[0])]
    d1 = position[natural(corner[1])] - origin
    d2 = position[natural(corner[2])] - origin
    cell = DrapedCell()
    cell.warp = d1 * gradient[1, 0] + d2 * gradient[2, 0]
    cell.weft = d1 * gradient[1, 1] + d2 * gradient[2, 1]
    cell.length_warp = wp.max(wp.length(cell.warp), TINY)
    cell.length_weft = wp.max(wp.length(cell.weft), TINY)
    e = wp.vec2d(cell.length_warp - wp.float64(1.0), cell.length_weft - wp.float64(1.0))
    cell.law = cloth_law(e, wp.dot(cell.warp, cell.weft), cloth)
    return cell


@wp.kernel
def evaluate_cloth(
    position: wp.array(dtype=wp.vec3d),
    corner: wp.array(dtype=wp.vec3i),
    gradient: wp.array(dtype=mat32d),
    area: wp.array(dtype=wp.float64),
    cloth: Cloth,
    first: int,
    # outputs
    force: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
):
    """Compute the membrane's energy, and its forces on the corners of each cell, minus the gradient of (flat area) psi.

    position: #V [m]. corner: #C. gradient: #C, of the weight of each corner along warp and weft [1/m].
    area: #C, flat [m2]. force: 3 #C [N]. energy: #C [J].
    """
    c = natural(wp.tid() + first)
    g = gradient[c]
    cell = draped_cell(position, corner[c], g, cloth)
    law = cell.law
    energy[c] = law.energy * area[c]
    pull_warp = (cell.warp * (law.sigma[0] / cell.length_warp) + cell.weft * law.tau) * area[c]
    pull_weft = (cell.weft * (law.sigma[1] / cell.length_weft) + cell.warp * law.tau) * area[c]
    for k in range(3):
        force[natural(3 * c + k)] = -(pull_warp * g[k, 0] + pull_weft * g[k, 1])


@wp.kernel
def evaluate_curvature(
    position: wp.array(dtype=wp.vec3d),
    bending: Bending,
    first: int,
    # outputs
    moment: wp.array(dtype=wp.vec3d),
):
    """Compute s sum_j L_ij x_j at each vertex, the bending energy's derivative by the curvature there.

    position: #V [m]. moment: #V [N].
    """
    i = natural(wp.tid() + first)
    total = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    s = natural(bending.offset[i])
    end = bending.offset[i + 1]
    while s < end:
        total += position[natural(bending.neighbor[s])] * bending.weight[s]
        s += 1
    moment[i] = total * bending.stiffness[i]


@wp.func
def gather(
    i: int,
    offset: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    force: wp.array(dtype=wp.vec3d),
    bending: Bending,
    moment: wp.array(dtype=wp.vec3d),
):
    """Return the forces of the membrane and of bending on a vertex, in the order of their lists [N]."""
    total = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    s = natural(offset[i])
    end = offset[i + 1]
    while s < end:
        total += force[natural(entry[s])]
        s += 1
    s = natural(bending.offset[i])
    end = bending.offset[i + 1]
    while s < end:
        total -= moment[natural(bending.neighbor[s])] * bending.weight[s]
        s += 1
    return total


@wp.func
def normal_of(contact: Contact, i: int, x: wp.vec3d):
    """Return the normal of what a vertex at x lies on [m]."""
    n = contact.normal[i]
    if contact.ball[i] > wp.float64(0.0):
        n = wp.normalize(contact.centre[i] + n * contact.ball[i] - x)
    return n


@wp.func
def gap_of(contact: Contact, i: int, x: wp.vec3d):
    """Return how far off what it lies on a vertex at x is, negative within [m]."""
    off = x - contact.centre[i]
    n = contact.normal[i]
    ball = contact.ball[i]
    if ball > wp.float64(0.0):
        return ball - wp.length(off - n * ball)
    return wp.dot(off, n)


@wp.func
def push_of_plane(gap: wp.float64, skin: wp.float64, before: wp.float64):
    """Return the force of a plane on a vertex: that which it had at no gap [m], less the skin's for the gap; never a pull [N]."""
    return wp.max(before - skin * gap, wp.float64(0.0))


@wp.func
def friction_force(x: wp.vec3d, n: wp.vec3d, anchor: wp.vec3d, grip: wp.float64, most: wp.float64):
    """Return the force of friction: a spring to the anchor in the plane, at most `most` [N]."""
    off = anchor - x
    off = off - n * wp.dot(off, n)
    return off * wp.min(grip, most / wp.max(wp.length(off), TINY))


@wp.kernel
def gather_drape(
    motion: Motion,
    ground: wp.float64,
    contact: Contact,
    offset: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    cell_force: wp.array(dtype=wp.vec3d),
    bending: Bending,
    moment: wp.array(dtype=wp.vec3d),
    first: int,
    # outputs
    force: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
):
    """Compute the force on each vertex, and the energy of bending, weight, contact and friction.

    motion: of which position, weight and fixed count. ground: the height of no potential energy [m].
    offset: #V+1, entry: where in `cell_force` those of the cells on each vertex are [N]. moment: as of `evaluate_curvature`.
    force: #V, zero where a vertex is held [N]. energy: #V [J].
    """
    i = natural(wp.tid() + first)
    zero = wp.float64(0.0)
    half = wp.float64(0.5)
    x = motion.position[i]
    f = gather(i, offset, entry, cell_force, bending, moment)
    f[1] = f[1] - motion.weight[i]
    e = motion.weight[i] * (x[1] - ground)
    if bending.stiffness[i] > zero:
        e += half * wp.dot(moment[i], moment[i]) / bending.stiffness[i]
    n = normal_of(contact, i, x)
    if wp.dot(n, n) > half:
        before = contact.pressed[i]
        push = push_of_plane(gap_of(contact, i, x), contact.skin[i], before)
        e += half * (push * push - before * before) / contact.skin[i]
        rub = friction_force(x, n, contact.anchor[i], contact.grip[i], contact.most[i])
        e += wp.dot(contact.anchor[i] - x, rub) - half * wp.dot(rub, rub) / contact.grip[i]
        f += n * push + rub
    energy[i] = e
    if motion.fixed[i] != wp.int8(0):
        f = wp.vec3d(zero, zero, zero)
    force[i] = f
