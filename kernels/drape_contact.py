"""Contact of draped cloth with a body: its planes, and the forces of body and friction that rounds of an augmented Lagrangian carry."""

import warp as wp

from .drape import TINY, Bending, Contact, Motion, friction_force, gap_of, gather, normal_of, push_of_plane
from .indices import natural

wp.set_module_options({"enable_backward": False})

# Distance from its plane at which a vertex rests on the body [m].
TOUCH = wp.constant(wp.float64(1.0e-6))
# A depth falls enough from round to round if it falls to this share.
FALLS = wp.constant(wp.float64(0.25))
# The skin is never stiffer than this share of a vertex's fictitious mass, some quarter of the cloth in tension: a plane is found anew
# where the cloth has slid to, a little off the one before, and by a stiffer skin that would be a blow.
STIFFEST = wp.constant(wp.float64(0.015))
# The normals of a groove's two sides have a cosine below this one.
TURNED = wp.constant(wp.float32(0.5))
# What lies nearer to a ball's middle than this share of its radius is one more side of the groove, of so many at most; in a sharper groove
# its middle would be farther off than so many radii. The middle goes so often from side to side.
HITS = wp.constant(wp.float32(0.99))
SIDES = wp.constant(8)
SHARPEST = wp.constant(wp.float32(2.0))
SWEEPS = wp.constant(16)
mat83 = wp.types.matrix(shape=(8, 3), dtype=wp.float32)
vec8 = wp.types.vector(length=8, dtype=wp.float32)


@wp.func
def normal_at(mesh: wp.uint64, body_normal: wp.array(dtype=wp.vec3), face: int, u: wp.float32, v: wp.float32):
    """Return the interpolated unit normal at a place of a mesh; body_normal: at its vertices."""
    indices = wp.mesh_get(mesh).indices
    return wp.normalize(
        u * body_normal[indices[3 * face]]
        + v * body_normal[indices[3 * face + 1]]
        + (1.0 - u - v) * body_normal[indices[3 * face + 2]]
    )


@wp.func
def ball_among(
    mesh: wp.uint64, body_normal: wp.array(dtype=wp.vec3), x: wp.vec3, place: wp.vec3, n: wp.vec3, radius: wp.float32
):
    """Return the middle nearest to x of the balls of a radius that no side of a groove cuts, and the number of its sides.

    It moves no farther than x does, whichever side is the nearest. The sides are planes; the projection is that of Hildreth (1957).
    place, n: the nearest place of the mesh and the normal there.
    """
    normal = mat83()
    least = vec8()
    push = vec8()
    middle = x
    sides = int(0)
    while sides < SIDES:
        normal[sides] = n
        least[sides] = wp.dot(place, n) + radius
        sides += 1
        sweep = int(0)
        while sweep < SWEEPS:
            for k in range(sides):
                more = wp.max(push[k] + least[k] - wp.dot(middle, normal[k]), 0.0)
                middle += normal[k] * (more - push[k])
                push[k] = more
            sweep += 1
        other = wp.mesh_query_point_no_sign(mesh, middle, HITS * radius)
        if not other.result:
            break
        place = wp.mesh_eval_position(mesh, other.face, other.u, other.v)
        n = normal_at(mesh, body_normal, other.face, other.u, other.v)
    return middle, sides


