"""Line relaxation along the threads of a lattice: all vertices of a row, or of a column, move at once.

A soft cloth is K/G times as stiff along its threads as in shear. A step of single vertices then reduces shear between
rows slowly, since each vertex is held along its row by its neighbours there. Here each row moves to where its springs,
and the other stiffness at each vertex, balance the forces along it: a tridiagonal system.
"""

import warp as wp

from .cells import Cells
from .indices import natural
from .springs import Springs

wp.set_module_options({"enable_backward": False})

# Share of the guard's stiffness at a vertex that is left where its neighbours on the line move with it. Between them
# the guard makes a thread twice as stiff as its springs do.
GUARD_LEFT = wp.constant(wp.float64(0.03125))


@wp.struct
class ThreadLines:
    """The vertices of a lattice, line by line: each is in one row and in one column.

    offset: #L+1, where the vertices of each line begin. vertex: 2 #V, in their order along the lines. rows: how many of
    the lines are rows; they come first.
    """

    offset: wp.array(dtype=wp.int32)
    vertex: wp.array(dtype=wp.int32)
    rows: int


@wp.func
def line_direction(position: wp.array(dtype=wp.vec2d), lines: ThreadLines, e: int, begin: int, end: int):
    """Return the unit vector along a line at its entry e; zero where it has no length."""
    before = lines.vertex[wp.max(e - 1, begin)]
    after = lines.vertex[wp.min(e + 1, end - 1)]
    return wp.normalize(position[after] - position[before])


@wp.func
def stiffness_along(d: wp.vec2d, rest_length: wp.float64, stiffness: wp.float64, along: wp.vec2d):
    """Return the positive stiffness of a spring against motion of one end along a unit vector [N/m].

    d: vector to the far end [m].
    """
    length = wp.max(wp.length(d), wp.float64(1.0e-300))
    c = wp.dot(d, along) / length
    taut = wp.max(wp.float64(1.0) - rest_length / length, wp.float64(0.0))
    return stiffness * (c * c + taut * (wp.float64(1.0) - c * c))


@wp.kernel
def solve_lines(
    position: wp.array(dtype=wp.vec2d),
    force: wp.array(dtype=wp.vec2d),
    mass: wp.array(dtype=wp.float64),
    springs: Springs,
    cells: Cells,
    face_acting: wp.array(dtype=wp.int8),
    face_stiffness: wp.array(dtype=wp.float64),
    guarded: wp.array(dtype=wp.int8),
    lines: ThreadLines,
    time_step: wp.float64,
    first: int,
    # outputs
    along_rows: wp.array(dtype=wp.vec2d),
    along_columns: wp.array(dtype=wp.vec2d),
):
    """Solve for the displacements along rows and along columns, #V each [m], that balance the forces along each line.

    position [m], force [N], mass [kg], guarded: #V, and face_*, as `implicit.gather_forces` has them, evaluated at
    these positions.
    """
    line = natural(wp.tid() + first)
    displacement = wp.where(line < lines.rows, along_rows, along_columns)
    begin = lines.offset[line]
    end = lines.offset[line + 1]
    k_before = wp.float64(0.0)
    passed = wp.float64(0.0)
    pushed = wp.float64(0.0)
    e = natural(begin)
    while e < end:
        i = lines.vertex[e]
        before = int(-1)
        after = int(-1)
        if e > begin:
            before = lines.vertex[e - 1]
        if e + 1 < end:
            after = lines.vertex[e + 1]
        along = line_direction(position, lines, e, begin, end)
        k_after = wp.float64(0.0)
        held = mass[i] / (time_step * time_step)
        s = natural(springs.offset[i])
        s_end = springs.offset[i + 1]
        while s < s_end:
            j = springs.neighbor[s]
            if j == after:
                k_after = springs.stiffness[s]
            elif j != before:
                held += stiffness_along(position[j] - position[i], springs.rest_length[s], springs.stiffness[s], along)
            s += 1
        if guarded[i] != wp.int8(0):
            c = natural(cells.offset[i])
            c_end = cells.offset[i + 1]
            while c < c_end:
                slot = cells.slot[c]
                if face_acting[slot / 4] != wp.int8(0):
                    held += GUARD_LEFT * face_stiffness[slot]
                c += 1
            if after >= 0 and guarded[natural(after)] != wp.int8(0):
                k_after = wp.float64(2.0) * k_after
        # Elimination from the first vertex on: here = pushed + passed * there.
        rest = wp.max(held + k_before * (wp.float64(1.0) - passed) + k_after, wp.float64(1.0e-300))
        pushed = (wp.dot(force[i], along) + k_before * pushed) / rest
        passed = k_after / rest
        displacement[i] = wp.vec2d(pushed, passed)
        k_before = k_after
        e += 1
    moved = wp.float64(0.0)
    for back in range(end - begin):
        e = end - 1 - back
        i = lines.vertex[e]
        moved = displacement[i][0] + displacement[i][1] * moved
        displacement[i] = moved * line_direction(position, lines, e, begin, end)


@wp.kernel
def move_along_lines(
    along_rows: wp.array(dtype=wp.vec2d),
    along_columns: wp.array(dtype=wp.vec2d),
    reach: wp.array(dtype=wp.float64),
    freedom: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    position: wp.array(dtype=wp.vec2d),
):
    """Move vertices by both displacements, where they are free to move, up to their reach [m]. All #V."""
    i = natural(wp.tid() + first)
    step = wp.cw_mul(along_rows[i] + along_columns[i], freedom[i])
    length = wp.length(step)
    if length > reach[i]:
        step = step * (reach[i] / length)
    position[i] = position[i] + step
