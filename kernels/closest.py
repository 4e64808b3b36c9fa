"""The nearest triangle of a mesh, by Warp's bounding volumes."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def find_closest(
    mesh: wp.uint64,
    point: wp.array(dtype=wp.vec3),
    # outputs
    face: wp.array(dtype=wp.int32),
):
    """Find the triangle that is nearest to each point.

    point: #P [m]. face: #P.
    """
    i = wp.tid()
    # However far.
    face[i] = wp.mesh_query_point_no_sign(mesh, point[i], 1.0e6).face
