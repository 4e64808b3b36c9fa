"""Steps of dynamic relaxation of draped cloth on a body, under Coulomb's friction."""

import warp as wp

from .drape import TINY, Bending, Contact, Motion, gap_of, gather, normal_of
from .drape_contact import TOUCH
from .indices import natural

wp.set_module_options({"enable_backward": False})

# Way per step below which a vertex does not slide [m].
STILL = wp.constant(wp.float64(1.0e-7))


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
    n = normal_of(contact, i, x)
    near = wp.dot(n, n) > wp.float64(0.5)
    if near and gap_of(contact, i, x) < TOUCH:
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
        depth = gap_of(contact, i, x)
        n = normal_of(contact, i, x)
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
