"""Cells: triangles (a quad gives its four corner triangles) on which the flat cloth is compared with the surface.

The deformation of a cell is F = dX/dx, from the plane (the cloth, unknown) to the tangent plane of the surface (the
body, given): |F e| - 1 is how much a thread along e is stretched when the piece is worn.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Height over longest side below which a cell is treated as slender.
SLENDER = wp.constant(wp.float64(0.1))


@wp.struct
class Cells:
    """The cells and where their corners' shares are gathered.

    corner: #C, vertices, anticlockwise in the plane.
    edges: #C, the cell laid flat as on the surface: columns are the edges from corner 0 to corners 1 and 2 [m].
    weight: #C, 1 for a triangle, 1/2 for each of a quad's four corner triangles.
    offset: #V+1, where each vertex's entries in `slot` begin.
    slot: 3 times the cell plus the corner, for every cell around a vertex.
    slack: #C, along warp and weft, 1 over the stretch at which the cloth is meant to be worn; 1 where none is meant.
    onset: #C, worn stretch along warp and weft at which the guard begins to act.
    """

    corner: wp.array(dtype=wp.vec3i)
    edges: wp.array(dtype=wp.mat22d)
    weight: wp.array(dtype=wp.float64)
    offset: wp.array(dtype=wp.int32)
    slot: wp.array(dtype=wp.int32)
    slack: wp.array(dtype=wp.vec2d)
    onset: wp.array(dtype=wp.vec2d)


@wp.struct
class ThreadGuard:
    """What keeps threads straight and faces unfolded (`warpflat.network` says why).

    warp, weft: unit vectors in the plane.
    stiffness_warp, stiffness_weft: [N/m].
    """

    warp: wp.vec2d
    weft: wp.vec2d
    stiffness_warp: wp.float64
    stiffness_weft: wp.float64


@wp.func
def flat_edges(position: wp.array(dtype=wp.vec2d), corner: wp.vec3i):
    """The cell's edges from corner 0 to corners 1 and 2 in the plane, as columns [m]."""
    here = position[corner[0]]
    a = position[corner[1]] - here
    b = position[corner[2]] - here
    return wp.mat22d(a[0], b[0], a[1], b[1])


@wp.func
def is_beyond(worn: wp.vec2d, stretch: wp.float64):
    """Whether the stretch of a worn thread, a unit vector mapped to `worn`, is more than this."""
    length = wp.float64(1.0) + stretch
    return length < wp.float64(0.0) or wp.dot(worn, worn) > length * length


@wp.func
def excess_stretch(worn: wp.vec2d, onset: wp.float64):
    """How far the stretch of a worn thread, a unit vector mapped to `worn`, lies beyond the onset."""
    return wp.max(wp.length(worn) - wp.float64(1.0) - onset, wp.float64(0.0))


@wp.func
def thread_stress(worn: wp.vec2d, thread: wp.vec2d, stiffness: wp.float64, onset: wp.float64):
    """d(psi)/dF of psi = 1/2 K max(|F e| - 1 - onset, 0)^2."""
    length = wp.length(worn)
    excess = wp.max(length - wp.float64(1.0) - onset, wp.float64(0.0))
    return wp.outer(worn, thread) * (stiffness * excess / wp.max(length, wp.float64(1.0e-300)))


@wp.func
def thread_curvature(worn: wp.vec2d, F: wp.mat22d, stiffness: wp.float64, onset: wp.float64):
    """The gradient of psi's stretch by a corner's place is -(F^T F e / |F e|) (grad w . e) for the barycentric weight w:
    returns K |F^T F e|^2 / |F e|^2, or 0 where the thread is not about to be guarded."""
    length = wp.length(worn)
    if length - wp.float64(1.0) - onset <= wp.float64(0.0):
        return wp.float64(0.0)
    back = wp.transpose(F) * worn
    return stiffness * wp.dot(back, back) / (length * length)


