"""Curvature of a surface by paraboloids fitted around the vertices, and along the threads of cloth worn on it."""

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
    """Return a unit vector at right angles to a normal."""
    least = int(0)
    for k in range(1, 3):
        if wp.abs(normal[k]) < wp.abs(normal[least]):
            least = k
    axis = wp.vec3d()
    axis[least] = wp.float64(1.0)
    return wp.normalize(wp.cross(normal, axis))


@wp.func
def solve_scaled(matrix: mat55d, right: vec5d):
    """Solve a normal equation by Cholesky's method, scaled first so that units do not matter."""
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
    """Fit the second fundamental form at each vertex from `begin` on, as a tensor in space [1/m].

    A neighbour at d from the vertex lies 1/2 |d|^2 k(direction) below the tangent plane; normal and k are fitted in
    turns, per length, so that near neighbours count as much as far ones.

    vertices: #V [m]. offset: where the neighbours of each vertex from `begin` on begin; neighbours at its own place do
    not count, and a vertex with fewer than five counts as flat. normals: #V, unit, a first guess. tensor: #V.
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


@wp.func
def worn_along(deformation: wp.mat22d, thread: wp.vec2d, x: wp.vec3d, y: wp.vec3d):
    """Return the direction in space of a thread of the pattern; x, y: axes of the cell in space."""
    worn = wp.normalize(deformation * thread)
    return worn[0] * x + worn[1] * y


@wp.kernel
def bend_threads(
    positions: wp.array(dtype=wp.vec2d),
    vertices: wp.array(dtype=wp.vec3d),
    corner: wp.array(dtype=wp.vec3i),
    laid: wp.array(dtype=wp.vec3d),
    tensor: wp.array(dtype=wp.mat33d),
    warp: wp.vec2d,
    weft: wp.vec2d,
    first: int,
    # outputs
    along: wp.array(dtype=wp.vec4d),
):
    """Compute the body's curvature along warp and weft, their twist, and the sum of its principal curvatures [1/m].

    positions: #V, the pattern [m]. vertices: #V, the body [m]. corner, laid: #C, as `cells.Cells` has them. tensor: #V,
    as `fit_curvature` has it. warp, weft: unit, directions in the pattern. along: #C; the first three are 0 where a
    cell has no area in the pattern.
    """
    c = wp.tid() + first
    face = corner[c]
    p = positions[face[0]]
    d = positions[face[1]] - p
    e = positions[face[2]] - p
    det = d[0] * e[1] - d[1] * e[0]
    deformation = wp.mat22d()
    if det > wp.float64(0.0):
        flat = laid[c]
        deformation = wp.mat22d(
            (flat[0] * e[1] - flat[1] * d[1]) / det,
            (flat[1] * d[0] - flat[0] * e[0]) / det,
            -flat[2] * d[1] / det,
            flat[2] * d[0] / det,
        )
    q = vertices[face[0]]
    x = wp.normalize(vertices[face[1]] - q)
    b = vertices[face[2]] - q
    y = wp.normalize(b - wp.dot(b, x) * x)
    bend = (tensor[face[0]] + tensor[face[1]] + tensor[face[2]]) / wp.float64(3.0)
    one = worn_along(deformation, warp, x, y)
    other = worn_along(deformation, weft, x, y)
    across = bend * other
    along[c] = wp.vec4d(wp.dot(one, bend * one), wp.dot(other, across), wp.dot(one, across), wp.trace(bend))
