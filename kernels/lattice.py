"""Quads numbered by rows and columns: a walk over the mesh from face to face."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def number_faces(
    twin: wp.array(dtype=wp.int32),
    # outputs
    place: wp.array(dtype=wp.vec3i),
    queue: wp.array(dtype=wp.int32),
):
    """Row and column of each quad, seen from the first one, and by how many quarters its sides are turned against the first one's.

    One thread, which goes from face to face over their sides, the nearest first.

    twin: 4 #F, of each side (four times the face, plus 0 below, 1 right, 2 above, 3 left, as the first one lies) the one on its other side,
    -1 on the border. place: #F, -1 in the last where no way leads. queue: #F, room to work in.
    """
    for f in range(place.shape[0]):
        place[f] = wp.vec3i(0, 0, -1)
    place[0] = wp.vec3i(0, 0, 0)
    queue[0] = 0
    done = int(0)
    seen = int(1)
    while done < seen:
        f = queue[done]
        here = place[f]
        done += 1
        for k in range(4):
            other = twin[4 * f + k]
            if other >= 0:
                g = other / 4
                if place[g][2] < 0:
                    side = (k + here[2]) % 4
                    row = here[0]
                    column = here[1]
                    if side == 0:
                        row -= 1
                    if side == 1:
                        column += 1
                    if side == 2:
                        row += 1
                    if side == 3:
                        column -= 1
                    place[g] = wp.vec3i(row, column, (side + 6 - (other - 4 * g)) % 4)
                    queue[seen] = g
                    seen += 1
