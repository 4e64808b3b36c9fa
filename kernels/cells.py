"""Cells: triangles (a quad gives its four corner triangles) on which the flat cloth is compared with the surface.

The deformation of a cell is F = dX/dx, from the plane (the cloth, unknown) to the tangent plane of the surface (the
body, given): |F e| - 1 is how much a thread along e is stretched when the piece is worn.

Kernels run face by face, over the one or four cells of each, and what cells do to their corners is added up by face.
"""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False})

# Which faces are evaluated: those in which something acted at the last evaluation of all, or all of them.
ACTING = wp.constant(0)
ALL = wp.constant(1)
# What is wanted of a face: its energy; that and its forces; or what a step takes: forces, bounds on the stiffness, viscosity.
ENERGY = wp.constant(0)
FORCES = wp.constant(1)
STEP = wp.constant(2)


@wp.struct
class Cells:
    """The cells, face by face, and where the shares of the faces' corners are gathered.

    face: #F, vertices, anticlockwise in the plane; -1 for the fourth of a triangle.
    first: #F, the first of each face's cells.
    laid: #C, the cell laid flat as on the surface, with corner 0 at the origin and corner 1 along x: x of corner 1, then
        x and y of corner 2 [m].
    offset: #V+1, where each vertex's entries in `slot` begin.
    slot: 4 times the face plus the corner, for every face around a vertex.
    slack: #F, along warp and weft, 1 over the intended stretch of the worn cloth; 1 where none is intended.
    shear: #F, a direction in the plane times the fourth root of the shear stiffness that the springs of a long quad
        lack there [N/m]; zero for any other face.
    hourglass: #F, weights of a quad's corners in its hourglass mode [(N/m)^1/2]; zero for most.
    """

    face: wp.array(dtype=wp.vec4i)
    first: wp.array(dtype=wp.int32)
    laid: wp.array(dtype=wp.vec3d)
    offset: wp.array(dtype=wp.int32)
    slot: wp.array(dtype=wp.int32)
    slack: wp.array(dtype=wp.vec2d)
    shear: wp.array(dtype=wp.vec2d)
    hourglass: wp.array(dtype=wp.vec4d)


@wp.struct
class CellForces:
    """What the cells do to the corners of their faces, as last evaluated.

    acting: #F, 1 where the last three are written. clearance: #F, the least height of a face's cells in the plane [m], 0 once one
        is mirrored.
    force, viscosity: 4 #F, at the faces' corners [N]; a triangle's fourth is not used.
    stiffness: 4 #F, bound on the energy's second derivative by the corner's place [N/m].
    """

    acting: wp.array(dtype=wp.int8)
    clearance: wp.array(dtype=wp.float64)
    force: wp.array(dtype=wp.vec2d)
    viscosity: wp.array(dtype=wp.vec2d)
    stiffness: wp.array(dtype=wp.float64)


@wp.func
def count_cells(face: wp.vec4i):
    """Return the number of cells of a face: one for a triangle, four for a quad."""
    if face[3] < 0:
        return 1
    return 4


@wp.func
def cell_weight(face: wp.vec4i):
    """Return the share of a cell's area that counts: a quad's four corner triangles cover it twice."""
    if face[3] < 0:
        return wp.float64(1.0)
    return wp.float64(0.5)


@wp.func
def cell_places(face: wp.vec4i, k: int):
    """Return the face's corners in its cell k: a triangle's own, or a quad's corner k between its neighbours."""
    if face[3] < 0:
        return wp.vec3i(0, 1, 2)
    return wp.vec3i((k + 3) & 3, k, (k + 1) & 3)


@wp.func
def corner_at(face: wp.vec4i, k: int):
    """Return the vertex at the face's corner k, 0 to 3, without a vector index that is known only at run time."""
    below = wp.where((k & 1) != 0, face[1], face[0])
    above = wp.where((k & 1) != 0, face[3], face[2])
    return natural(wp.where((k & 2) != 0, above, below))


@wp.func
def cell_corner(face: wp.vec4i, k: int):
    """Return the vertices of the face's cell k."""
    at = cell_places(face, k)
    return wp.vec3i(corner_at(face, at[0]), corner_at(face, at[1]), corner_at(face, at[2]))


@wp.func
def laid_edges(laid: wp.vec3d):
    """Return the edges of a laid cell from corner 0 to corners 1 and 2, as columns [m]."""
    return wp.mat22d(laid[0], laid[1], wp.float64(0.0), laid[2])


@wp.func
def on_body(laid: wp.vec3d, share: wp.vec2d):
    """Return `laid_edges` times a vector."""
    return wp.vec2d(laid[0] * share[0] + laid[1] * share[1], laid[2] * share[1])


@wp.func
def across(D: wp.mat22d, v: wp.vec2d):
    """Return the adjugate of D times a vector: det(D) D^-1 v."""
    return wp.vec2d(D[1, 1] * v[0] - D[0, 1] * v[1], D[0, 0] * v[1] - D[1, 0] * v[0])


