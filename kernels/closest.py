"""The nearest place on a triangle mesh, by Warp's bounding volumes."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_closest(
    mesh: wp.uint64,
    point: wp.array(dtype=wp.vec3),
    reach: float,
    # outputs
    face: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec3),
):
    """Find the triangle that is nearest to each point, and the barycentric weights of the nearest place on it.

    point: #P [m]. reach: how far to look [m]. face: #P, -1 where there is none within reach. weight: #P.
    """
    i = wp.tid()
    query = wp.mesh_query_point_no_sign(mesh, point[i], reach)
    if query.result:
        face[i] = query.face
        weight[i] = wp.vec3(query.u, query.v, 1.0 - query.u - query.v)
    else:
        face[i] = -1
