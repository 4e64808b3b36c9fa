"""Coarsening of a triangle mesh by edge collapses, and the interpolation from the coarser mesh."""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False})

# Quality is 4 sqrt(3) area / sum of squared sides: 1 for an equilateral triangle, below 0 for a mirrored one. This
# times a parallelogram's area over half the sum.
_EQUILATERAL = wp.constant(wp.float64(1.7320508075688772))
# Least cosine of the border's turn at a vertex that may collapse.
LEAST_STRAIGHT = wp.constant(wp.float64(0.7))


@wp.struct
class Ring:
    """The neighbours around each vertex, anticlockwise.

    Two that follow each other form a triangle with it, and so do the last and the first. At the border the last is -1,
    for the outside.

    vertices: #V, on the body [m].
    offset: #V+1, where each vertex's place in `neighbor` begins. degree: #V, number of entries used.
    neighbor: #N, vertices.
    """

    vertices: wp.array(dtype=wp.vec3d)
    offset: wp.array(dtype=wp.int32)
    degree: wp.array(dtype=wp.int32)
    neighbor: wp.array(dtype=wp.int32)


# --- rings of triangles


@wp.kernel
def sort_corners(
    triangles: wp.array(dtype=wp.vec3i),
    offset: wp.array(dtype=wp.int32),
    # outputs
    degree: wp.array(dtype=wp.int32),
    side: wp.array(dtype=wp.vec2i),
):
    """List the triangles around each vertex; for one thread.

    side: #N, from `offset` on, the other two vertices of each triangle. degree: #V, their number, 0 before.
    """
    for t in range(triangles.shape[0]):
        for k in range(3):
            v = triangles[t][k]
            side[offset[v] + degree[v]] = wp.vec2i(triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3])
            degree[v] = degree[v] + 1


@wp.kernel
def order_rings(
    offset: wp.array(dtype=wp.int32),
    first_side: wp.array(dtype=wp.int32),
    side: wp.array(dtype=wp.vec2i),
    first: int,
    # outputs
    degree: wp.array(dtype=wp.int32),
    neighbor: wp.array(dtype=wp.int32),
):
    """Order the triangles around each vertex to a ring; the degree becomes -1 where they are more than one fan.

    offset, degree, neighbor: as in `Ring`. side: the triangles of `sort_corners`, which begin at `first_side` and whose
    number is in `degree` before.
    """
    v = natural(wp.tid() + first)
    begin = first_side[v]
    end = begin + degree[v]
    ring = offset[v]
    if begin == end:
        return
    # Along the border the first neighbour is one to which no triangle leads.
    start = side[begin][0]
    closed = int(1)
    e = natural(begin)
    while e < end:
        led_to = int(0)
        f = natural(begin)
        while f < end:
            if side[f][1] == side[e][0]:
                led_to = 1
            f += 1
        if led_to == 0:
            start = side[e][0]
            closed = 0
        e += 1
    here = start
    i = natural(begin)
    while i < end:
        neighbor[ring + i - begin] = here
        after = int(-1)
        e = natural(begin)
        while e < end:
            if side[e][0] == here:
                after = side[e][1]
            e += 1
        if after < 0 or (after == start and i + 1 < end):
            degree[v] = -1
            return
        here = after
        i += 1
    if closed == 0:
        neighbor[ring + degree[v]] = here
        neighbor[ring + degree[v] + 1] = -1
        degree[v] = degree[v] + 2


# --- which vertex may vanish into which


@wp.func
def at(ring: Ring, v: int, i: int):
    """Return the i-th entry of a vertex's ring, from 0 up to twice its length."""
    d = ring.degree[v]
    if i >= d:
        i -= d
    return ring.neighbor[ring.offset[v] + i]


@wp.func
def normal_at(v: int, ring: Ring):
    """Return the mean normal of the triangles around a vertex, by area."""
    n = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    here = ring.vertices[v]
    end = ring.offset[v] + ring.degree[v]
    a = ring.neighbor[end - 1]
    pa = ring.vertices[wp.max(a, 0)] - here
    e = natural(ring.offset[v])
    while e < end:
        b = ring.neighbor[e]
        if b >= 0:
            pb = ring.vertices[b] - here
            if a >= 0:
                n += wp.cross(pa, pb)
            pa = pb
        a = b
        e += 1
    return wp.normalize(n)