@wp.kernel
def evaluate_guard(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    time_step: wp.float64,
    watch: int,
    first: int,
    # outputs
    acting: wp.array(dtype=wp.int32),
    clearance: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec2d),
    viscosity: wp.array(dtype=wp.vec2d),
    stiffness: wp.array(dtype=wp.float64),
):
    """Forces of the thread guard: minus the gradient of a [1/2 K_warp <|F e_warp| - 1 - onset>^2 + the same for weft].

    a is the flat area of the cell. The energy grows without bound as the cell collapses. Its viscosity, the share of the
    guard in h H v of eq. (6), is taken as -h k (v - v_cell), with v_cell the mean velocity by stiffness, so that a cell
    that moves as a whole is not held back.

    position: #V [m]. velocity: #V [m/s]. watch: 1 to look at all cells; with 0 those in which the guard did not act are passed over.
    acting: #C, 1 where the guard acts or is about to; elsewhere the last three are not written.
    clearance: #C, the cell's least height in the plane [m], 0 once it is mirrored. force, viscosity: 3 #C [N].
    stiffness k: 3 #C, bound on the energy's second derivative by the corner's place [N/m].
    """
    c = wp.tid() + first
    if watch == 0 and acting[c] == 0:
        return
    corner = cells.corner[c]
    D = flat_edges(position, corner)
    det = wp.determinant(D)
    a = wp.vec2d(D[0, 0], D[1, 0])
    b = wp.vec2d(D[0, 1], D[1, 1])
    longest = wp.sqrt(wp.max(wp.dot(a, a), wp.max(wp.dot(b, b), wp.dot(b - a, b - a))))
    acting[c] = 0
    clearance[c] = wp.float64(0.0)
    if det > wp.float64(0.0):
        clearance[c] = det / longest
        inv = wp.inverse(D)
        warp = guard.warp * cells.slack[c][0]
        weft = guard.weft * cells.slack[c][1]
        worn_warp = cells.edges[c] * (inv * warp)
        worn_weft = cells.edges[c] * (inv * weft)
        # The stiffness counts from half of the onset on, and always in slender cells: a step can take these from far
        # below the onset to far beyond it, and with the springs' stiffness alone they would swing to and fro for ever.
        early = wp.float64(0.5)
        if clearance[c] < SLENDER * longest:
            early = -wp.float64(wp.inf)
        onset = cells.onset[c]
        near_warp = early * onset[0]
        near_weft = early * onset[1]
        if is_beyond(worn_warp, near_warp) or is_beyond(worn_weft, near_weft):
            acting[c] = 1
            F = cells.edges[c] * inv
            y_warp = excess_stretch(worn_warp, onset[0])
            y_weft = excess_stretch(worn_weft, onset[1])
            area = wp.float64(0.5) * det * cells.weight[c]
            density = wp.float64(0.5) * (
                guard.stiffness_warp * y_warp * y_warp + guard.stiffness_weft * y_weft * y_weft
            )
            P = thread_stress(worn_warp, warp, guard.stiffness_warp, onset[0]) + thread_stress(
                worn_weft, weft, guard.stiffness_weft, onset[1]
            )
            # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
            inv_t = wp.transpose(inv)
            G = (inv_t * density - wp.transpose(F) * P * inv_t) * area
            f1 = wp.vec2d(-G[0, 0], -G[1, 0])
            f2 = wp.vec2d(-G[0, 1], -G[1, 1])
            q_warp = thread_curvature(worn_warp, F, guard.stiffness_warp, near_warp)
            q_weft = thread_curvature(worn_weft, F, guard.stiffness_weft, near_weft)
            # rows of D^-1 are the gradients of the barycentric weights of corners 1 and 2
            w1 = wp.vec2d(inv[0, 0], inv[0, 1])
            w2 = wp.vec2d(inv[1, 0], inv[1, 1])
            k0 = area * guard_bound(-(w1 + w2), warp, weft, q_warp, q_weft, density)
            k1 = area * guard_bound(w1, warp, weft, q_warp, q_weft, density)
            k2 = area * guard_bound(w2, warp, weft, q_warp, q_weft, density)
            v0 = velocity[corner[0]]
            v1 = velocity[corner[1]]
            v2 = velocity[corner[2]]
            v_cell = (k0 * v0 + k1 * v1 + k2 * v2) / wp.max(k0 + k1 + k2, wp.float64(1.0e-300))
            force[3 * c] = -(f1 + f2)
            force[3 * c + 1] = f1
            force[3 * c + 2] = f2
            viscosity[3 * c] = (time_step * k0) * (v_cell - v0)
            viscosity[3 * c + 1] = (time_step * k1) * (v_cell - v1)
            viscosity[3 * c + 2] = (time_step * k2) * (v_cell - v2)
            stiffness[3 * c] = k0
            stiffness[3 * c + 1] = k1
            stiffness[3 * c + 2] = k2


@wp.func
def guard_bound(
    w: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, q_warp: wp.float64, q_weft: wp.float64, density: wp.float64
):
    """Per area, twice the Gauss-Newton part of the second derivative by the corner's place, and the part that the change
    of the area adds: at least the second derivative of a corner that moves alone, and, since the three corners of a cell
    move at once, enough for the step to be stable (eigenvalues of the step's matrix below 2; measured 1.57)."""
    along_warp = wp.dot(w, warp)
    along_weft = wp.dot(w, weft)
    return wp.float64(2.0) * (
        q_warp * along_warp * along_warp + q_weft * along_weft * along_weft + density * wp.dot(w, w)
    )


@wp.kernel
def compute_guard_energy(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """Energy of the thread guard per cell. position: #V [m]. energy: #C [J], infinite in a collapsed or mirrored cell."""
    c = wp.tid() + first
    D = flat_edges(position, cells.corner[c])
    det = wp.determinant(D)
    energy[c] = wp.float64(wp.inf)
    if det > wp.float64(0.0):
        inv = wp.inverse(D)
        energy[c] = wp.float64(0.0)
        worn_warp = cells.edges[c] * (inv * (guard.warp * cells.slack[c][0]))
        worn_weft = cells.edges[c] * (inv * (guard.weft * cells.slack[c][1]))
        onset = cells.onset[c]
        if is_beyond(worn_warp, onset[0]) or is_beyond(worn_weft, onset[1]):
            y_warp = excess_stretch(worn_warp, onset[0])
            y_weft = excess_stretch(worn_weft, onset[1])
            energy[c] = (
                wp.float64(0.25)
                * det
                * cells.weight[c]
                * (guard.stiffness_warp * y_warp * y_warp + guard.stiffness_weft * y_weft * y_weft)
            )
