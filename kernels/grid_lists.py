"""Quads by rows and columns: numbering of faces, lists around the vertices of a grid, and its rows laid flat."""

import warp as wp

from .indices import natural

# Rounded without fused products, as the same lengths and sums of any other mesh are.
wp.set_module_options({"enable_backward": False, "fuse_fp": False})


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


@wp.func
def lines_before(i: int, most: int):
    """Return the number of entries of the lines before line i; each has `most`, the first and the last one less."""
    return most * i - wp.min(i, 1)


@wp.func
def lines_here(i: int, count: int, most: int):
    """Return the number of entries of line i of `count`."""
    return lines_before(i + 1, most) - lines_before(i, most) - wp.where(i == count - 1, 1, 0)


@wp.func
def entries_before(i: int, j: int, rows: int, columns: int, most: int):
    """Return the number of entries before the vertex in row i and column j, products of those of row and column."""
    return lines_before(i, most) * (most * columns - 2) + lines_here(i, rows, most) * lines_before(j, most)


@wp.kernel
def list_corners(
    rows: int,
    columns: int,
    slot_of: wp.vec4i,
    first: int,
    # outputs
    offset: wp.array(dtype=wp.int32),
    corner: wp.array(dtype=wp.int32),
):
    """List the faces' corners around each vertex of a grid numbered row by row, as 4 times the face plus the corner.

    slot_of: a face's corner below left, below right, above left, above right. offset: #V+1, where each vertex's begin;
    the last is not written.
    """
    v = natural(wp.tid() + first)
    i = v / columns
    j = v - i * columns
    at = natural(entries_before(i, j, rows, columns, 2))
    offset[v] = at
    for up in range(2):
        for right in range(2):
            row = i - 1 + up
            column = j - 1 + right
            if row >= 0 and row < rows - 1 and column >= 0 and column < columns - 1:
                # Of a face below and to the left, the vertex is the corner above right.
                corner[at] = 4 * (row * (columns - 1) + column) + slot_of[3 - 2 * up - right]
                at += 1


@wp.func
def is_on_grid(rows: int, columns: int, row: int, column: int):
    """Return whether a row and a column are on the grid."""
    return row >= 0 and row < rows and column >= 0 and column < columns


@wp.func
def face_between(columns: int, i: int, j: int, up: int, right: int):
    """Return the face of the vertex in row i and column j that lies up or down (1, -1), and right or left."""
    return natural((i + wp.min(up, 0)) * (columns - 1) + j + wp.min(right, 0))


@wp.func
def which_diagonal(rising: int, up: int, right: int):
    """Return 0 for the diagonal of a face's corners 0-2, 1 for that of 1-3."""
    which = rising
    if up != right:
        which = 1 - rising
    return which


@wp.func
def spring_to(rows: int, columns: int, rising: int, i: int, j: int, row: int, column: int):
    """Return the number of the spring from the vertex in row i and column j of a grid to one of the eight around it.

    Springs are the edges, sorted by their lower vertex, then of each face the diagonal of corners 0-2, then that of
    corners 1-3.
    rising: 0 if it is the former that runs from below left to above right, else 1.
    """
    of_row = 2 * columns - 1
    s = int(0)
    if row == i:
        step = int(2)
        if i == rows - 1:
            step = 1
        s = i * of_row + step * wp.min(j, column)
    elif column == j:
        s = wp.min(i, row) * of_row + wp.min(2 * j + 1, of_row - 1)
    else:
        which = which_diagonal(rising, row - i, column - j)
        edges = rows * (columns - 1) + (rows - 1) * columns
        faces = (rows - 1) * (columns - 1)
        s = edges + which * faces + wp.min(i, row) * (columns - 1) + wp.min(j, column)
    return s


@wp.kernel
def list_neighbors(
    rows: int,
    columns: int,
    first: int,
    # outputs
    offset: wp.array(dtype=wp.int32),
    neighbor: wp.array(dtype=wp.int32),
):
    """List the up to eight vertices around each one of a grid numbered row by row, in order.

    offset: #V+1, where each vertex's begin; the last is not written.
    """
    v = natural(wp.tid() + first)
    i = v / columns
    j = v - i * columns
    # Of the three by three around it, not the vertex itself.
    at = natural(entries_before(i, j, rows, columns, 3) - v)
    offset[v] = at
    for up in range(-1, 2):
        for right in range(-1, 2):
            if (up != 0 or right != 0) and is_on_grid(rows, columns, i + up, j + right):
                neighbor[at] = v + up * columns + right
                at += 1


