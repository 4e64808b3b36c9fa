"""Cloth in space: energy, forces and stiffness of the membrane, bending, weight, and contact with a body under friction.

The membrane is that of `membrane.py`, with F = dX/dx now a 3 by 2 matrix: psi = W(e_warp, e_weft) + 1/2 G gamma^2 per
flat area, where the rest state is the flat pattern in its own thread directions. Bending is the quadratic energy of
cloth that hardly stretches, 1/2 B |Laplacian of x|^2 (Wardetzky et al. 2007), with the cotangent Laplacian of the flat
pieces at the vertices inside. By edges, as Bergou et al. 2006 have it, grids are three times too stiff along their
lines. The body is one plane per vertex with a stiff skin. Friction is Coulomb's: a spring to an anchor in the plane, whose
force is bounded.
"""

import warp as wp

from .indices import natural
from .membrane import Cloth, beyond_hooke, sheared_threads, stretched_sheet

wp.set_module_options({"enable_backward": False})

# Distance from its plane at which a vertex rests on the body [m].
TOUCH = wp.constant(wp.float64(1.0e-6))
# Way per step below which a vertex does not slide [m].
STILL = wp.constant(wp.float64(1.0e-7))
# What holds a vertex that may not move [N/m].
HELD = wp.constant(wp.float64(1.0e6))
TINY = wp.constant(wp.float64(1.0e-30))


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

    centre: the nearest place of the body [m]. normal: outwards; zero where no body is near. friction: Coulomb's coefficient.
    longest_step: bound of the way in one step of relaxation [m]. skin: stiffness of the body [N/m]. pressed: the normal force at
    no depth [N]. rubbed: the force of friction when the planes were last renewed [N]. anchor: where friction does not act [m].
    grip: stiffness of friction before it slides [N/m]. most: the largest force of friction [N].
    """

    centre: wp.array(dtype=wp.vec3d)
    normal: wp.array(dtype=wp.vec3d)
    friction: wp.float64
    longest_step: wp.float64
    skin: wp.array(dtype=wp.float64)
    pressed: wp.array(dtype=wp.float64)
    rubbed: wp.array(dtype=wp.vec3d)
    anchor: wp.array(dtype=wp.vec3d)
    grip: wp.array(dtype=wp.float64)
    most: wp.array(dtype=wp.float64)


@wp.struct
class Bending:
    """The rows of the flat cloth's symmetric Laplacian L, and its stiffness: the energy is 1/2 sum_i s_i |sum_j L_ij x_j|^2.

    offset: #V+1. neighbor, weight: the vertices and entries of each row. stiffness: #V, s, zero at a border [N/m].
    """

    offset: wp.array(dtype=wp.int32)
    neighbor: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)


@wp.kernel
def evaluate_cloth(
    position: wp.array(dtype=wp.vec3d),
    corner: wp.array(dtype=wp.vec3i),
    gradient: wp.array(dtype=wp.vec4d),
    area: wp.array(dtype=wp.float64),
    cloth: Cloth,
    first: int,
    # outputs
    force: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
):
    """Compute the membrane's energy, and its forces on the corners of each cell, minus the gradient of (flat area) psi.

    position: #V [m]. corner: #C. gradient: #C, of the weight of corner 1 along warp and weft, then of corner 2 [1/m].
    area: #C, flat [m2]. force: 3 #C [N]. energy: #C [J].
    """
    c = natural(wp.tid() + first)
    at = corner[c]
    g = gradient[c]
    origin = position[natural(at[0])]
    d1 = position[natural(at[1])] - origin
    d2 = position[natural(at[2])] - origin
    warp = d1 * g[0] + d2 * g[2]
    weft = d1 * g[1] + d2 * g[3]
    length_warp = wp.max(wp.length(warp), TINY)
    length_weft = wp.max(wp.length(weft), TINY)
    e = wp.vec2d(length_warp - wp.float64(1.0), length_weft - wp.float64(1.0))
    law = stretched_sheet(e, cloth)
    shear = sheared_threads(wp.dot(warp, weft), cloth)
    tau = shear[0]
    energy[c] = (law[2] + shear[1]) * area[c]
    pull_warp = (warp * (law[0] / length_warp) + weft * tau) * area[c]
    pull_weft = (weft * (law[1] / length_weft) + warp * tau) * area[c]
    f1 = -(pull_warp * g[0] + pull_weft * g[1])
    f2 = -(pull_warp * g[2] + pull_weft * g[3])
    force[natural(3 * c)] = -(f1 + f2)
    force[natural(3 * c + 1)] = f1
    force[natural(3 * c + 2)] = f2


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


@wp.kernel
def find_planes(
    mesh: wp.uint64,
    body_normal: wp.array(dtype=wp.vec3),
    position: wp.array(dtype=wp.vec3d),
    reach: wp.float32,
    first: int,
    # outputs
    centre: wp.array(dtype=wp.vec3d),
    normal: wp.array(dtype=wp.vec3d),
):
    """Find the body's plane at each vertex: the nearest place of its surface and the interpolated normal there.

    A sign is not asked for, as it is arbitrary at distance zero.

    mesh: the body. body_normal: its normals at its vertices. position: #V [m]. reach: longest distance [m]. centre: #V [m].
    normal: #V, zero where the body is out of reach.
    """
    i = natural(wp.tid() + first)
    p = position[i]
    query = wp.mesh_query_point_no_sign(mesh, wp.vec3(wp.float32(p[0]), wp.float32(p[1]), wp.float32(p[2])), reach)
    normal[i] = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    if query.result:
        face = 3 * query.face
        indices = wp.mesh_get(mesh).indices
        place = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        n = wp.normalize(
            query.u * body_normal[indices[face]]
            + query.v * body_normal[indices[face + 1]]
            + (1.0 - query.u - query.v) * body_normal[indices[face + 2]]
        )
        centre[i] = wp.vec3d(wp.float64(place[0]), wp.float64(place[1]), wp.float64(place[2]))
        normal[i] = wp.vec3d(wp.float64(n[0]), wp.float64(n[1]), wp.float64(n[2]))


@wp.func
def sheet_slopes(e: wp.vec2d, cloth: Cloth):
    """Return the second derivatives of W by e_warp, by e_weft, and by both [N/m]."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    a = cloth.c_warp
    b = cloth.c_weft
    both = cloth.c_cross
    if cloth.c_warp * e[0] + cloth.c_cross * e[1] < zero or cloth.c_weft * e[1] + cloth.c_cross * e[0] < zero:
        f = cloth.compression
        a = f * a + (one - f) * wp.where(e[0] > zero, cloth.k_warp, zero)
        b = f * b + (one - f) * wp.where(e[1] > zero, cloth.k_weft, zero)
        both = f * both
    a += beyond_hooke(e[0], cloth.k_warp, cloth.strain_warp, cloth.tension_warp)[2]
    b += beyond_hooke(e[1], cloth.k_weft, cloth.strain_weft, cloth.tension_weft)[2]
    return wp.vec3d(a, b, both)


