"""A surface laid flat face by face: creases of quads, diagonals, cells.

Products are not fused, as in NumPy, so that quads that are mirror images of each other get the same results.
"""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# Diagonals that pass each other within this share of their length belong to a flat quad, creased or not.
FLAT = wp.constant(wp.float64(1.0e-9))
# A diagonal is the crease if the surface is curved along it less than this share of what it is along the other one;
# where the mesh around tells nothing, if it is longer.
STRAIGHTER = wp.constant(wp.float64(0.5))
LONGER = wp.constant(wp.float64(1.0 - 1.0e-6))
# Smaller turns [rad] are ignored.
NO_TURN = wp.constant(wp.float64(1.0e-7))
TINY = wp.constant(wp.float64(2.2250738585072014e-308))


@wp.kernel
def find_bends(
    vertices: wp.array(dtype=wp.vec3d),
    faces: wp.array(dtype=wp.vec4i),
    first: int,
    # outputs
    normal: wp.array(dtype=wp.vec3d),
    bent: wp.array(dtype=wp.int8),
):
    """Find the quads whose corners lie in no plane.

    normal: #F, with twice the face's area as length, for a quad at right angles to both diagonals [m2]. bent: #F, 1 for
    a convex quad that is not flat, else 0.
    """
    f = natural(wp.tid() + first)
    face = faces[f]
    p0 = vertices[natural(face[0])]
    p1 = vertices[natural(face[1])]
    p2 = vertices[natural(face[2])]
    bent[f] = wp.int8(0)
    if face[3] < 0:
        normal[f] = wp.cross(p1 - p0, p2 - p0)
    else:
        p3 = vertices[natural(face[3])]
        n = wp.cross(p2 - p0, p3 - p1)
        normal[f] = n
        longer = wp.max(wp.length(p2 - p0), wp.length(p3 - p1))
        if (
            wp.abs(wp.dot(p1 - p0, n)) > FLAT * wp.length(n) * longer
            and wp.dot(wp.cross(p1 - p0, p2 - p1), n) > wp.float64(0.0)
            and wp.dot(wp.cross(p2 - p1, p3 - p2), n) > wp.float64(0.0)
            and wp.dot(wp.cross(p3 - p2, p0 - p3), n) > wp.float64(0.0)
            and wp.dot(wp.cross(p0 - p3, p1 - p0), n) > wp.float64(0.0)
        ):
            bent[f] = wp.int8(1)


@wp.kernel
def average_normals(
    offset: wp.array(dtype=wp.int32),
    corner: wp.array(dtype=wp.int32),
    normal: wp.array(dtype=wp.vec3d),
    first: int,
    # outputs
    mean: wp.array(dtype=wp.vec3d),
):
    """Average the normals of the faces around each vertex by area.

    mean: #V, of length 1. normal: #F, as long as faces are large.

    offset: #V+1, into `corner`: 4 times the face plus the column.
    """
    i = natural(wp.tid() + first)
    there = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    e = natural(offset[i])
    end = offset[i + 1]
    while e < end:
        there += normal[natural(corner[e]) / 4]
        e += 1
    mean[i] = there / wp.max(wp.length(there), TINY)


@wp.kernel
def measure_triangles(
    vertices: wp.array(dtype=wp.vec3d),
    triangles: wp.array(dtype=wp.vec3i),
    first: int,
    # outputs
    area: wp.array(dtype=wp.float64),
    product: wp.array(dtype=wp.vec3d),
):
    """Measure triangles in space.

    area: #T [m2]. product: #T, at each corner the scalar product of the two edges that leave it [m2].
    """
    i = natural(wp.tid() + first)
    corner = triangles[i]
    p = vertices[natural(corner[0])]
    q = vertices[natural(corner[1])]
    r = vertices[natural(corner[2])]
    a = q - p
    b = r - q
    c = p - r
    area[i] = wp.float64(0.5) * wp.length(wp.cross(a, c))
    product[i] = wp.vec3d(-wp.dot(a, c), -wp.dot(a, b), -wp.dot(b, c))


