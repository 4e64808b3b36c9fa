"""Cubic interpolation along rows and columns, through the four nearest vertices that a coarser lattice keeps."""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False})

# Neighbours count as at least so far apart [m].
NEAREST = wp.constant(wp.float64(1.0e-9))


@wp.struct
class Nodes:
    """The up to three nearest kept vertices on one side: their number, indices and distances [m]."""

    count: int
    vertex: wp.vec3i
    away: wp.vec3d


@wp.func
def find_nodes(
    v: int,
    vertices: wp.array(dtype=wp.vec3d),
    following: wp.array(dtype=wp.int32),
    kept: wp.array(dtype=wp.int32),
):
    """Return the kept vertices that follow v, as far as the row runs without a break."""
    nodes = Nodes()
    at = int(v)
    away = wp.float64(0.0)
    while nodes.count < 3:
        further = following[at]
        if further < 0:
            break
        # Vertices at one place count as apart, so that weights stay finite.
        away += wp.max(wp.length(vertices[further] - vertices[at]), NEAREST)
        at = further
        if kept[at] != 0:
            nodes.vertex[nodes.count] = at
            nodes.away[nodes.count] = away
            nodes.count += 1
    return nodes


@wp.kernel
def weigh_cubics(
    vertices: wp.array(dtype=wp.vec3d),
    before: wp.array(dtype=wp.int32),
    after: wp.array(dtype=wp.int32),
    kept: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    column: wp.array(dtype=wp.vec4i),
    weight: wp.array(dtype=wp.vec4d),
):
    """Find the kept vertices around each vertex, and their weights in the polynomial through them.

    Two lie before it and two after it, near an end more on the other side.

    vertices: #V [m]. before, after: #V, its neighbours along the row, -1 at the ends. kept: #V, 1 or 0; the ends are.
    column, weight: #V; a kept vertex has itself.
    """
    v = wp.tid() + first
    column[v] = wp.vec4i(v, v, v, v)
    weight[v] = wp.vec4d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    if kept[v] == 0:
        back = find_nodes(v, vertices, before, kept)
        ahead = find_nodes(v, vertices, after, kept)
        takes_back = wp.min(back.count, 2)
        takes_ahead = wp.min(ahead.count, 4 - takes_back)
        if takes_ahead < 2:
            takes_back = wp.min(back.count, 4 - takes_ahead)
        if takes_back == 2:
            takes_ahead = wp.min(takes_ahead, 2)
        place = wp.vec4d()
        count = int(0)
        for k in range(takes_back):
            column[v][count] = back.vertex[k]
            place[count] = -back.away[k]
            count += 1
        for k in range(takes_ahead):
            column[v][count] = ahead.vertex[k]
            place[count] = ahead.away[k]
            count += 1
        for k in range(4):
            share = wp.float64(0.0)
            if k < count:
                share = wp.float64(1.0)
                for other in range(count):
                    if other != k:
                        share *= place[other] / (place[other] - place[k])
            weight[v][k] = share


@wp.kernel
def interpolate_along(
    column: wp.array(dtype=wp.vec4i),
    weight: wp.array(dtype=wp.vec4d),
    values: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    result: wp.array(dtype=wp.vec2d),
):
    """Compute the weighted sum of four values for each vertex. values, result: #V [m]."""
    i = wp.tid() + first
    c = column[i]
    w = weight[i]
    result[i] = w[0] * values[c[0]] + w[1] * values[c[1]] + w[2] * values[c[2]] + w[3] * values[c[3]]


@wp.kernel
def interpolate_along_rows(
    values: wp.array2d(dtype=wp.vec2d),
    grid: wp.array2d(dtype=wp.int32),
    column: wp.array2d(dtype=wp.int32),
    weight: wp.array2d(dtype=wp.float64),
    first: int,
    # outputs
    result: wp.array(dtype=wp.vec2d),
):
    """Compute for each vertex of a grid a weighted sum of values of its row, with the weights of its column.

    values: #R by #K [m]. grid: #R by #C, numbers of the vertices. column, weight: #C by 4 or fewer. result: #V [m].
    """
    p = natural(wp.tid() + first)
    i = p / grid.shape[1]
    j = p - i * grid.shape[1]
    total = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    k = int(0)
    while k < column.shape[1]:
        total += weight[j, k] * values[i, natural(column[j, k])]
        k += 1
    result[natural(grid[i, j])] = total