@wp.func
def corner_gradient(g: wp.vec4d, k: int):
    """Return the gradient of the weight of corner k along warp and weft, by those of corners 1 and 2 [1/m]."""
    if k == 1:
        return wp.vec2d(g[0], g[1])
    if k == 2:
        return wp.vec2d(g[2], g[3])
    return wp.vec2d(-g[0] - g[2], -g[1] - g[3])


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
    n = contact.normal[i]
    if wp.dot(n, n) > half:
        skin = contact.skin[i]
        before = contact.pressed[i]
        push = wp.max(before + skin * wp.dot(contact.centre[i] - x, n), zero)
        e += half * (push * push - before * before) / skin
        f += n * push
        most = contact.most[i]
        if most > zero:
            off = x - contact.anchor[i]
            off = off - n * wp.dot(off, n)
            way = wp.length(off)
            pull = contact.grip[i] * way
            if pull <= most:
                e += half * pull * way
                f -= off * contact.grip[i]
            else:
                e += most * (way - half * most / contact.grip[i])
                f -= off * (most / way)
    energy[i] = e
    if motion.fixed[i] != wp.int8(0):
        f = wp.vec3d(zero, zero, zero)
    force[i] = f


@wp.kernel
def load_contact(
    motion: Motion,
    contact: Contact,
    offset: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    cell_force: wp.array(dtype=wp.vec3d),
    bending: Bending,
    moment: wp.array(dtype=wp.vec3d),
    first: int,
):
    """Set the forces of body and friction to what they can carry of the forces on cloth that dynamic relaxation has brought there.

    motion, offset, entry, cell_force, moment: as of `gather_drape`. contact: pressed and rubbed are set.
    """
    i = natural(wp.tid() + first)
    f = gather(i, offset, entry, cell_force, bending, moment)
    f[1] = f[1] - motion.weight[i]
    n = contact.normal[i]
    push = wp.float64(0.0)
    if wp.dot(n, n) > wp.float64(0.5) and wp.dot(motion.position[i] - contact.centre[i], n) < TOUCH:
        push = wp.max(-wp.dot(f, n), push)
    contact.pressed[i] = push
    contact.rubbed[i] = -f


