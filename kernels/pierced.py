"""Edges of a mesh that pierce it elsewhere."""

import warp as wp

wp.set_module_options({"enable_backward": False})

# The ends of an edge that are not looked at, as a share of its length: there its own triangles are.
ENDS = wp.constant(wp.float32(0.02))


@wp.kernel
def find_pierced(
    mesh: wp.uint64,
    edge: wp.array(dtype=wp.vec2i),
    first: int,
    # outputs
    pierced: wp.array(dtype=wp.int32),
):
    """Tell which edges meet a triangle of their mesh that has none of their vertices.

    mesh: the triangles. edge: #E, the vertices of each. pierced: #E, 1 or 0.
    """
    i = wp.tid() + first
    a, b = edge[i][0], edge[i][1]
    points = wp.mesh_get(mesh).points
    indices = wp.mesh_get(mesh).indices
    way = points[b] - points[a]
    length = wp.length(way)
    pierced[i] = 0
    if length > 0.0:
        way = way / length
        begin = ENDS * length
        end = (1.0 - ENDS) * length
        # Triangles of the edge's own vertices are met too, and passed over.
        for _ in range(8):
            query = wp.mesh_query_ray(mesh, points[a] + begin * way, way, end - begin)
            if not query.result:
                break
            f = 3 * query.face
            own = int(0)
            for k in range(3):
                if indices[f + k] == a or indices[f + k] == b:
                    own = 1
            if own == 0:
                pierced[i] = 1
                break
            begin = begin + query.t + ENDS * length
            if begin >= end:
                break