@wp.func
def worst_after(v: int, j: int, normal: wp.vec3d, ring: Ring):
    """Return the least quality of the triangles left when v collapses into its j-th neighbour, seen along the normal.

    It is 2 if none is left.
    """
    u = ring.vertices[at(ring, v, j)]
    worst = wp.float64(2.0)
    a = at(ring, v, j + 1)
    ua = ring.vertices[wp.max(a, 0)] - u
    aa = wp.dot(ua, ua)
    i = natural(j + 2)
    end = j + ring.degree[v]
    while i < end:
        b = at(ring, v, i)
        if b >= 0:
            ub = ring.vertices[b] - u
            bb = wp.dot(ub, ub)
            if a >= 0:
                area = wp.dot(wp.cross(ua, ub), normal)
                # The squared sides add up to twice this.
                sides = wp.max(aa + bb - wp.dot(ua, ub), wp.float64(1.0e-300))
                worst = wp.min(worst, _EQUILATERAL * area / sides)
            ua = ub
            aa = bb
        a = b
        i += 1
    return worst


@wp.func
def keeps_topology(v: int, j: int, ring: Ring):
    """Return whether v may collapse into its j-th neighbour.

    They must share no neighbours but those of their triangles, and the ring must have room.
    """
    u = at(ring, v, j)
    d = ring.degree[v]
    begin = ring.offset[u]
    end = begin + ring.degree[u]
    if end + d - 4 > ring.offset[u + 1]:
        return False
    i = natural(j + 2)
    while i < j + d - 1:
        a = at(ring, v, i)
        e = natural(begin)
        while e < end:
            if ring.neighbor[e] == a:
                return False
            e += 1
        i += 1
    return True


@wp.func
def find_target(v: int, ring: Ring, least: wp.float64):
    """Return the place in the ring of the neighbour with the best triangles left, and the worst quality of these.

    The quality is above `least`; the place is -1 if the vertex must stay. A border vertex collapses along the border,
    where that is nearly straight. So corners stay, and the two sides of a crack, which have different vertices at the
    same place, stay apart.
    """
    d = ring.degree[v]
    step = int(1)
    if d > 0 and at(ring, v, d - 1) < 0:
        # The first and the last but one are those along the border; a lone triangle's corner stays.
        step = d - 2
        back = wp.normalize(ring.vertices[v] - ring.vertices[at(ring, v, d - 2)])
        on = wp.normalize(ring.vertices[at(ring, v, 0)] - ring.vertices[v])
        if d == 3 or wp.dot(back, on) < LEAST_STRAIGHT:
            d = 0
    normal = normal_at(v, ring)
    # The best one, and if it is not allowed the next best, until none is left.
    bar = wp.float64(1.5)
    best = wp.float64(least)
    best_j = int(0)
    while best_j >= 0:
        best = wp.float64(least)
        best_j = int(-1)
        j = int(0)
        while j < d:
            worst = worst_after(v, j, normal, ring)
            if worst > best and worst < bar:
                best = worst
                best_j = j
            j += step
        bar = best
        if best_j < 0 or keeps_topology(v, best_j, ring):
            break
    return best_j, best


# --- collapses


@wp.func
def find_entry(v: int, w: int, ring: Ring):
    """Return the entry of the neighbour w in the ring of v."""
    e = ring.offset[v]
    while ring.neighbor[e] != w:
        e += 1
    return e


@wp.func
def shift(ring: Ring, v: int, begin: int, by: int):
    """Move the rest of a vertex's ring from `begin` on by some entries."""
    end = ring.offset[v] + ring.degree[v]
    if by > 0:
        for k in range(end - begin):
            ring.neighbor[end - 1 - k + by] = ring.neighbor[end - 1 - k]
    if by < 0:
        for e in range(begin, end):
            ring.neighbor[e + by] = ring.neighbor[e]
    ring.degree[v] = ring.degree[v] + by


@wp.func
def collapse_into(v: int, j: int, ring: Ring):
    """Collapse a vertex into its j-th neighbour; its own ring is kept."""
    d = ring.degree[v]
    u = at(ring, v, j)
    here = find_entry(u, v, ring)
    shift(ring, u, here + 1, d - 4)
    for i in range(j + 1, j + d):
        a = at(ring, v, i)
        inner = i > j + 1 and i < j + d - 1
        if inner:
            ring.neighbor[here + i - j - 2] = a
        if a >= 0:
            e = find_entry(a, v, ring)
            if inner:
                ring.neighbor[e] = u
            else:
                shift(ring, a, e + 1, -1)