@wp.func
def friction_force(x: wp.vec3d, n: wp.vec3d, anchor: wp.vec3d, grip: wp.float64, most: wp.float64):
    """Return the force of friction: a spring to the anchor in the plane, at most `most` [N]."""
    off = anchor - x
    off = off - n * wp.dot(off, n)
    return off * wp.min(grip, most / wp.max(wp.length(off), TINY))


@wp.kernel
def carry_contact(motion: Motion, contact: Contact, first: int):
    """Take over the forces of body and friction at the present places, and put back on its plane what presses on it.

    This is the update of the augmented Lagrangian: where the body pushed by its depth, it then pushes at no depth.

    motion: of which position is moved. contact: pressed and rubbed are set.
    """
    i = natural(wp.tid() + first)
    zero = wp.float64(0.0)
    n = contact.normal[i]
    if wp.dot(n, n) < wp.float64(0.5):
        contact.pressed[i] = zero
        return
    x = motion.position[i]
    depth = wp.dot(contact.centre[i] - x, n)
    push = wp.max(contact.pressed[i] + contact.skin[i] * depth, zero)
    contact.rubbed[i] = friction_force(x, n, contact.anchor[i], contact.grip[i], contact.most[i])
    contact.pressed[i] = push
    if push > zero and motion.fixed[i] == wp.int8(0):
        motion.position[i] = x + n * depth


@wp.kernel
def anchor_friction(motion: Motion, contact: Contact, first: int):
    """Put the anchors of friction where its force is what was rubbed, within Coulomb's bound and in the present plane.

    motion: of which position counts. contact: pressed, most and anchor are set.
    """
    i = natural(wp.tid() + first)
    n = contact.normal[i]
    if wp.dot(n, n) < wp.float64(0.5):
        contact.pressed[i] = wp.float64(0.0)
    most = contact.friction * contact.pressed[i]
    f = contact.rubbed[i]
    f = f - n * wp.dot(f, n)
    f = f * wp.min(wp.float64(1.0), most / wp.max(wp.length(f), TINY))
    contact.most[i] = most
    contact.anchor[i] = motion.position[i] + f / contact.grip[i]


