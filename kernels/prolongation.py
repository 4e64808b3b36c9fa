"""Transfer between a level and the next coarser one: interpolation by weighted sums, restriction by their transpose."""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False})


@wp.struct
class Weights:
    """A sparse matrix by rows: row i has `column` and `weight` from `offset[i]` to `offset[i + 1]`."""

    offset: wp.array(dtype=wp.int32)
    column: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)


@wp.struct
class Transpose:
    """The transpose of a `Weights` matrix.

    Column j has the rows `row`, and their weights as entries number `entry`, from `offset[j]` to `offset[j + 1]`.
    """

    offset: wp.array(dtype=wp.int32)
    row: wp.array(dtype=wp.int32)
    entry: wp.array(dtype=wp.int32)


@wp.func
def weighted_sum(i: int, weights: Weights, values: wp.array(dtype=wp.vec2d)):
    """Return row i of the matrix times `values`."""
    total = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    e = natural(weights.offset[i])
    end = weights.offset[i + 1]
    while e < end:
        total += weights.weight[e] * values[natural(weights.column[e])]
        e += 1
    return total


@wp.kernel
def transfer(
    weights: Weights,
    values: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    result: wp.array(dtype=wp.vec2d),
):
    """Interpolate a layout or a correction on the finer level: result_i = sum_j w_ij values_j."""
    i = natural(wp.tid() + first)
    result[i] = weighted_sum(i, weights, values)


@wp.kernel
def coarse_difference(
    kept: wp.array(dtype=wp.int32),
    fine: wp.array(dtype=wp.vec2d),
    coarse: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    difference: wp.array(dtype=wp.vec2d),
):
    """Compute the displacement of the coarse layout from the fine one [m]. kept: #coarse, the fine vertices."""
    i = natural(wp.tid() + first)
    difference[i] = coarse[i] - fine[natural(kept[i])]


@wp.kernel
def coarse_load(
    prolongation: Weights,
    transpose: Transpose,
    residual: wp.array(dtype=wp.vec2d),
    force: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    load: wp.array(dtype=wp.vec2d),
):
    """Compute the coarse load P^T residual - force [N] (full approximation scheme).

    Under it the coarse forces in the injected layout are the restricted residual forces. force: of the coarse level
    without load.
    """
    i = natural(wp.tid() + first)
    total = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    e = natural(transpose.offset[i])
    end = transpose.offset[i + 1]
    while e < end:
        total += prolongation.weight[natural(transpose.entry[e])] * residual[natural(transpose.row[e])]
        e += 1
    load[i] = total - force[i]


@wp.kernel
def correct(
    base: wp.array(dtype=wp.vec2d),
    correction: wp.array(dtype=wp.vec2d),
    share: wp.float64,
    freedom: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    position: wp.array(dtype=wp.vec2d),
):
    """Set position = base + share * correction, as far as a vertex is free to move [m]."""
    i = natural(wp.tid() + first)
    position[i] = base[i] + share * wp.cw_mul(correction[i], freedom[i])


@wp.kernel
def inject(
    kept: wp.array(dtype=wp.int32),
    fine: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    coarse: wp.array(dtype=wp.vec2d),
):
    """Copy the fine positions of the coarse level's vertices [m]. kept: #coarse, the fine vertices."""
    i = natural(wp.tid() + first)
    coarse[i] = fine[natural(kept[i])]


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

    gone, parent, weight: #V, as `coarsen.collapse` and `coarsen.locate` have them; passes: their number. row: #V, the row of each
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
