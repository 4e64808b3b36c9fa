"""Shortest paths on a mesh: the first leg of each vertex's path, and values carried along the paths.

`find_ways` and `carry_along` run in one thread each, which goes through the vertices in order; every vertex uses the
new results of those before it. `go_around` finds the vertices on either side of a line. Products are not fused, so that
mirror images get the same lengths.
"""

import warp as wp

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# Vertices in a row that are counted together.
CROWD = wp.constant(64)
_PI = wp.constant(wp.float64(3.141592653589793))


@wp.kernel
def see_sides(
    vertices: wp.array(dtype=wp.vec3d),
    triangles: wp.array2d(dtype=wp.int32),
    slot: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    ends: wp.array(dtype=wp.vec2i),
    seen: wp.array(dtype=wp.vec3d),
):
    """Measure the sides opposite to corners of triangles, from the next corner to the one after that.

    vertices: #V [m]. triangles: #T by 3. slot: #R, 3 times the triangle plus the corner. ends: #R, the side's vertices
    a and b.
    seen: #R, the length of the side, where the foot of the corner's height on it lies, and the height [m].
    """
    r = wp.tid() + first
    t = slot[r] / 3
    c = slot[r] - 3 * t
    a = triangles[t, (c + 1) % 3]
    b = triangles[t, (c + 2) % 3]
    side = vertices[b] - vertices[a]
    away = vertices[triangles[t, c]] - vertices[a]
    length = wp.length(side)
    safe = length
    if length == wp.float64(0.0):
        safe = wp.float64(1.0)
    ends[r] = wp.vec2i(a, b)
    seen[r] = wp.vec3d(length, wp.dot(away, side) / safe, wp.length(wp.cross(away, side)) / safe)


@wp.func
def slope_along(length: wp.float64, da: wp.float64, db: wp.float64):
    """Return the slope of the distance along a side, less steep than a path along it."""
    steepest = wp.float64(1.0) - wp.float64(1.0e-15)
    if length == wp.float64(0.0):
        return wp.float64(0.0)
    return wp.clamp((db - da) / length, -steepest, steepest)


@wp.func
def length_over(seen: wp.vec3d, da: wp.float64, db: wp.float64):
    """Return the length of the shortest path from a corner over the opposite side a-b, measured by `see_sides`."""
    s = slope_along(seen[0], da, db)
    r = wp.sqrt(wp.float64(1.0) - s * s)
    place = seen[1] * r - s * seen[2]  # times r
    if place <= wp.float64(0.0):
        return da + wp.sqrt(seen[1] * seen[1] + seen[2] * seen[2])
    if place >= seen[0] * r:
        beyond = seen[0] - seen[1]
        return db + wp.sqrt(beyond * beyond + seen[2] * seen[2])
    return da + s * seen[1] + r * seen[2]


@wp.func
def may_lead(seen: wp.vec3d, i: int, here: wp.float64, other: wp.float64, near: wp.float64):
    """Return whether a path from the i-th end of the opposite side of a corner may be shorter than `near`.

    It leads over the side between the corner, at distance `here`, and the other end; it is no shorter than the distance
    that it leads to plus the height.
    """
    along = seen[1]
    if i == 0:
        along = seen[0] - seen[1]
    room = near - wp.min(here, other)
    area = seen[0] * seen[2]
    return room > wp.float64(0.0) and room * room * (along * along + seen[2] * seen[2]) >= area * area


@wp.func
def place_on_side(seen: wp.vec3d, da: wp.float64, db: wp.float64):
    """Return where that path crosses the side, as a share of it from a, and the length of the leg to there."""
    s = slope_along(seen[0], da, db)
    place = wp.clamp(seen[1] - s * seen[2] / wp.sqrt(wp.float64(1.0) - s * s), wp.float64(0.0), seen[0])
    off = place - seen[1]
    share = wp.float64(0.0)
    if seen[0] > wp.float64(0.0):
        share = place / seen[0]
    return wp.vec2d(share, wp.sqrt(off * off + seen[2] * seen[2]))