@wp.kernel
def find_planes(
    mesh: wp.uint64,
    body_normal: wp.array(dtype=wp.vec3),
    position: wp.array(dtype=wp.vec3d),
    reach: wp.float32,
    largest: wp.float32,
    first: int,
    # outputs
    centre: wp.array(dtype=wp.vec3d),
    normal: wp.array(dtype=wp.vec3d),
    ball: wp.array(dtype=wp.float64),
):
    """Find the body's plane at each vertex: the nearest place of its surface and the interpolated normal there.

    A sign is not asked for, as it is arbitrary at distance zero. A vertex that has come to the other side of a groove lies inside of a ball
    from then on, which touches both sides, as in the body's morphological closing.

    mesh: the body. body_normal: its normals at its vertices. position: #V [m]. reach: longest distance [m]. largest: radius of a ball [m].
    centre, normal, ball: those of `Contact`, #V, before and after; the normal is zero where the body is out of reach.
    """
    i = natural(wp.tid() + first)
    p = position[i]
    query = wp.mesh_query_point_no_sign(mesh, wp.vec3(wp.float32(p[0]), wp.float32(p[1]), wp.float32(p[2])), reach)
    before = wp.vec3(wp.float32(normal[i][0]), wp.float32(normal[i][1]), wp.float32(normal[i][2]))
    rolled = ball[i] > wp.float64(0.0)
    normal[i] = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    ball[i] = wp.float64(0.0)
    if query.result:
        place = wp.mesh_eval_position(mesh, query.face, query.u, query.v)
        n = normal_at(mesh, body_normal, query.face, query.u, query.v)
        x = wp.vec3(wp.float32(p[0]), wp.float32(p[1]), wp.float32(p[2]))
        turned = wp.dot(before, before) > 0.5 and wp.dot(before, n) < TURNED
        if (rolled or turned) and wp.dot(x - place, n) < largest:
            middle, sides = ball_among(mesh, body_normal, x, place, n, largest)
            inwards = wp.normalize(middle - x)
            if (
                sides > 1
                and sides < SIDES
                and wp.length(middle - place) < SHARPEST * largest
                and wp.dot(inwards, n) > 0.0
            ):
                place = middle - inwards * largest
                n = inwards
                ball[i] = wp.float64(largest)
        centre[i] = wp.vec3d(wp.float64(place[0]), wp.float64(place[1]), wp.float64(place[2]))
        normal[i] = wp.vec3d(wp.float64(n[0]), wp.float64(n[1]), wp.float64(n[2]))


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
    x = motion.position[i]
    n = normal_of(contact, i, x)
    push = wp.float64(0.0)
    if wp.dot(n, n) > wp.float64(0.5) and gap_of(contact, i, x) < TOUCH:
        push = wp.max(-wp.dot(f, n), push)
    contact.pressed[i] = push
    contact.rubbed[i] = -f


@wp.kernel
def carry_contact(motion: Motion, contact: Contact, stiffer: wp.float64, first: int):
    """Take over the forces of body and friction at the present places, and put back on its plane what presses on it.

    This is the update of the augmented Lagrangian: where the body pushed by its depth, it then pushes at no depth. Where tight cloth
    is much stiffer than the skin, that takes many rounds, unless the skin becomes stiffer (Nocedal and Wright 2006, framework 17.4).

    motion: of which position is moved, and mass counts. contact: pressed, rubbed and depth are set, and skin where the depth has not
    fallen enough.
    stiffer: by how much the skin becomes stiffer there.
    """
    i = natural(wp.tid() + first)
    zero = wp.float64(0.0)
    x = motion.position[i]
    n = normal_of(contact, i, x)
    before = contact.depth[i]
    contact.depth[i] = zero
    if wp.dot(n, n) < wp.float64(0.5):
        contact.pressed[i] = zero
        return
    gap = gap_of(contact, i, x)
    push = push_of_plane(gap, contact.skin[i], contact.pressed[i])
    if push > zero:
        contact.depth[i] = wp.abs(gap)
        if wp.abs(gap) > wp.max(FALLS * before, TOUCH):
            stiff = wp.min(contact.skin[i] * stiffer, STIFFEST * motion.mass[i])
            contact.skin[i] = wp.max(contact.skin[i], stiff)
    contact.rubbed[i] = friction_force(x, n, contact.anchor[i], contact.grip[i], contact.most[i])
    contact.pressed[i] = push
    if push > zero and motion.fixed[i] == wp.int8(0):
        motion.position[i] = x - n * gap


@wp.kernel
def anchor_friction(motion: Motion, contact: Contact, first: int):
    """Put the anchors of friction where its force is what was rubbed, within Coulomb's bound and in the present plane.

    motion: of which position counts. contact: pressed, most and anchor are set.
    """
    i = natural(wp.tid() + first)
    n = normal_of(contact, i, motion.position[i])
    if wp.dot(n, n) < wp.float64(0.5):
        contact.pressed[i] = wp.float64(0.0)
    most = contact.friction * contact.pressed[i]
    f = contact.rubbed[i]
    f = f - n * wp.dot(f, n)
    f = f * wp.min(wp.float64(1.0), most / wp.max(wp.length(f), TINY))
    contact.most[i] = most
    contact.anchor[i] = motion.position[i] + f / contact.grip[i]