@wp.kernel
def stiffen_cloth(
    position: wp.array(dtype=wp.vec3d),
    corner: wp.array(dtype=wp.vec3i),
    gradient: wp.array(dtype=wp.vec4d),
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
    at = corner[c]
    g = gradient[c]
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    half = wp.float64(0.5)
    origin = position[natural(at[0])]
    d1 = position[natural(at[1])] - origin
    d2 = position[natural(at[2])] - origin
    warp = d1 * g[0] + d2 * g[2]
    weft = d1 * g[1] + d2 * g[3]
    length_warp = wp.max(wp.length(warp), TINY)
    length_weft = wp.max(wp.length(weft), TINY)
    e = wp.vec2d(length_warp - one, length_weft - one)
    law = stretched_sheet(e, cloth)
    shear = sheared_threads(wp.dot(warp, weft), cloth)
    slope = sheet_slopes(e, cloth)
    # The part of the stress [[a, tau], [tau, b]] that pulls.
    a = law[0] / length_warp
    b = law[1] / length_weft
    middle = half * (a + b)
    radius = wp.max(wp.sqrt(half * half * (a - b) * (a - b) + shear[0] * shear[0]), TINY)
    high = wp.abs(middle + radius)
    low = wp.abs(middle - radius)
    across = half * (high - low) / radius
    mean = half * (high + low)
    a_pull = mean + across * half * (a - b)
    b_pull = mean - across * half * (a - b)
    tau_pull = across * shear[0]
    u = warp / length_warp
    v = weft / length_weft
    unit = wp.identity(n=3, dtype=wp.float64)
    of_warp = (
        wp.outer(u, u) * wp.max(slope[0] - a_pull, zero) + unit * (a_pull + pull) + wp.outer(weft, weft) * shear[2]
    )
    of_weft = (
        wp.outer(v, v) * wp.max(slope[1] - b_pull, zero) + unit * (b_pull + pull) + wp.outer(warp, warp) * shear[2]
    )
    of_both = wp.outer(u, v) * slope[2] + unit * tau_pull + wp.outer(weft, warp) * shear[2]
    for k in range(9):
        i = k / 3
        j = k % 3
        along_i = corner_gradient(g, i)
        along_j = corner_gradient(g, j)
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
    n = contact.normal[i]
    x = motion.position[i]
    if wp.dot(n, n) > wp.float64(0.5):
        beside = unit - wp.outer(n, n)
        if contact.pressed[i] + contact.skin[i] * wp.dot(contact.centre[i] - x, n) > zero:
            total += wp.outer(n, n) * contact.skin[i]
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


@wp.func
def rub(force: wp.vec3d, slide: wp.vec3d, most: wp.float64):
    """Return the tangential force with Coulomb's friction, which is at most `most` [N]; zero where the vertex sticks.

    force: tangential [N]. slide: tangential way per step [m].
    """
    pull = wp.length(force)
    way = wp.length(slide)
    against = force / wp.max(pull, TINY)
    if way >= STILL:
        against = slide / way
    elif pull <= most:
        return wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    return force - against * most


@wp.kernel
def advance_drape(
    motion: Motion,
    contact: Contact,
    offset: wp.array(dtype=wp.int32),
    entry: wp.array(dtype=wp.int32),
    force: wp.array(dtype=wp.vec3d),
    bending: Bending,
    moment: wp.array(dtype=wp.vec3d),
    halted: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    power: wp.array(dtype=wp.float64),
    residual: wp.array(dtype=wp.float64),
    pressing: wp.array(dtype=wp.float64),
):
    """Take one step of dynamic relaxation at each vertex; contact and friction act on the gathered forces.

    motion: moved in place. offset: #V+1, entry: where in `force` those of the cells on
    each vertex are [N]. moment: as of `evaluate_curvature`. halted: one number, 1
    if the velocities count as zero. power: #V, force times velocity [N m]. residual: #V, the force that is left [N].
    pressing: #V, the normal force on the body [N].
    """
    i = natural(wp.tid() + first)
    zero = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    power[i] = wp.float64(0.0)
    residual[i] = wp.float64(0.0)
    pressing[i] = wp.float64(0.0)
    if motion.fixed[i] != wp.int8(0):
        motion.velocity[i] = zero
        return
    x = motion.position[i]
    v = motion.velocity[i]
    if halted[0] != 0:
        v = zero
    f = gather(i, offset, entry, force, bending, moment) - wp.vec3d(wp.float64(0.0), motion.weight[i], wp.float64(0.0))
    n = contact.normal[i]
    near = wp.dot(n, n) > wp.float64(0.5)
    if near and wp.dot(x - contact.centre[i], n) < TOUCH:
        push = -wp.dot(f, n)
        if push > wp.float64(0.0):
            pressing[i] = push
            v = v - n * wp.min(wp.dot(v, n), wp.float64(0.0))
            slide = v - n * wp.dot(v, n)
            before = f + n * push
            f = rub(before, slide, contact.friction * push)
            if wp.length(slide) < STILL and wp.length(f) == wp.float64(0.0):
                v = zero
    residual[i] = wp.length(f)
    power[i] = wp.dot(f, v)
    v = v + f / motion.mass[i]
    way = wp.length(v)
    if way > contact.longest_step:
        v = v * (contact.longest_step / way)
    x = x + v
    if near:
        depth = wp.dot(x - contact.centre[i], n)
        if depth < wp.float64(0.0):
            x = x - n * depth
            v = v - n * wp.min(wp.dot(v, n), wp.float64(0.0))
    motion.position[i] = x
    motion.velocity[i] = v


@wp.kernel
def watch_power(
    power: wp.array(dtype=wp.float64),
    first: int,
    # outputs
    halted: wp.array(dtype=wp.int32),
):
    """Say whether the forces have done negative work: power has a sum for each of some blocks; halted: one number."""
    total = wp.float64(0.0)
    i = natural(wp.tid() + first)
    count = power.shape[0]
    while i < count:
        total += power[i]
        i += 1
    halted[0] = wp.where(total < wp.float64(0.0), 1, 0)