@wp.func
def longest_square(D: wp.mat22d):
    """Return the square of the longest side of a cell with these edges [m2]."""
    a = wp.vec2d(D[0, 0], D[1, 0])
    b = wp.vec2d(D[0, 1], D[1, 1])
    return wp.max(wp.dot(a, a), wp.max(wp.dot(b, b), wp.dot(b - a, b - a)))


@wp.func
def edge_matrix(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d):
    """Return the edges of a cell with these corners from the first one, as columns [m]."""
    a = p1 - p0
    b = p2 - p0
    return wp.mat22d(a[0], b[0], a[1], b[1])


@wp.func
def flat_edges(position: wp.array(dtype=wp.vec2d), corner: wp.vec3i):
    """Return the cell's edges from corner 0 to corners 1 and 2 in the plane, as columns [m]."""
    p0 = position[natural(corner[0])]
    p1 = position[natural(corner[1])]
    p2 = position[natural(corner[2])]
    return edge_matrix(p0, p1, p2)


@wp.func
def principal_direction(a: wp.vec2d, b: wp.vec2d):
    """Return the unit vector v for which a v[0] + b v[1] is longest; the vector to its left makes it shortest.

    Turned to these directions, what depends on lengths along them alone is a function of the singular values, and its
    gradient is that with the directions held, since both lengths are stationary.
    """
    two = wp.float64(2.0)
    difference = (wp.dot(a, a) - wp.dot(b, b)) / two
    product = wp.dot(a, b)
    size = wp.sqrt(difference * difference + product * product)
    v = wp.vec2d(wp.float64(1.0), wp.float64(0.0))
    if size > wp.float64(0.0):
        larger = wp.sqrt((size + wp.abs(difference)) / (two * size))
        smaller = product / (two * size * larger)
        v = wp.where(difference >= wp.float64(0.0), wp.vec2d(larger, smaller), wp.vec2d(smaller, larger))
    return v


@wp.func
def combined(v: wp.vec2d, a: wp.vec2d, b: wp.vec2d):
    """Return a v[0] + b v[1]."""
    return a * v[0] + b * v[1]


@wp.func
def turned_left(v: wp.vec2d):
    """Return the vector turned to the left by a right angle."""
    return wp.vec2d(-v[1], v[0])


@wp.func
def clear_corners(out: CellForces, slot: int, wanted: int, viscous: bool):
    """Set what is wanted at the four corners of a face to zero; slot: the first of them."""
    for corner in range(4):
        out.force[slot + corner] = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
        if wanted == STEP:
            out.stiffness[slot + corner] = wp.float64(0.0)
            if viscous:
                out.viscosity[slot + corner] = wp.vec2d(wp.float64(0.0), wp.float64(0.0))


@wp.func
def add_forces(out: wp.array(dtype=wp.vec2d), slot: int, at: wp.vec3i, pull: wp.mat22d):
    """Add a cell's forces, elastic or viscous, on its corners 1 and 2 as columns, to the corners `at` of its face."""
    f1 = wp.vec2d(pull[0, 0], pull[1, 0])
    f2 = wp.vec2d(pull[0, 1], pull[1, 1])
    out[slot + at[0]] -= f1 + f2
    out[slot + at[1]] += f1
    out[slot + at[2]] += f2


@wp.func
def add_stiffness(out: CellForces, slot: int, at: wp.vec3i, bounds: wp.vec3d):
    """Add a cell's bounds to the corners `at` of its face."""
    out.stiffness[slot + at[0]] += bounds[0]
    out.stiffness[slot + at[1]] += bounds[1]
    out.stiffness[slot + at[2]] += bounds[2]


@wp.func
def area_share(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d):
    """Return a cell's signed area in the plane over that on the body."""
    return wp.determinant(edge_matrix(p0, p1, p2)) / wp.max(laid[0] * laid[2], wp.float64(1.0e-300))


@wp.kernel
def find_least_shares(
    position: wp.array(dtype=wp.vec2d),
    face: wp.array(dtype=wp.vec4i),
    cell: wp.array(dtype=wp.int32),
    laid: wp.array(dtype=wp.vec3d),
    first: int,
    # outputs
    share: wp.array(dtype=wp.float64),
):
    """Compute the least signed area in the plane over that on the body of the cells of each face.

    position: #V [m]. face, cell, laid: as in `Cells`. share: #F, 0 or less where a cell is collapsed or mirrored.
    """
    f = natural(wp.tid() + first)
    corners = face[f]
    begin = natural(cell[f])
    p0 = position[natural(corners[0])]
    p1 = position[natural(corners[1])]
    p2 = position[natural(corners[2])]
    if corners[3] < 0:
        share[f] = area_share(p0, p1, p2, laid[begin])
    else:
        p3 = position[natural(corners[3])]
        share[f] = wp.min(
            wp.min(area_share(p3, p0, p1, laid[begin]), area_share(p0, p1, p2, laid[begin + 1])),
            wp.min(area_share(p1, p2, p3, laid[begin + 2]), area_share(p2, p3, p0, laid[begin + 3])),
        )
