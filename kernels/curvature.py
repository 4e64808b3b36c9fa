"""Curvature at the vertices of a surface: a paraboloid fitted to the neighbours of each."""

import warp as wp

# Loops over the unknowns stay loops: unrolled they would take seconds to compile.
wp.set_module_options({"enable_backward": False, "max_unroll": 1})

mat55d = wp.types.matrix(shape=(5, 5), dtype=wp.float64)
vec5d = wp.types.vector(length=5, dtype=wp.float64)

ROUNDS = wp.constant(3)
# Neighbours in one row leave a direction undetermined; this much counts it as flat.
FLAT = wp.constant(wp.float64(1.0e-9))


@wp.func
def tangent_to(normal: wp.vec3d):
    """A unit vector square to a normal."""
    least = int(0)
    for k in range(1, 3):
        if wp.abs(normal[k]) < wp.abs(normal[least]):
            least = k
    axis = wp.vec3d()
    axis[least] = wp.float64(1.0)
    return wp.normalize(wp.cross(normal, axis))


@wp.func
def solve_scaled(matrix: mat55d, right: vec5d):
    """The unknowns of a normal equation, scaled first so that metres do not matter (Cholesky)."""
    scale = vec5d()
    for i in range(5):
        scale[i] = wp.sqrt(wp.max(matrix[i, i], wp.float64(1.0e-300)))
    lower = mat55d()
    x = vec5d()
    for i in range(5):
        x[i] = right[i] / scale[i]
        for j in range(i + 1):
            entry = matrix[i, j] / (scale[i] * scale[j])
            if i == j:
                entry += FLAT
            for k in range(j):
                entry -= lower[i, k] * lower[j, k]
            if i == j:
                lower[i, i] = wp.sqrt(wp.max(entry, FLAT))
            else:
                lower[i, j] = entry / lower[j, j]
        for k in range(i):
            x[i] -= lower[i, k] * x[k]
        x[i] /= lower[i, i]
    for n in range(5):
        i = 4 - n
        for k in range(i + 1, 5):
            x[i] -= lower[k, i] * x[k]
        x[i] /= lower[i, i]
    for i in range(5):
        x[i] /= scale[i]
    return x


@wp.kernel
def fit_curvature(
    vertices: wp.array(dtype=wp.vec3d),
    offset: wp.array(dtype=wp.int32),
    neighbor: wp.array(dtype=wp.int32),
    normals: wp.array(dtype=wp.vec3d),
    begin: int,
    first: int,
    # outputs
    tensor: wp.array(dtype=wp.mat33d),
):
    """The second fundamental form at each vertex from `begin` on, as a tensor in space [1/m].

    A neighbour at d from the vertex lies 1/2 |d|^2 k(direction) below the tangent plane; normal and k are fitted in turns, per length, so
    that near neighbours count as much as far ones.

    vertices: #V [m]. offset: where the neighbours of each vertex from `begin` on begin; neighbours at its own place do not count, and a
    vertex with fewer than five counts as flat. normals: #V, unit, a first guess. tensor: #V.
    """
    i = wp.tid() + first
    v = i + begin
    here = vertices[v]
    normal = normals[v]
    flat = mat55d()
    u = wp.vec3d()
    w = wp.vec3d()
    fitted = vec5d()
    for _round in range(ROUNDS):
        u = tangent_to(normal)
        w = wp.cross(normal, u)
        matrix = flat
        right = vec5d()
        count = int(0)
        for e in range(offset[i], offset[i + 1]):
            d = vertices[neighbor[e]] - here
            squared = wp.dot(d, d)
            if squared > wp.float64(0.0):
                count += 1
                x = wp.dot(d, u)
                y = wp.dot(d, w)
                size = wp.float64(0.5) / wp.max(x * x + y * y, wp.float64(1.0e-300))
                row = vec5d(size * x * x, wp.float64(2.0) * size * x * y, size * y * y, x / squared, y / squared)
                drop = -wp.dot(d, normal) / squared
                for a in range(5):
                    right[a] += row[a] * drop
                    for b in range(a + 1):
                        matrix[a, b] += row[a] * row[b]
        fitted = vec5d()
        if count >= 5:
            fitted = solve_scaled(matrix, right)
        normal = wp.normalize(normal + fitted[3] * u + fitted[4] * w)
    tensor[v] = fitted[0] * wp.outer(u, u) + fitted[1] * (wp.outer(u, w) + wp.outer(w, u)) + fitted[2] * wp.outer(w, w)
