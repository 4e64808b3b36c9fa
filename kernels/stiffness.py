"""Lengths and stiffnesses of springs, and their lists vertex by vertex."""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# Hourglass stiffness of quads over that of a membrane.
HOURGLASS_SHARE = wp.constant(wp.float64(0.25))


@wp.kernel
def measure_edges(
    vertices: wp.array(dtype=wp.vec3d),
    ends: wp.array(dtype=wp.vec2i),
    first: int,
    # outputs
    length: wp.array(dtype=wp.float64),
):
    """Compute the distance of the two ends of each edge [m]."""
    e = natural(wp.tid() + first)
    length[e] = wp.length(vertices[natural(ends[e][0])] - vertices[natural(ends[e][1])])


@wp.kernel
def list_springs(
    offset: wp.array(dtype=wp.int32),
    end: wp.array(dtype=wp.int32),
    ends: wp.array(dtype=wp.vec2i),
    spring_count: int,
    first: int,
    # outputs
    neighbor: wp.array(dtype=wp.int32),
    spring: wp.array(dtype=wp.int32),
):
    """List the springs around each vertex, sorted by the vertices at their far ends.

    offset: #V+1, where each vertex's entries begin in `end`: the spring at its second end, or #S more at its first, so
    that edges, sorted by their lower vertex, are in order already. neighbor, spring: 2 #S, in the same order but for
    that within a vertex.
    """
    i = natural(wp.tid() + first)
    begin = natural(offset[i])
    e = begin
    e_end = offset[i + 1]
    while e < e_end:
        s = end[e]
        there = int(0)
        if s < spring_count:
            there = ends[s][0]
        else:
            s = s - spring_count
            there = ends[s][1]
        at = int(e)
        while at > begin and neighbor[at - 1] > there:
            neighbor[at] = neighbor[at - 1]
            spring[at] = spring[at - 1]
            at -= 1
        neighbor[at] = there
        spring[at] = s
        e += 1


@wp.kernel
def find_sides(
    corner: wp.array(dtype=wp.vec3i),
    offset: wp.array(dtype=wp.int32),
    neighbor: wp.array(dtype=wp.int32),
    spring: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    side: wp.array(dtype=wp.vec3i),
):
    """Find the springs along each cell's edges 0-1, 1-2, 2-0; -1 where there is none.

    offset, neighbor, spring: as `list_springs` has them.
    """
    c = natural(wp.tid() + first)
    found = wp.vec3i(-1, -1, -1)
    for k in range(3):
        i = corner[c][k]
        j = corner[c][(k + 1) % 3]
        e = natural(offset[i])
        end = offset[i + 1]
        while e < end:
            if neighbor[e] == j:
                found[k] = spring[e]
            e += 1
    side[c] = found


@wp.kernel
def sum_stiffness(
    offset: wp.array(dtype=wp.int32),
    stiffness: wp.array(dtype=wp.float64),
    pair_share: wp.float64,
    first: int,
    # outputs
    around: wp.array(dtype=wp.float64),
):
    """Sum the k_ij listed around each vertex, and add a share of the stiffest, #V [N/m]."""
    i = natural(wp.tid() + first)
    total = wp.float64(0.0)
    stiffest = wp.float64(0.0)
    e = natural(offset[i])
    end = offset[i + 1]
    while e < end:
        k = stiffness[e]
        total += k
        stiffest = wp.max(stiffest, k)
        e += 1
    around[i] = total + pair_share * stiffest


@wp.struct
class Lattice:
    """A fabric as a lattice of springs along the edges of quads.

    warp: unit vector in the plane. k_warp, k_weft: K [N/m].
    shear: G [N/m].
    least: share of K that a structural spring keeps.
    """

    warp: wp.vec2d
    k_warp: wp.float64
    k_weft: wp.float64
    shear: wp.float64
    least: wp.float64