@wp.kernel
def list_values(
    rows: int,
    columns: int,
    rising: int,
    offset: wp.array(dtype=wp.int32),
    value: wp.array(dtype=wp.float64),
    first: int,
    # outputs
    listed: wp.array(dtype=wp.float64),
):
    """List the values (#S) of the springs to these vertices, by the numbers of `spring_to`."""
    v = natural(wp.tid() + first)
    i = v / columns
    j = v - i * columns
    at = offset[v]
    for up in range(-1, 2):
        for right in range(-1, 2):
            if (up != 0 or right != 0) and is_on_grid(rows, columns, i + up, j + right):
                listed[at] = value[spring_to(rows, columns, rising, i, j, i + up, j + right)]
                at += 1


@wp.kernel
def list_lengths(
    rows: int,
    columns: int,
    rising: int,
    offset: wp.array(dtype=wp.int32),
    vertices: wp.array(dtype=wp.vec3d),
    diagonal: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    listed: wp.array(dtype=wp.float64),
):
    """List the lengths of the springs to these vertices [m]; diagonal: #F, those of corners 0-2 and 1-3."""
    v = natural(wp.tid() + first)
    i = v / columns
    j = v - i * columns
    at = natural(offset[v])
    for up in range(-1, 2):
        for right in range(-1, 2):
            if (up != 0 or right != 0) and is_on_grid(rows, columns, i + up, j + right):
                if up == 0 or right == 0:
                    listed[at] = wp.length(vertices[v] - vertices[natural(v + up * columns + right)])
                else:
                    listed[at] = diagonal[face_between(columns, i, j, up, right)][which_diagonal(rising, up, right)]
                at += 1


@wp.kernel
def list_stiffness(
    rows: int,
    columns: int,
    rising: int,
    sides: wp.vec4i,
    offset: wp.array(dtype=wp.int32),
    side: wp.array(dtype=wp.vec4d),
    diagonal: wp.array(dtype=wp.float64),
    first: int,
    # outputs
    listed: wp.array(dtype=wp.float64),
):
    """List the stiffnesses of the springs to these vertices [N/m].

    Edges have the sum of what the faces on both sides give to them (#F), diagonals what their face gives to both (#F).

    sides: which side of a face is the one below, on the left, on the right, above.
    """
    v = natural(wp.tid() + first)
    i = v / columns
    j = v - i * columns
    at = natural(offset[v])
    for up in range(-1, 2):
        for right in range(-1, 2):
            if (up != 0 or right != 0) and is_on_grid(rows, columns, i + up, j + right):
                total = wp.float64(0.0)
                if up == 0:
                    # The face below has it above, the face above has it below.
                    if i > 0:
                        total += side[face_between(columns, i, j, -1, right)][sides[3]]
                    if i < rows - 1:
                        total += side[face_between(columns, i, j, 1, right)][sides[0]]
                elif right == 0:
                    if j > 0:
                        total += side[face_between(columns, i, j, up, -1)][sides[2]]
                    if j < columns - 1:
                        total += side[face_between(columns, i, j, up, 1)][sides[1]]
                else:
                    total = diagonal[face_between(columns, i, j, up, right)]
                listed[at] = total
                at += 1


@wp.kernel
def is_row_by_row(
    faces: wp.array(dtype=wp.vec4i),
    columns: int,
    corner: wp.vec4i,
    first: int,
    # outputs
    as_expected: wp.array(dtype=wp.bool),
):
    """Check whether each face (#F) is as in a grid numbered row by row; `corner`: the first face's vertices."""
    f = natural(wp.tid() + first)
    row = f / (columns - 1)
    as_expected[f] = faces[f] - corner == wp.vec4i(f + row, f + row, f + row, f + row)


@wp.kernel
def lay_profiles(
    vertices: wp.array(dtype=wp.vec3d),
    grid: wp.array2d(dtype=wp.int32),
    column: int,
    side: wp.float64,
    station: wp.array(dtype=wp.float64),
    first: int,
    # outputs
    position: wp.array(dtype=wp.vec2d),
):
    """Lay each row of a grid along x at its arc lengths on the body from one column; y is its station. All [m].

    vertices: #V. station: #rows. side: 1 for columns to the right, -1 to the left.
    """
    i = natural(wp.tid() + first)
    middle = grid[i, column]
    position[middle] = wp.vec2d(wp.float64(0.0), station[i])
    for way in range(2):
        step = 1 - 2 * way
        before = vertices[middle]
        along = side * wp.float64(step)
        x = wp.float64(0.0)
        j = column + step
        while j >= 0 and j < grid.shape[1]:
            v = natural(grid[i, j])
            x += along * wp.length(vertices[v] - before)
            before = vertices[v]
            position[v] = wp.vec2d(x, station[i])
            j += step