@wp.func
def turn_along(from_normal: wp.vec3d, to_normal: wp.vec3d, diagonal: wp.vec3d, length: wp.float64):
    """Return the angle by which the surface turns from one end of a diagonal to the other [rad], for small angles."""
    return wp.abs(wp.dot(to_normal - from_normal, diagonal)) / wp.max(length, TINY)


@wp.kernel
def find_creases(
    vertices: wp.array(dtype=wp.vec3d),
    faces: wp.array(dtype=wp.vec4i),
    bent: wp.array(dtype=wp.int8),
    normal: wp.array(dtype=wp.vec3d),
    first: int,
    # outputs
    crease: wp.array(dtype=wp.int8),
):
    """Find the diagonal along which a bent quad is creased: 0 for corners 0-2, 1 for 1-3, else -1. normal: #V, unit."""
    f = natural(wp.tid() + first)
    crease[f] = wp.int8(-1)
    if bent[f] != wp.int8(0):
        face = faces[f]
        d02 = vertices[natural(face[2])] - vertices[natural(face[0])]
        d13 = vertices[natural(face[3])] - vertices[natural(face[1])]
        l02 = wp.length(d02)
        l13 = wp.length(d13)
        m02 = turn_along(normal[face[0]], normal[face[2]], d02, l02)
        m13 = turn_along(normal[face[1]], normal[face[3]], d13, l13)
        share = STRAIGHTER
        if wp.max(m02, m13) > NO_TURN:
            m02 = m02 / wp.max(l02, TINY)
            m13 = m13 / wp.max(l13, TINY)
        else:
            share = LONGER
            m02 = l13
            m13 = l02
        if m02 < share * m13:
            crease[f] = wp.int8(0)
        if m13 < share * m02:
            crease[f] = wp.int8(1)


@wp.func
def unfolded(
    a: wp.vec3d, b: wp.vec3d, p: wp.vec3d, q: wp.vec3d, normal: wp.vec3d, straight: wp.float64, length: wp.float64
):
    """Return the distance of a and b with both triangles on the hinge p-q laid into one plane.

    a, p, b, q run around the quad. straight, length: distances of a and b, and of p and q, in space.
    """
    hinge = q - p
    if length == wp.float64(0.0):
        return straight
    cross_a = wp.cross(p - a, hinge)
    cross_b = wp.cross(b - p, hinge)
    # Where the corner a or b points inwards, a-b runs inside the quad and the hinge outside of it: nothing to unfold.
    if wp.dot(cross_a, normal) < wp.float64(0.0) or wp.dot(cross_b, normal) < wp.float64(0.0):
        return straight
    along = wp.dot(b - a, hinge) / length
    across = (wp.length(cross_a) + wp.length(cross_b)) / length
    return wp.sqrt(along * along + across * across)


@wp.kernel
def unfold_diagonals(
    vertices: wp.array(dtype=wp.vec3d),
    quads: wp.array(dtype=wp.vec4i),
    crease: wp.array(dtype=wp.int8),
    first: int,
    # outputs
    length: wp.array(dtype=wp.vec2d),
):
    """Measure the diagonals 0-2 and 1-3 of quads along the surface [m]; that along a crease is straight. All #Q."""
    q = natural(wp.tid() + first)
    quad = quads[q]
    p0 = vertices[natural(quad[0])]
    p1 = vertices[natural(quad[1])]
    p2 = vertices[natural(quad[2])]
    p3 = vertices[natural(quad[3])]
    normal = wp.cross(p2 - p0, p3 - p1)
    straight_02 = wp.length(p2 - p0)
    straight_13 = wp.length(p3 - p1)
    l02 = straight_02
    l13 = straight_13
    if crease[q] != wp.int8(0):
        l02 = unfolded(p0, p2, p1, p3, normal, straight_02, straight_13)
    if crease[q] != wp.int8(1):
        l13 = unfolded(p1, p3, p2, p0, normal, straight_13, straight_02)
    length[q] = wp.vec2d(l02, l13)