@wp.kernel
def find_ways(
    offset: wp.array(dtype=wp.int32),
    ends: wp.array(dtype=wp.vec2i),
    seen: wp.array(dtype=wp.vec3d),
    reach: int,
    at_once: int,
    tolerance: wp.float64,
    # outputs
    distance: wp.array(dtype=wp.float64),
    waiting: wp.array(dtype=wp.int32),
    crowd: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
    second: wp.array(dtype=wp.int32),
    share: wp.array(dtype=wp.float64),
    leg: wp.array(dtype=wp.float64),
    shortened: wp.array(dtype=wp.int32),
):
    """Find the best first leg of each waiting vertex given the distances.

    A vertex whose path is now shorter lets those of its neighbours wait whose paths may then become shorter, too.

    Vertices are numbered about as far as they are. One that lies at most `reach` numbers back looks again at once, any
    other in the next launch; after `at_once` ways have become shorter, all do.

    offset: #V+1, where each vertex's entries in `ends` and `seen` begin, which are those of `see_sides`. tolerance:
    [m], less is not shorter. distance: #V [m], upper bounds before and after, 0 or more; lowered. waiting: #V, 1 where
    a way is to be found, 2 where ways end. crowd: #V / CROWD, rounded up, how many of so many vertices in a row wait:
    where none does, all are passed over at once. first, second: #V, the side over which the way out of a vertex leads;
    share: #V, how much of that lies before the place where the way passes; leg: #V, how far the place is [m]; all of
    those that were waiting.
    shortened: 1, how many ways have become shorter is added to it.
    """
    v = int(0)
    while v < distance.shape[0]:
        follow = v + 1
        if crowd[v / CROWD] == 0:
            follow = (v / CROWD + 1) * CROWD
        elif waiting[v] == 1:
            waiting[v] = 0
            crowd[v / CROWD] = crowd[v / CROWD] - 1
            best = wp.float64(wp.inf)
            over = offset[v]
            for r in range(offset[v], offset[v + 1]):
                da = distance[ends[r][0]]
                db = distance[ends[r][1]]
                # Ways are no shorter than the distance that they lead to and the height.
                if wp.min(da, db) + seen[r][2] < best and wp.max(da, db) < wp.inf:
                    length = length_over(seen[r], da, db)
                    if length < best:
                        best = length
                        over = r
            if best < wp.inf:
                a = ends[over][0]
                b = ends[over][1]
                place = place_on_side(seen[over], distance[a], distance[b])
                first[v] = a
                second[v] = b
                share[v] = place[0]
                leg[v] = place[1]
            if best < distance[v] - tolerance:
                distance[v] = best
                shortened[0] = shortened[0] + 1
                for r in range(offset[v], offset[v + 1]):
                    for i in range(2):
                        near = ends[r][i]
                        if waiting[near] == 0 and may_lead(seen[r], i, best, distance[ends[r][1 - i]], distance[near]):
                            waiting[near] = 1
                            crowd[near / CROWD] = crowd[near / CROWD] + 1
                            if near >= v - reach and shortened[0] < at_once:
                                follow = wp.min(follow, near)
        v = follow


@wp.kernel
def carry_along(
    first: wp.array(dtype=wp.int32),
    second: wp.array(dtype=wp.int32),
    share: wp.array(dtype=wp.float64),
    leg: wp.array(dtype=wp.float64),
    order: wp.array(dtype=wp.int32),
    fixed: wp.array(dtype=wp.int32),
    grows: wp.float64,
    # outputs
    value: wp.array2d(dtype=wp.float64),
    change: wp.array(dtype=wp.float64),
):
    """Give each vertex the values where its first leg ends, plus `grows` times the leg.

    first, second, share, leg: #V, the ways, as `find_ways` gives them. order: #V. fixed: #V, 1 where the value stays.
    value: #V by #K. change: #K, the largest change of each column, if that is more than what it holds.
    """
    for k in range(order.shape[0]):
        v = order[k]
        if fixed[v] == 0:
            a = first[v]
            b = second[v]
            for j in range(value.shape[1]):
                new = value[a, j] + share[v] * (value[b, j] - value[a, j]) + grows * leg[v]
                change[j] = wp.max(change[j], wp.abs(new - value[v, j]))
                value[v, j] = new


@wp.kernel
def go_around(
    path: wp.array(dtype=wp.int32),
    on_path: wp.array(dtype=wp.int8),
    offset: wp.array(dtype=wp.int32),
    sides: wp.array(dtype=wp.vec2i),
    angle: wp.array(dtype=wp.float64),
    away: wp.array(dtype=wp.vec2d),
    # outputs
    visited: wp.array(dtype=wp.int32),
    at: wp.array(dtype=wp.int32),
    lies: wp.array(dtype=wp.vec3d),
    count: wp.array(dtype=wp.int32),
):
    """Visit the vertices around each vertex of a line, from its neighbours on the line both ways; for one thread.

    A visit ends at the border, at the line or after half a turn. Where the ring is closed, angles are scaled to a full
    turn.

    path: #P, vertices. on_path: #V, 1 for these. offset: #P+1, where each one's triangles begin. sides: #R, their other
    vertices anticlockwise; angle: #R, between these [rad]; away: #R, how far they are [m].
    visited: #N, vertices. at: #N, around which of the line. lies: #N, 1 to the right of the line and -1 to the left,
    the angle passed [rad], how far it is [m]. count: 1, N.
    """
    last = path.shape[0] - 1
    number = int(0)
    for i in range(path.shape[0]):
        begin = offset[i]
        end = offset[i + 1]
        turn = wp.float64(0.0)
        closed = int(1)
        for e in range(begin, end):
            turn += angle[e]
            led_on = int(0)
            for f in range(begin, end):
                if sides[f][0] == sides[e][1]:
                    led_on = 1
            if led_on == 0:
                closed = 0
        scale = wp.float64(1.0)
        if closed == 1:
            scale = wp.float64(2.0) * _PI / wp.max(turn, wp.float64(2.2250738585072014e-308))
        # From the one before on, then from the one after, anticlockwise and clockwise.
        kind = int(0)
        while kind < 4:
            start = kind / 2
            way = kind % 2
            # Anticlockwise of the one before lies the right, of the one after the left.
            sign = wp.float64((1 - 2 * start) * (1 - 2 * way))
            beside = i - 1 + 2 * start
            here = int(-1)
            if beside >= 0 and beside <= last:
                here = path[beside]
            passed = wp.float64(0.0)
            while here >= 0 and number < visited.shape[0]:
                over = int(-1)
                for e in range(begin, end):
                    if sides[e][way] == here:
                        over = e
                here = -1
                if over >= 0:
                    passed += angle[over] * scale
                    on = sides[over][1 - way]
                    if on_path[on] == wp.int8(0) and passed <= _PI:
                        here = on
                        visited[number] = on
                        at[number] = i
                        lies[number] = wp.vec3d(sign, passed, away[over][1 - way])
                        number += 1
            kind += 1
    count[0] = number
