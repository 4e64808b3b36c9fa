"""Contact of draped cloth with itself: the nearest cloth of another layer at each vertex, and what keeps the vertex on its side of it."""

import warp as wp

from .drape import push_of_plane
from .indices import natural

wp.set_module_options({"enable_backward": False})

TINY = wp.constant(wp.float32(1.0e-30))
# A vertex lies over a triangle if no weight of its foot there is below minus this.
MARGIN = wp.constant(wp.float32(0.01))


@wp.kernel
def find_layers(
    mesh: wp.uint64,
    offset: wp.array(dtype=wp.int32),
    near: wp.array(dtype=wp.int32),
    position: wp.array(dtype=wp.vec3d),
    outwards: wp.array(dtype=wp.vec3d),
    reach: wp.float32,
    first: int,
    # outputs
    face: wp.array(dtype=wp.int32),
    share: wp.array(dtype=wp.vec3d),
):
    """Find the nearest triangles that each vertex lies over, before and behind it, of those that have no vertex near it in the cloth.

    mesh: the cloth. offset: #V+1, near: the vertices near each vertex, itself among them. position: #V [m].
    outwards: #V, the cloth's normals. reach: longest distance [m]. face: 2 #V, before and behind each vertex; -1 where there is none in
    reach. share: 2 #V, weights of its corners at the vertex's foot.
    """
    i = natural(wp.tid() + first)
    p = position[i]
    x = wp.vec3(wp.float32(p[0]), wp.float32(p[1]), wp.float32(p[2]))
    indices = wp.mesh_get(mesh).indices
    points = wp.mesh_get(mesh).points
    around = wp.vec3(reach, reach, reach)
    m = outwards[i]
    ahead = wp.vec3(wp.float32(m[0]), wp.float32(m[1]), wp.float32(m[2]))
    best = wp.vec2(reach, reach)
    for k in range(2):
        face[natural(2 * i + k)] = -1
    query = wp.mesh_query_aabb(mesh, x - around, x + around)
    f = int(0)
    while wp.mesh_query_aabb_next(query, f):
        a = indices[3 * f]
        b = indices[3 * f + 1]
        c = indices[3 * f + 2]
        own = int(0)
        s = natural(offset[i])
        end = offset[i + 1]
        while s < end:
            k = near[natural(s)]
            if k == a or k == b or k == c:  # noqa: SIM109
                own = 1
                break
            s += 1
        if own == 0:
            n = wp.cross(points[b] - points[a], points[c] - points[a])
            size = wp.max(wp.dot(n, n), TINY)
            of_b = wp.dot(wp.cross(x - points[a], points[c] - points[a]), n) / size
            of_c = wp.dot(wp.cross(points[b] - points[a], x - points[a]), n) / size
            far = wp.abs(wp.dot(x - points[a], n)) / wp.sqrt(size)
            over = wp.min(wp.min(of_b, of_c), 1.0 - of_b - of_c) > -MARGIN
            side = wp.where(wp.dot(x - points[a], n) * wp.dot(n, ahead) < 0.0, 0, 1)
            at = natural(2 * i + side)
            # Of two that are as near, the first, in whatever order they are met.
            if over and (far < best[side] or (far == best[side] and f < face[at])):
                best[side] = far
                face[at] = f
                share[at] = wp.vec3d(wp.float64(1.0 - of_b - of_c), wp.float64(of_b), wp.float64(of_c))


@wp.kernel
def press_layers(
    position: wp.array(dtype=wp.vec3d),
    corner: wp.array(dtype=wp.vec3i),
    share: wp.array(dtype=wp.vec3d),
    normal: wp.array(dtype=wp.vec3d),
    skin: wp.array(dtype=wp.float64),
    apart: wp.float64,
    begin: int,
    first: int,
    # outputs
    force: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
):
    """Compute the energy 1/2 k max(0, d - g)^2 of vertices beside cloth, and the forces on both.

    g is the vertex's height over the place of the other layer along the normal, d how far apart layers lie.

    position: #V [m]. corner: 2 #V, share: 2 #V, the places of the other layers. normal: 2 #V, towards the vertex's side; zero without
    another layer. skin: #V, k [N/m]. apart: d [m]. begin: number of cells, whose forces and energies come before.
    force: 3 begin + 8 #V, on the vertex and on the three corners [N]. energy: begin + 2 #V [J].
    """
    k = natural(wp.tid() + first)
    i = natural(k / 2)
    n = normal[k]
    c = corner[k]
    w = share[k]
    place = position[natural(c[0])] * w[0] + position[natural(c[1])] * w[1] + position[natural(c[2])] * w[2]
    gap = wp.float64(0.0)
    if wp.dot(n, n) > wp.float64(0.5):
        gap = wp.dot(position[i] - place, n) - apart
    push = push_of_plane(gap, skin[i], wp.float64(0.0))
    energy[natural(begin + k)] = -wp.float64(0.5) * push * gap
    at = natural(3 * begin + 4 * k)
    force[at] = n * push
    for j in range(3):
        force[natural(at + 1 + j)] = -n * (push * w[j])