@wp.func
def beside(out: wp.vec3d, hinge: wp.vec3d, length: wp.float64, side: wp.float64):
    """Return the point `out` from the hinge's beginning, in the plane in which the hinge is the x axis."""
    return wp.vec3d(wp.dot(out, hinge) / length, side * wp.length(wp.cross(hinge, out)) / length, wp.float64(0.0))


@wp.func
def lay_cell(p: wp.vec3d, q: wp.vec3d, r: wp.vec3d):
    """Return a triangle laid flat with p at the origin and q along x: x of q, x and y of r [m]."""
    a = q - p
    b = r - p
    length = wp.length(a)
    safe = length
    if length == wp.float64(0.0):
        safe = wp.float64(1.0)
    return wp.vec3d(length, wp.dot(a, b) / safe, wp.length(wp.cross(a, b)) / safe)


@wp.kernel
def lay_cells(
    vertices: wp.array(dtype=wp.vec3d),
    faces: wp.array(dtype=wp.vec4i),
    crease: wp.array(dtype=wp.int8),
    cell: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    laid: wp.array(dtype=wp.vec3d),
):
    """Lay cells flat: one of a triangle, four at a quad's corners; those of a creased quad lie in the unfolded quad.

    crease: #F, as `find_creases` has it. cell: #F, the first of each face. laid: #C, as `cells.Cells` has them [m].
    """
    f = natural(wp.tid() + first)
    face = faces[f]
    c = natural(cell[f])
    p0 = vertices[natural(face[0])]
    p1 = vertices[natural(face[1])]
    p2 = vertices[natural(face[2])]
    if face[3] < 0:
        laid[c] = lay_cell(p0, p1, p2)
    else:
        p3 = vertices[natural(face[3])]
        if crease[f] == wp.int8(0):
            hinge = p2 - p0
            length = wp.length(hinge)
            p1 = beside(p1 - p0, hinge, length, wp.float64(-1.0))
            p3 = beside(p3 - p0, hinge, length, wp.float64(1.0))
            p0 = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
            p2 = wp.vec3d(length, wp.float64(0.0), wp.float64(0.0))
        elif crease[f] == wp.int8(1):
            hinge = p3 - p1
            length = wp.length(hinge)
            p2 = beside(p2 - p1, hinge, length, wp.float64(-1.0))
            p0 = beside(p0 - p1, hinge, length, wp.float64(1.0))
            p1 = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
            p3 = wp.vec3d(length, wp.float64(0.0), wp.float64(0.0))
        # the last corner, each corner, and the first two again
        before = p3
        here = p0
        after = p1
        last = p2
        for k in range(4):
            laid[c + k] = lay_cell(before, here, after)
            keep = before
            before = here
            here = after
            after = last
            last = keep


@wp.kernel
def add_areas(
    faces: wp.array(dtype=wp.vec4i),
    cell: wp.array(dtype=wp.int32),
    laid: wp.array(dtype=wp.vec3d),
    offset: wp.array(dtype=wp.int32),
    slot: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Sum a third of the weighted areas of the cells around each vertex [m2].

    cell: #F, the first of each face. laid: #C, as `lay_cells` has them. offset: #V+1, into `slot`: 4 times the face
    plus the corner.
    """
    i = natural(wp.tid() + first)
    twice = wp.float64(0.0)
    e = natural(offset[i])
    end = offset[i + 1]
    while e < end:
        f = natural(slot[e]) / 4
        if faces[f][3] < 0:
            laid_flat = laid[natural(cell[f])]
            twice += laid_flat[0] * laid_flat[2]
        else:
            # A quad's corner is in three of its four cells, not in that of the corner across.
            c = cell[f]
            before = laid[natural(c + ((slot[e] + 3) & 3))]
            here = laid[natural(c + (slot[e] & 3))]
            after = laid[natural(c + ((slot[e] + 1) & 3))]
            twice += wp.float64(0.5) * (before[0] * before[2] + here[0] * here[2] + after[0] * after[2])
        e += 1
    total[i] = twice / wp.float64(6.0)
