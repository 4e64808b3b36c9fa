"""A coarser mesh by collapsing edges: each vertex finds the neighbour into which it may vanish, and where it then lies."""

import warp as wp

wp.set_module_options({"enable_backward": False})

# 4 sqrt(3) area / sum of squared sides: 1 for an equilateral triangle, below 0 for a turned one.
_EQUILATERAL = wp.constant(wp.float64(3.4641016151377544))
# Least quality of a new triangle on the body and in the plane, and least cosine of the turn of a border at a vertex that may vanish.
LEAST_QUALITY = wp.constant(wp.float64(0.15))
LEAST_FLAT_QUALITY = wp.constant(wp.float64(0.05))
LEAST_STRAIGHT = wp.constant(wp.float64(0.7))


@wp.struct
class Ring:
    """Triangles and where they are around each vertex.

    vertices: #V, on the body [m]. layout: #V, in the plane [m]. corner: #T, anticlockwise.
    offset: #V+1, where each vertex's entries in `slot` begin.
    slot: 3 times the triangle plus the corner. before, after: #V, its neighbours along the border, -1 inside.
    """

    vertices: wp.array(dtype=wp.vec3d)
    layout: wp.array(dtype=wp.vec2d)
    corner: wp.array(dtype=wp.vec3i)
    offset: wp.array(dtype=wp.int32)
    slot: wp.array(dtype=wp.int32)
    before: wp.array(dtype=wp.int32)
    after: wp.array(dtype=wp.int32)


@wp.func
def corner_of(ring: Ring, slot: int, turn: int):
    """The vertex of the slot's triangle that is `turn` corners on."""
    return ring.corner[slot / 3][(slot % 3 + turn) % 3]


@wp.func
def quality(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, normal: wp.vec3d):
    """Of a triangle as seen along the normal."""
    ab = b - a
    ac = c - a
    bc = c - b
    sides = wp.dot(ab, ab) + wp.dot(ac, ac) + wp.dot(bc, bc)
    return _EQUILATERAL * wp.dot(wp.cross(ab, ac), normal) / wp.max(sides, wp.float64(1.0e-300))


@wp.func
def flat_quality(a: wp.vec2d, b: wp.vec2d, c: wp.vec2d):
    """Of a triangle in the plane."""
    ab = b - a
    ac = c - a
    bc = c - b
    sides = wp.dot(ab, ab) + wp.dot(ac, ac) + wp.dot(bc, bc)
    return _EQUILATERAL * (ab[0] * ac[1] - ab[1] * ac[0]) / wp.max(sides, wp.float64(1.0e-300))


@wp.func
def normal_at(v: int, ring: Ring):
    """Mean normal of the triangles around a vertex, by area."""
    n = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    here = ring.vertices[v]
    for e in range(ring.offset[v], ring.offset[v + 1]):
        a = ring.vertices[corner_of(ring, ring.slot[e], 1)]
        b = ring.vertices[corner_of(ring, ring.slot[e], 2)]
        n += wp.cross(a - here, b - here)
    return wp.normalize(n)


@wp.func
def is_neighbor(v: int, w: int, ring: Ring):
    for e in range(ring.offset[v], ring.offset[v + 1]):
        if corner_of(ring, ring.slot[e], 1) == w or corner_of(ring, ring.slot[e], 2) == w:
            return True
    return False


@wp.func
def worst_after(v: int, u: int, normal: wp.vec3d, ring: Ring):
    """Least quality of the triangles that are left where v vanishes into u: 2 where none is, -1 where one is bad in the plane."""
    worst = wp.float64(2.0)
    for e in range(ring.offset[v], ring.offset[v + 1]):
        a = corner_of(ring, ring.slot[e], 1)
        b = corner_of(ring, ring.slot[e], 2)
        if a != u and b != u:
            worst = wp.min(worst, quality(ring.vertices[u], ring.vertices[a], ring.vertices[b], normal))
            if flat_quality(ring.layout[u], ring.layout[a], ring.layout[b]) < LEAST_FLAT_QUALITY:
                worst = wp.min(worst, wp.float64(-1.0))
    return worst


@wp.func
def common_neighbors(v: int, u: int, ring: Ring):
    """How many vertices are neighbours of both, counted along the triangles around v."""
    count = int(0)
    for e in range(ring.offset[v], ring.offset[v + 1]):
        a = corner_of(ring, ring.slot[e], 1)
        b = corner_of(ring, ring.slot[e], 2)
        if a != u and is_neighbor(u, a, ring):
            count += 1
        if b != u and b == ring.before[v] and is_neighbor(u, b, ring):
            count += 1
    return count