@wp.kernel
def collapse(
    ring: Ring,
    least: wp.float64,
    good: wp.float64,
    enough: int,
    most: int,
    # outputs
    passes: wp.array(dtype=wp.int32),
    remain: wp.array(dtype=wp.int32),
    target: wp.array(dtype=wp.int32),
    beside: wp.array(dtype=wp.int32),
    gone: wp.array(dtype=wp.int32),
):
    """Collapse vertices one by one in passes, never two neighbours in the same pass; for one thread.

    First those collapse that leave triangles of `good` quality, then those above the `least`. It ends with a pass after
    which no more than `enough` remain, or which collapsed few, or after `most` passes.

    passes: 1, number of passes. remain: 1, number of vertices left. target: #V, the place of the neighbour into which
    each vertex collapses, as in `find_target`. beside: #V, the last pass in which a neighbour collapsed, 0 before.
    gone: #V, the pass in which the vertex itself collapsed, 0 before.
    """
    lost = int(remain[0])
    while remain[0] > enough and 50 * lost >= remain[0] and passes[0] < most:
        number = passes[0] + 1
        before = int(remain[0])
        for turn in range(2):
            for v in range(gone.shape[0]):
                # What is around a vertex is as it was at the beginning of the pass, until a neighbour vanishes.
                if gone[v] == 0 and beside[v] != number:
                    goes = turn == 1
                    if turn == 0:
                        j, left = find_target(v, ring, least)
                        target[v] = j
                        goes = left > good
                    if goes and target[v] >= 0 and keeps_topology(v, target[v], ring):
                        collapse_into(v, target[v], ring)
                        gone[v] = number
                        remain[0] = remain[0] - 1
                        for e in range(ring.offset[v], ring.offset[v] + ring.degree[v]):
                            if ring.neighbor[e] >= 0:
                                beside[ring.neighbor[e]] = number
        passes[0] = number
        lost = before - remain[0]


@wp.kernel
def locate(
    ring: Ring,
    gone: wp.array(dtype=wp.int32),
    target: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    parent: wp.array(dtype=wp.vec3i),
    weight: wp.array(dtype=wp.vec3d),
):
    """Locate a collapsed vertex in the triangles left: three vertices and its barycentric weights, none negative."""
    v = natural(wp.tid() + first)
    if gone[v] == 0:
        return
    j = target[v]
    u = at(ring, v, j)
    normal = normal_at(v, ring)
    here = ring.vertices[v]
    pu = ring.vertices[u] - here
    best = -wp.float64(wp.inf)
    b = at(ring, v, j + 1)
    i = natural(j + 2)
    end = j + ring.degree[v]
    while i < end:
        a = b
        b = at(ring, v, i)
        if a >= 0 and b >= 0:
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
                    parent[v] = wp.vec3i(u, a, b)
                    weight[v] = w / (w[0] + w[1] + w[2])
        i += 1


@wp.kernel
def compose_rows(
    gone: wp.array(dtype=wp.int32),
    parent: wp.array(dtype=wp.vec3i),
    weight: wp.array(dtype=wp.vec3d),
    passes: int,
    # outputs
    row: wp.array(dtype=wp.int32),
    offset: wp.array(dtype=wp.int32),
    column: wp.array(dtype=wp.int32),
    value: wp.array(dtype=wp.float64),
):
    """Compose the weights of each vertex from those of the kept ones; for one thread.

    Vertices that collapsed last come first, since parents stay longer.

    gone, parent, weight: #V, as `collapse` and `locate` have them; passes: their number. row: #V, the row of each
    vertex, those that are kept first, in their order. offset: #V+1, where rows begin; the last stays 0 if there was not
    room for all. column, value: vertices kept, by their numbers, and their weights.
    """
    rows = int(0)
    end = int(0)
    for back in range(passes + 1):
        number = wp.where(back == 0, 0, passes + 1 - back)
        for v in range(gone.shape[0]):
            if gone[v] == number:
                if number == 0:
                    column[end] = rows
                    value[end] = wp.float64(1.0)
                    end += 1
                else:
                    begin = int(end)
                    for k in range(3):
                        if weight[v][k] != wp.float64(0.0):
                            of = row[parent[v][k]]
                            e = natural(offset[of])
                            e_end = offset[of + 1]
                            while e < e_end:
                                to = int(begin)
                                while to < end and column[to] != column[e]:
                                    to += 1
                                if to == end:
                                    if end == column.shape[0]:
                                        return
                                    column[end] = column[e]
                                    value[end] = wp.float64(0.0)
                                    end += 1
                                value[to] = value[to] + weight[v][k] * value[e]
                                e += 1
                row[v] = rows
                rows += 1
                if rows < gone.shape[0]:
                    offset[rows] = end
    offset[gone.shape[0]] = end