@wp.func
def hourglass_stiffness(k: wp.float64, lattice: Lattice, ratio: wp.float64, inverse: wp.float64):
    """Return the stiffness that a quad should have in its hourglass mode along the sides of K = k [N/m].

    It is a quarter of a membrane's, or the share that structural springs have in a square, where that is less, as in cloth
    that is stiff in shear.
    ratio: of the other sides to these, and its inverse.
    """
    in_square = wp.max(k - lattice.shear, lattice.least * k)
    share = HOURGLASS_SHARE
    if in_square < HOURGLASS_SHARE * (k + lattice.shear):
        share = in_square / (k + lattice.shear)
    return share * (k * ratio + lattice.shear * inverse)


@wp.kernel
def weigh_quads(
    vertices: wp.array(dtype=wp.vec3d),
    position: wp.array(dtype=wp.vec2d),
    quads: wp.array(dtype=wp.vec4i),
    side: wp.array(dtype=wp.int32),
    wider: wp.array(dtype=wp.vec2d),
    lattice: Lattice,
    first: int,
    # outputs
    stiffness: wp.array(dtype=wp.float64),
    diagonal: wp.array(dtype=wp.float64),
    lack: wp.array(dtype=wp.vec2d),
    hold: wp.array(dtype=wp.float64),
):
    """Compute the stiffness that a quad gives to the springs along its sides and to both diagonals [N/m].

    A cell a by b has springs K b/a, less the part of its diagonals G (a2 + b2)/2ab, half of it on each of two sides.
    The pair of edges nearer to the warp is chosen for each quad. Where a quad is so long that next to nothing would be
    left along it, its diagonals are weaker.

    side: #Q, the first of each quad's half-edges. wider: #Q, how many times as long as on the body a and b are in the
    cloth.
    stiffness: #H. diagonal: #Q. lack: #Q, their shear deficit, as `cells.Cells.shear`. hold: #Q, missing stiffness of
    the hourglass mode, in which no diagonal is strained [N/m].
    """
    q = natural(wp.tid() + first)
    quad = quads[q]
    d = (position[natural(quad[1])] - position[natural(quad[0])]) + (
        position[natural(quad[2])] - position[natural(quad[3])]
    )
    ka = lattice.k_warp
    kb = lattice.k_weft
    if wp.abs(lattice.warp[0] * d[1] - lattice.warp[1] * d[0]) > wp.abs(wp.dot(lattice.warp, d)):
        ka = lattice.k_weft
        kb = lattice.k_warp
    p0 = vertices[natural(quad[0])]
    p1 = vertices[natural(quad[1])]
    p2 = vertices[natural(quad[2])]
    p3 = vertices[natural(quad[3])]
    half = wp.float64(0.5)
    a = half * (wp.length(p1 - p0) + wp.length(p3 - p2)) * wider[q][0]
    b = half * (wp.length(p2 - p1) + wp.length(p0 - p3)) * wider[q][1]
    ratio = b / a
    inverse = a / b
    most = (wp.float64(1.0) - lattice.least) * wp.min(ka * ratio * ratio, kb * inverse * inverse)
    shear = wp.min(lattice.shear, most)
    half_a = half * (ka * ratio - shear * inverse)
    half_b = half * (kb * inverse - shear * ratio)
    lack[q] = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    if shear < lattice.shear:
        # Along the longer sides, whichever of its corners the quad begins at.
        if b > a:
            d = (position[natural(quad[3])] - position[natural(quad[0])]) + (
                position[natural(quad[2])] - position[natural(quad[1])]
            )
        lack[q] = wp.normalize(d) * wp.pow(lattice.shear - shear, wp.float64(0.25))
    # An hourglass mode of 1 m strains a side by 2 m, and the hourglass spring by 4 m.
    short = wp.max(
        hourglass_stiffness(ka, lattice, ratio, inverse) - wp.float64(2.0) * half_a,
        hourglass_stiffness(kb, lattice, inverse, ratio) - wp.float64(2.0) * half_b,
    )
    hold[q] = wp.float64(0.25) * wp.max(short, wp.float64(0.0))
    h = natural(side[q])
    stiffness[h] = half_a
    stiffness[h + 1] = half_b
    stiffness[h + 2] = half_a
    stiffness[h + 3] = half_b
    diagonal[q] = half * shear * (inverse + ratio)
