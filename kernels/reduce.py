"""Sums and least values over blocks of an array, for devices from which copying arrays would be slow.

One thread goes through a block in order, so that a sum repeats bit for bit; sums of sums are taken until few are left.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def sum_blocks(
    values: wp.array(dtype=wp.float64),
    begin: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Sum each block. begin: #B+1, where blocks begin and the last one ends. total: #B."""
    b = wp.tid() + first
    s = wp.float64(0.0)
    for i in range(begin[b], begin[b + 1]):
        s += values[i]
    total[b] = s


@wp.kernel
def least_of_blocks(
    values: wp.array(dtype=wp.float64),
    begin: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    least: wp.array(dtype=wp.float64),
):
    """Find the least value of each block. Arguments as of `sum_blocks`."""
    b = wp.tid() + first
    s = wp.float64(wp.inf)
    for i in range(begin[b], begin[b + 1]):
        s = wp.min(s, values[i])
    least[b] = s


@wp.kernel
def dot_blocks(
    a: wp.array(dtype=wp.vec2d),
    b: wp.array(dtype=wp.vec2d),
    begin: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Sum the scalar products in each block. Arguments as of `sum_blocks`."""
    block = wp.tid() + first
    s = wp.float64(0.0)
    for i in range(begin[block], begin[block + 1]):
        s += wp.dot(a[i], b[i])
    total[block] = s


@wp.kernel
def subtract(
    a: wp.array(dtype=wp.vec2d),
    b: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    difference: wp.array(dtype=wp.vec2d),
):
    """Compute a - b, all #V."""
    i = wp.tid() + first
    difference[i] = a[i] - b[i]


@wp.kernel
def add_share(
    share: wp.float64,
    vector: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    total: wp.array(dtype=wp.vec2d),
):
    """Add share * vector to the total, all #V."""
    i = wp.tid() + first
    total[i] = total[i] + share * vector[i]
