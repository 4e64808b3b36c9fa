"""The nearest place on a triangle mesh, by Warp's bounding volumes."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_closest(
    mesh: wp.uint64,
    point: wp.array(dtype=wp.vec3),
    # outputs
    face: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.vec3),
):
    """Find the triangle that is nearest to each point, and the barycentric weights of the nearest place on it.

    point: #P [m]. face, weight: #P.
    """
    i = wp.tid()
    # However far.
    query = wp.mesh_query_point_no_sign(mesh, point[i], 1.0e6)
    face[i] = query.face
    weight[i] = wp.vec3(query.u, query.v, 1.0 - query.u - query.v)