@wp.kernel
def find_border(
    ring: Ring,
    first: int,
    # outputs
    before: wp.array(dtype=wp.int32),
    after: wp.array(dtype=wp.int32),
):
    """before, after: #V, as in `Ring`; the same vertex in both where two borders touch, so that it stays."""
    v = wp.tid() + first
    before[v] = -1
    after[v] = -1
    ends = int(0)
    for e in range(ring.offset[v], ring.offset[v + 1]):
        a = corner_of(ring, ring.slot[e], 1)
        b = corner_of(ring, ring.slot[e], 2)
        a_lone = int(1)
        b_lone = int(1)
        for f in range(ring.offset[v], ring.offset[v + 1]):
            if corner_of(ring, ring.slot[f], 2) == a:
                a_lone = 0
            if corner_of(ring, ring.slot[f], 1) == b:
                b_lone = 0
        if a_lone == 1:
            after[v] = a
            ends += 1
        if b_lone == 1:
            before[v] = b
    if ends > 1:
        before[v] = after[v]


@wp.kernel
def find_targets(
    ring: Ring,
    first: int,
    # outputs
    target: wp.array(dtype=wp.int32),
):
    """target: #V, the neighbour into which each vertex vanishes with the best triangles left; -1 where it has to stay.

    A vertex of the border vanishes along the border, where that is nearly straight. So corners stay, and the two sides of a crack,
    whose vertices are different ones at the same place, stay apart. No two vertices are joined that are joined already.
    """
    v = wp.tid() + first
    target[v] = -1
    before = ring.before[v]
    after = ring.after[v]
    shared = int(2)
    if before >= 0:
        shared = 1
        back = wp.normalize(ring.vertices[v] - ring.vertices[before])
        on = wp.normalize(ring.vertices[after] - ring.vertices[v])
        if before == after or wp.dot(back, on) < LEAST_STRAIGHT:
            return
    normal = normal_at(v, ring)
    best = wp.float64(LEAST_QUALITY)
    for e in range(ring.offset[v], ring.offset[v + 1]):
        for turn in range(1, 3):
            u = corner_of(ring, ring.slot[e], turn)
            # Inside, each neighbour comes once as the first of a triangle's two.
            if (before < 0 and turn == 1) or u == before or u == after:  # noqa: SIM109
                worst = worst_after(v, u, normal, ring)
                if worst > best and worst < wp.float64(1.5) and common_neighbors(v, u, ring) == shared:
                    best = worst
                    target[v] = u


@wp.func
def scrambled(v: int):
    """A number that looks random, the same in every run."""
    x = wp.uint32(v + 1) * wp.uint32(73244475)
    x = (x ^ (x >> wp.uint32(16))) * wp.uint32(73244475)
    return x ^ (x >> wp.uint32(16))


@wp.kernel
def select(
    ring: Ring,
    target: wp.array(dtype=wp.int32),
    before: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    after: wp.array(dtype=wp.int32),
):
    """One round in which vertices that may vanish are chosen, never two neighbours. States: 0 open, 1 chosen, 2 out."""
    v = wp.tid() + first
    after[v] = before[v]
    if before[v] == 0:
        if target[v] < 0:
            after[v] = 2
            return
        mine = scrambled(v)
        leads = int(1)
        for e in range(ring.offset[v], ring.offset[v + 1]):
            for turn in range(1, 3):
                w = corner_of(ring, ring.slot[e], turn)
                if before[w] == 1:
                    after[v] = 2
                elif before[w] == 0 and target[w] >= 0:
                    other = scrambled(w)
                    if other > mine or (other == mine and w > v):
                        leads = 0
        if after[v] == 0 and leads == 1:
            after[v] = 1


@wp.kernel
def place(
    ring: Ring,
    target: wp.array(dtype=wp.int32),
    chosen: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    parent: wp.array(dtype=wp.vec3i),
    weight: wp.array(dtype=wp.vec3d),
):
    """Where a vanished vertex lies in the triangles that are left: three vertices and its barycentric weights, none negative."""
    i = wp.tid() + first
    v = chosen[i]
    u = target[v]
    normal = normal_at(v, ring)
    here = ring.vertices[v]
    best = -wp.float64(wp.inf)
    for e in range(ring.offset[v], ring.offset[v + 1]):
        a = corner_of(ring, ring.slot[e], 1)
        b = corner_of(ring, ring.slot[e], 2)
        if a != u and b != u:
            pu = ring.vertices[u] - here
            pa = ring.vertices[a] - here
            pb = ring.vertices[b] - here
            w = wp.vec3d(
                wp.dot(wp.cross(pa, pb), normal), wp.dot(wp.cross(pb, pu), normal), wp.dot(wp.cross(pu, pa), normal)
            )
            total = w[0] + w[1] + w[2]
            if total > wp.float64(0.0):
                w = w / total
                least = wp.min(w[0], wp.min(w[1], w[2]))
                if least > best:
                    best = least
                    w = wp.vec3d(
                        wp.max(w[0], wp.float64(0.0)), wp.max(w[1], wp.float64(0.0)), wp.max(w[2], wp.float64(0.0))
                    )
                    parent[i] = wp.vec3i(u, a, b)
                    weight[i] = w / (w[0] + w[1] + w[2])
