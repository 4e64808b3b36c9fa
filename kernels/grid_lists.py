"""Quads by rows and columns."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def number_faces(
    twin: wp.array(dtype=wp.int32),
    # outputs
    place: wp.array(dtype=wp.vec3i),
    queue: wp.array(dtype=wp.int32),
):
    """Find row and column of each quad from the first one on, and the quarter turns of its sides against the first.

    For one thread, which goes from face to face over their sides, breadth first.

    twin: 4 #F, for each side (four times the face, plus 0 below, 1 right, 2 above, 3 left, as the first one lies) the one
    opposite, -1 on the border. place: #F, -1 in the last component where no path leads. queue: #F, scratch.
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
