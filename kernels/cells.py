"""Cells: triangles (a quad gives its four corner triangles) on which the flat cloth is compared with the surface.

The deformation of a cell is F = dX/dx, from the plane (the cloth, unknown) to the tangent plane of the surface (the
body, given): |F e| - 1 is how much a thread along e is stretched when the piece is worn.

Kernels run face by face, over the one or four cells of each, and what cells do to their corners is added up by face.
"""

import warp as wp

from .indices import natural

wp.set_module_options({"enable_backward": False})

# Height over longest side below which a cell is treated as slender.
SLENDER = wp.constant(wp.float64(0.1))


@wp.struct
class Cells:
    """The cells, face by face, and where the shares of the faces' corners are gathered.

    face: #F, vertices, anticlockwise in the plane; -1 for the fourth of a triangle.
    first: #F, the first of each face's cells.
    laid: #C, the cell laid flat as on the surface, with corner 0 at the origin and corner 1 along x: x of corner 1, then
        x and y of corner 2 [m].
    offset: #V+1, where each vertex's entries in `slot` begin.
    slot: 4 times the face plus the corner, for every face around a vertex.
    slack: #F, along warp and weft, 1 over the intended stretch of the worn cloth; 1 where none is intended.
    onset: #F, worn stretch along warp and weft at which the guard begins to act.
    shear: #F, a direction in the plane times the fourth root of the shear stiffness that the springs of a long quad
        lack there [N/m]; zero for any other face.
    hourglass: #F, weights of a quad's corners in its hourglass mode (`stiffness.weigh_hourglass`) [(N/m)^1/2];
        zero for most.
    """

    face: wp.array(dtype=wp.vec4i)
    first: wp.array(dtype=wp.int32)
    laid: wp.array(dtype=wp.vec3d)
    offset: wp.array(dtype=wp.int32)
    slot: wp.array(dtype=wp.int32)
    slack: wp.array(dtype=wp.vec2d)
    onset: wp.array(dtype=wp.vec2d)
    shear: wp.array(dtype=wp.vec2d)
    hourglass: wp.array(dtype=wp.vec4d)


@wp.struct
class ThreadGuard:
    """The energy that keeps threads straight and faces unfolded (see `warpflat.model.network`).

    warp, weft: unit vectors in the plane.
    stiffness_warp, stiffness_weft: [N/m].
    isotropic: 1 for a sheet without threads, in which the principal directions of each cell take the place of warp and weft.
    """

    warp: wp.vec2d
    weft: wp.vec2d
    stiffness_warp: wp.float64
    stiffness_weft: wp.float64
    isotropic: int


@wp.func
def count_cells(face: wp.vec4i):
    """Return the number of cells of a face: one for a triangle, four for a quad."""
    if face[3] < 0:
        return 1
    return 4


@wp.func
def cell_weight(face: wp.vec4i):
    """Return the share of a cell's area that counts: a quad's four corner triangles cover it twice."""
    if face[3] < 0:
        return wp.float64(1.0)
    return wp.float64(0.5)


@wp.func
def cell_places(face: wp.vec4i, k: int):
    """Return the face's corners in its cell k: a triangle's own, or a quad's corner k between its neighbours."""
    if face[3] < 0:
        return wp.vec3i(0, 1, 2)
    return wp.vec3i((k + 3) & 3, k, (k + 1) & 3)


@wp.func
def corner_at(face: wp.vec4i, k: int):
    """Return the vertex at the face's corner k, 0 to 3, without a vector index that is known only at run time."""
    below = wp.where((k & 1) != 0, face[1], face[0])
    above = wp.where((k & 1) != 0, face[3], face[2])
    return natural(wp.where((k & 2) != 0, above, below))


@wp.func
def cell_corner(face: wp.vec4i, k: int):
    """Return the vertices of the face's cell k."""
    at = cell_places(face, k)
    return wp.vec3i(corner_at(face, at[0]), corner_at(face, at[1]), corner_at(face, at[2]))


@wp.func
def laid_edges(laid: wp.vec3d):
    """Return the edges of a laid cell from corner 0 to corners 1 and 2, as columns [m]."""
    return wp.mat22d(laid[0], laid[1], wp.float64(0.0), laid[2])


@wp.func
def on_body(laid: wp.vec3d, share: wp.vec2d):
    """Return `laid_edges` times a vector."""
    return wp.vec2d(laid[0] * share[0] + laid[1] * share[1], laid[2] * share[1])


@wp.func
def across(D: wp.mat22d, v: wp.vec2d):
    """Return the adjugate of D times a vector: det(D) D^-1 v."""
    return wp.vec2d(D[1, 1] * v[0] - D[0, 1] * v[1], D[0, 0] * v[1] - D[1, 0] * v[0])


@wp.func
def longest_square(D: wp.mat22d):
    """Return the square of the longest side of a cell with these edges [m2]."""
    a = wp.vec2d(D[0, 0], D[1, 0])
    b = wp.vec2d(D[0, 1], D[1, 1])
    return wp.max(wp.dot(a, a), wp.max(wp.dot(b, b), wp.dot(b - a, b - a)))


@wp.func
def edge_matrix(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d):
    """Return the edges of a cell with these corners from the first one, as columns [m]."""
    a = p1 - p0
    b = p2 - p0
    return wp.mat22d(a[0], b[0], a[1], b[1])


@wp.func
def flat_edges(position: wp.array(dtype=wp.vec2d), corner: wp.vec3i):
    """Return the cell's edges from corner 0 to corners 1 and 2 in the plane, as columns [m]."""
    p0 = position[natural(corner[0])]
    p1 = position[natural(corner[1])]
    p2 = position[natural(corner[2])]
    return edge_matrix(p0, p1, p2)


@wp.func
def is_beyond(worn: wp.vec2d, unit: wp.float64, stretch: wp.float64):
    """Return whether a worn thread, a vector of length `unit` mapped to `worn`, is stretched more than `stretch`."""
    length = (wp.float64(1.0) + stretch) * unit
    return length < wp.float64(0.0) or wp.dot(worn, worn) > length * length


@wp.func
def principal_direction(a: wp.vec2d, b: wp.vec2d):
    """Return the unit vector v for which a v[0] + b v[1] is longest; the vector to its left makes it shortest.

    Turned to these directions, what depends on lengths along them alone is a function of the singular values, and its
    gradient is that with the directions held, since both lengths are stationary.
    """
    two = wp.float64(2.0)
    difference = (wp.dot(a, a) - wp.dot(b, b)) / two
    product = wp.dot(a, b)
    size = wp.sqrt(difference * difference + product * product)
    v = wp.vec2d(wp.float64(1.0), wp.float64(0.0))
    if size > wp.float64(0.0):
        larger = wp.sqrt((size + wp.abs(difference)) / (two * size))
        smaller = product / (two * size * larger)
        v = wp.where(difference >= wp.float64(0.0), wp.vec2d(larger, smaller), wp.vec2d(smaller, larger))
    return v


@wp.func
def combined(v: wp.vec2d, a: wp.vec2d, b: wp.vec2d):
    """Return a v[0] + b v[1]."""
    return a * v[0] + b * v[1]


@wp.func
def is_beyond_anywhere(a: wp.vec2d, b: wp.vec2d, unit: wp.float64, stretch: wp.float64):
    """Return `is_beyond` of the longest a v[0] + b v[1] with a unit vector v."""
    length = (wp.float64(1.0) + stretch) * unit
    aa = wp.dot(a, a)
    bb = wp.dot(b, b)
    half = wp.float64(0.5)
    short = length * length - half * (aa + bb)
    product = wp.dot(a, b)
    return (
        length < wp.float64(0.0)
        or short < wp.float64(0.0)
        or half * half * (aa - bb) * (aa - bb) + product * product > short * short
    )


@wp.func
def early_share(det: wp.float64, longest2: wp.float64):
    """Return the share of the onset from which on a cell's stiffness counts.

    It is a half; in slender cells the stiffness always counts. A step can take these from far below the onset to far
    beyond it, and with the springs' stiffness alone they would oscillate for ever.
    """
    if det < SLENDER * longest2:
        return -wp.float64(wp.inf)
    return wp.float64(0.5)


@wp.func
def guard_acts(
    worn_warp: wp.vec2d, worn_weft: wp.vec2d, unit: wp.float64, share: wp.float64, onset: wp.vec2d, isotropic: int
):
    """Return whether a thread is stretched beyond a share of the onset; worn threads as in `is_beyond`."""
    if isotropic != 0:
        return is_beyond_anywhere(worn_warp, worn_weft, unit, share * onset[0])
    return is_beyond(worn_warp, unit, share * onset[0]) or is_beyond(worn_weft, unit, share * onset[1])


@wp.func
def check_cell(
    p0: wp.vec2d,
    p1: wp.vec2d,
    p2: wp.vec2d,
    laid: wp.vec3d,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    isotropic: int,
):
    """Return the square of a cell's least height [m2], 0 if mirrored, and 1 where the guard acts or is about to."""
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    height2 = wp.float64(0.0)
    near = int(0)
    if det > wp.float64(0.0):
        longest2 = longest_square(D)
        height2 = det * det / longest2
        early = early_share(det, longest2)
        if guard_acts(on_body(laid, across(D, warp)), on_body(laid, across(D, weft)), det, early, onset, isotropic):
            near = int(1)
    return height2, near


@wp.func
def check_face(
    position: wp.array(dtype=wp.vec2d),
    face: wp.vec4i,
    laid: wp.array(dtype=wp.vec3d),
    begin: int,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    isotropic: int,
):
    """Return the least height and the largest flag of `check_cell` over the cells of a face; `begin`: the first."""
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    height2 = wp.float64(0.0)
    near = int(0)
    if face[3] < 0:
        height2, near = check_cell(p0, p1, p2, laid[begin], warp, weft, onset, isotropic)
    else:
        p3 = position[natural(face[3])]
        h0, near0 = check_cell(p3, p0, p1, laid[begin], warp, weft, onset, isotropic)
        h1, near1 = check_cell(p0, p1, p2, laid[natural(begin + 1)], warp, weft, onset, isotropic)
        h2, near2 = check_cell(p1, p2, p3, laid[natural(begin + 2)], warp, weft, onset, isotropic)
        h3, near3 = check_cell(p2, p3, p0, laid[natural(begin + 3)], warp, weft, onset, isotropic)
        height2 = wp.min(wp.min(h0, h1), wp.min(h2, h3))
        near = near0 | near1 | near2 | near3
    return height2, near


@wp.func
def excess_stretch(worn: wp.vec2d, onset: wp.float64):
    """Return the stretch beyond the onset of a worn thread, a unit vector mapped to `worn`; 0 below it."""
    return wp.max(wp.length(worn) - wp.float64(1.0) - onset, wp.float64(0.0))


@wp.func
def thread_stress(worn: wp.vec2d, thread: wp.vec2d, stiffness: wp.float64, onset: wp.float64):
    """Return d(psi)/dF of psi = 1/2 K max(|F e| - 1 - onset, 0)^2."""
    length = wp.length(worn)
    excess = wp.max(length - wp.float64(1.0) - onset, wp.float64(0.0))
    return wp.outer(worn, thread) * (stiffness * excess / wp.max(length, wp.float64(1.0e-300)))


@wp.func
def thread_curvature(worn: wp.vec2d, F: wp.mat22d, stiffness: wp.float64, onset: wp.float64):
    """Return K |F^T F e|^2 / |F e|^2, or 0 where the guard is not about to act on the thread.

    The gradient of psi's stretch by a corner's place is -(F^T F e / |F e|) (grad w . e) for the barycentric weight w.
    """
    length = wp.length(worn)
    if length - wp.float64(1.0) - onset <= wp.float64(0.0):
        return wp.float64(0.0)
    back = wp.transpose(F) * worn
    return stiffness * wp.dot(back, back) / (length * length)


@wp.func
def turning_share(longer: wp.vec2d, shorter: wp.vec2d, excess: wp.float64):
    """Return the stiffness, over K, with which the longer principal stretch resists what turns the shorter one.

    It is the derivative f / (s + t) + f / (s - t), halved, of the force f = K excess at the stretches s > t.
    """
    square = wp.dot(longer, longer)
    apart = square - wp.dot(shorter, shorter)
    turning = excess * wp.sqrt(square)
    return wp.where(turning < apart, turning / wp.max(apart, wp.float64(1.0e-300)), wp.float64(1.0))


@wp.func
def sheared(shear: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, slack: wp.vec2d):
    """Return `Cells.shear` on the cloth at its intended stretch; warp, weft: unit vectors times the slack."""
    along = wp.dot(shear, warp) / slack[0]
    over = wp.dot(shear, weft) / slack[1]
    return warp * along + weft * over


@wp.func
def turned_left(v: wp.vec2d):
    """Return the vector turned to the left by a right angle."""
    return wp.vec2d(-v[1], v[0])


@wp.kernel
def evaluate_guard(
    position: wp.array(dtype=wp.vec2d),
    velocity: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    time_step: wp.float64,
    coefficients: wp.array(dtype=wp.vec3d),
    check_all: int,
    first: int,
    # outputs
    acting: wp.array(dtype=wp.int8),
    clearance: wp.array(dtype=wp.float64),
    force: wp.array(dtype=wp.vec2d),
    viscosity: wp.array(dtype=wp.vec2d),
    stiffness: wp.array(dtype=wp.float64),
):
    """Compute the forces of the thread guard, minus the gradient of its energy.

    The energy of a cell is a [1/2 K_warp <|F e_warp| - 1 - onset>^2 + the same for weft]; in an isotropic sheet warp
    and weft are the cell's principal directions.

    Added are the energies of the shear deficit of long quads, a 1/2 (F s . F s')^2 with s' at right angles to s =
    `Cells.shear`, and of hourglass modes, 1/2 |sum of hourglass_k p_k|^2.

    a is the flat area of the cell. The energy grows without bound as the cell collapses. Its viscosity, the share of
    the guard in h H v of eq. (6), is taken as -h k (v - v_cell), with v_cell the mean velocity by stiffness, so that a
    cell that moves as a whole is not held back.

    position: #V [m]. velocity: #V [m/s]. coefficients: as `implicit` has it; without viscosity none is written.
    check_all: 1 to look at all faces; with 0 those in which the guard did not act are passed over.
    acting: #F, 1 where the guard acts in a cell or is about to, and of long quads; elsewhere the last three are not
    written.
    clearance: #F, the least height of its cells in the plane [m], 0 once one is mirrored. force, viscosity: 4 #F, at
    the faces' corners [N]; a triangle's fourth is not used.
    stiffness k: 4 #F, bound on the energy's second derivative by the corner's place [N/m].
    """
    f = natural(wp.tid() + first)
    if check_all == 0 and acting[f] == wp.int8(0):
        return
    face = cells.face[f]
    warp = guard.warp * cells.slack[f][0]
    weft = guard.weft * cells.slack[f][1]
    onset = cells.onset[f]
    begin = natural(cells.first[f])
    height2, any_near = check_face(position, face, cells.laid, begin, warp, weft, onset, guard.isotropic)
    lacks_shear = wp.dot(cells.shear[f], cells.shear[f]) > wp.float64(0.0)
    wave = cells.hourglass[f]
    is_held = wp.dot(wave, wave) > wp.float64(0.0)
    is_strained = any_near != 0 or lacks_shear
    acts = is_strained or is_held
    acting[f] = wp.int8(wp.where(acts, 1, 0))
    clearance[f] = wp.sqrt(height2)
    if acts:
        viscous = coefficients[0][0] != wp.float64(0.0)
        weight = cell_weight(face)
        s = sheared(cells.shear[f], warp, weft, cells.slack[f])
        t = sheared(turned_left(cells.shear[f]), warp, weft, cells.slack[f])
        slot = 4 * f
        for corner_slot in range(4):
            force[slot + corner_slot] = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
            stiffness[slot + corner_slot] = wp.float64(0.0)
            if viscous:
                viscosity[slot + corner_slot] = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
        k = int(0)
        end = wp.where(is_strained, count_cells(face), 0)
        while k < end:
            at = cell_places(face, k)
            i0 = corner_at(face, at[0])
            i1 = corner_at(face, at[1])
            i2 = corner_at(face, at[2])
            laid = cells.laid[natural(begin + k)]
            q0 = position[i0]
            q1 = position[i1]
            q2 = position[i2]
            cell_height2, near = check_cell(q0, q1, q2, laid, warp, weft, onset, guard.isotropic)
            if near != 0 or (lacks_shear and cell_height2 > wp.float64(0.0)):
                D = edge_matrix(q0, q1, q2)
                det = wp.determinant(D)
                early = early_share(det, longest_square(D))
                inv = wp.inverse(D)
                F = laid_edges(laid) * inv
                along = warp
                over = weft
                if guard.isotropic != 0:
                    turn = principal_direction(F * warp, F * weft)
                    along = combined(turn, warp, weft)
                    over = combined(turned_left(turn), warp, weft)
                worn_warp = F * along
                worn_weft = F * over
                y_warp = excess_stretch(worn_warp, onset[0])
                y_weft = excess_stretch(worn_weft, onset[1])
                worn_s = F * s
                worn_t = F * t
                angle = wp.dot(worn_s, worn_t)
                area = wp.float64(0.5) * det * weight
                density = wp.float64(0.5) * (
                    guard.stiffness_warp * y_warp * y_warp + guard.stiffness_weft * y_weft * y_weft
                )
                P = thread_stress(worn_warp, along, guard.stiffness_warp, onset[0]) + thread_stress(
                    worn_weft, over, guard.stiffness_weft, onset[1]
                )
                P += (wp.outer(worn_t, s) + wp.outer(worn_s, t)) * angle
                # d(area psi)/dD = area (psi I - F^T P) D^-T; forces are minus its columns.
                inv_t = wp.transpose(inv)
                G = (inv_t * (density + wp.float64(0.5) * angle * angle) - wp.transpose(F) * P * inv_t) * area
                f1 = wp.vec2d(-G[0, 0], -G[1, 0])
                f2 = wp.vec2d(-G[0, 1], -G[1, 1])
                q_warp = thread_curvature(worn_warp, F, guard.stiffness_warp, early * onset[0])
                q_weft = thread_curvature(worn_weft, F, guard.stiffness_weft, early * onset[1])
                if guard.isotropic != 0:
                    # The principal directions turn with the cell, against the longer one's excess.
                    q_weft = wp.max(q_weft, q_warp * turning_share(worn_warp, worn_weft, y_warp))
                # rows of D^-1 are the gradients of the barycentric weights of corners 1 and 2
                w1 = wp.vec2d(inv[0, 0], inv[0, 1])
                w2 = wp.vec2d(inv[1, 0], inv[1, 1])
                back_s = wp.transpose(F) * worn_s
                back_t = wp.transpose(F) * worn_t
                bent = wp.abs(angle) * wp.ddot(F, F)
                w0 = -(w1 + w2)
                k0 = guard_bound(w0, along, over, q_warp, q_weft, density) + shear_bound(w0, s, t, back_s, back_t, bent)
                k1 = guard_bound(w1, along, over, q_warp, q_weft, density) + shear_bound(w1, s, t, back_s, back_t, bent)
                k2 = guard_bound(w2, along, over, q_warp, q_weft, density) + shear_bound(w2, s, t, back_s, back_t, bent)
                k0 *= area
                k1 *= area
                k2 *= area
                force[slot + at[0]] -= f1 + f2
                force[slot + at[1]] += f1
                force[slot + at[2]] += f2
                stiffness[slot + at[0]] += k0
                stiffness[slot + at[1]] += k1
                stiffness[slot + at[2]] += k2
                if viscous:
                    v0 = velocity[i0]
                    v1 = velocity[i1]
                    v2 = velocity[i2]
                    v_cell = (k0 * v0 + k1 * v1 + k2 * v2) / wp.max(k0 + k1 + k2, wp.float64(1.0e-300))
                    viscosity[slot + at[0]] += (time_step * k0) * (v_cell - v0)
                    viscosity[slot + at[1]] += (time_step * k1) * (v_cell - v1)
                    viscosity[slot + at[2]] += (time_step * k2) * (v_cell - v2)
            k += 1
        if is_held:
            amplitude = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
            moving = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
            total = wp.float64(0.0)
            for k in range(4):
                amplitude += wave[k] * position[face[k]]
                total += wp.abs(wave[k])
                if viscous:
                    moving += wave[k] * velocity[face[k]]
            for k in range(4):
                force[slot + k] -= wave[k] * amplitude
                stiffness[slot + k] += wp.abs(wave[k]) * total
                if viscous:
                    viscosity[slot + k] -= (time_step * wave[k]) * moving


@wp.func
def guard_bound(
    w: wp.vec2d, warp: wp.vec2d, weft: wp.vec2d, q_warp: wp.float64, q_weft: wp.float64, density: wp.float64
):
    """Return a bound, per area, on the second derivative of the guard's energy by a corner's place.

    It is twice the Gauss-Newton part of the second derivative, plus the part due to the change of the area: at least the
    second derivative of a corner that moves alone, and, since the three corners of a cell move at once, enough for the
    step to be stable (eigenvalues of the step's matrix below 2).
    """
    along_warp = wp.dot(w, warp)
    along_weft = wp.dot(w, weft)
    return wp.float64(2.0) * (
        q_warp * along_warp * along_warp + q_weft * along_weft * along_weft + density * wp.dot(w, w)
    )


@wp.func
def shear_bound(w: wp.vec2d, s: wp.vec2d, t: wp.vec2d, back_s: wp.vec2d, back_t: wp.vec2d, bent: wp.float64):
    """Return the bound of `guard_bound` for 1/2 (F s . F t)^2.

    Its second derivative along a unit vector u by the place of the corner, with that of the area, is
    (u . g)^2 + 2 (F s . F t) (w . s) (w . t) |F u|^2 with g = (w . s) F^T F t + (w . t) F^T F s.

    back_s, back_t: F^T F s, F^T F t. bent: |F s . F t| times the square of F's norm.
    """
    along_s = wp.dot(w, s)
    along_t = wp.dot(w, t)
    g = back_t * along_s + back_s * along_t
    return wp.float64(2.0) * (wp.dot(g, g) + bent * (along_s * along_s + along_t * along_t))


@wp.func
def guard_energy(
    p0: wp.vec2d,
    p1: wp.vec2d,
    p2: wp.vec2d,
    laid: wp.vec3d,
    warp: wp.vec2d,
    weft: wp.vec2d,
    onset: wp.vec2d,
    s: wp.vec2d,
    t: wp.vec2d,
    guard: ThreadGuard,
):
    """Return the guard's energy of a cell [J], infinite if collapsed or mirrored; s, t: as in `evaluate_guard`."""
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    if det <= wp.float64(0.0):
        return wp.float64(wp.inf)
    worn_warp = on_body(laid, across(D, warp))
    worn_weft = on_body(laid, across(D, weft))
    density = wp.float64(0.0)
    if guard_acts(worn_warp, worn_weft, det, wp.float64(1.0), onset, guard.isotropic):
        if guard.isotropic != 0:
            turn = principal_direction(worn_warp, worn_weft)
            longest = combined(turn, worn_warp, worn_weft)
            worn_weft = combined(turned_left(turn), worn_warp, worn_weft)
            worn_warp = longest
        y_warp = excess_stretch(worn_warp / det, onset[0])
        y_weft = excess_stretch(worn_weft / det, onset[1])
        density = guard.stiffness_warp * y_warp * y_warp + guard.stiffness_weft * y_weft * y_weft
    if wp.dot(s, s) > wp.float64(0.0):
        angle = wp.dot(on_body(laid, across(D, s)), on_body(laid, across(D, t))) / (det * det)
        density += angle * angle
    return wp.float64(0.25) * det * density


@wp.kernel
def compute_guard_energy(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    guard: ThreadGuard,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """Compute the energy of the thread guard per face, with that of shear deficits and hourglass modes.

    position: #V [m]. energy: #F [J], infinite where a cell is collapsed or mirrored.
    """
    f = natural(wp.tid() + first)
    face = cells.face[f]
    warp = guard.warp * cells.slack[f][0]
    weft = guard.weft * cells.slack[f][1]
    onset = cells.onset[f]
    s = wp.vec2d()
    t = wp.vec2d()
    if wp.dot(cells.shear[f], cells.shear[f]) > wp.float64(0.0):
        s = sheared(cells.shear[f], warp, weft, cells.slack[f])
        t = sheared(turned_left(cells.shear[f]), warp, weft, cells.slack[f])
    begin = natural(cells.first[f])
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    if face[3] < 0:
        energy[f] = guard_energy(p0, p1, p2, cells.laid[begin], warp, weft, onset, s, t, guard)
    else:
        p3 = position[natural(face[3])]
        energy[f] = wp.float64(0.5) * (
            guard_energy(p3, p0, p1, cells.laid[begin], warp, weft, onset, s, t, guard)
            + guard_energy(p0, p1, p2, cells.laid[natural(begin + 1)], warp, weft, onset, s, t, guard)
            + guard_energy(p1, p2, p3, cells.laid[natural(begin + 2)], warp, weft, onset, s, t, guard)
            + guard_energy(p2, p3, p0, cells.laid[natural(begin + 3)], warp, weft, onset, s, t, guard)
        )
        wave = cells.hourglass[f]
        if wp.dot(wave, wave) > wp.float64(0.0):
            amplitude = wave[0] * p0 + wave[1] * p1 + wave[2] * p2 + wave[3] * p3
            energy[f] += wp.float64(0.5) * wp.dot(amplitude, amplitude)


@wp.func
def area_share(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d):
    """Return a cell's signed area in the plane over that on the body."""
    return wp.determinant(edge_matrix(p0, p1, p2)) / wp.max(laid[0] * laid[2], wp.float64(1.0e-300))


@wp.kernel
def find_least_shares(
    position: wp.array(dtype=wp.vec2d),
    face: wp.array(dtype=wp.vec4i),
    cell: wp.array(dtype=wp.int32),
    laid: wp.array(dtype=wp.vec3d),
    first: int,
    # outputs
    share: wp.array(dtype=wp.float64),
):
    """Compute the least signed area in the plane over that on the body of the cells of each face.

    position: #V [m]. face, cell, laid: as in `Cells`. share: #F, 0 or less where a cell is collapsed or mirrored.
    """
    f = natural(wp.tid() + first)
    corners = face[f]
    begin = natural(cell[f])
    p0 = position[natural(corners[0])]
    p1 = position[natural(corners[1])]
    p2 = position[natural(corners[2])]
    if corners[3] < 0:
        share[f] = area_share(p0, p1, p2, laid[begin])
    else:
        p3 = position[natural(corners[3])]
        share[f] = wp.min(
            wp.min(area_share(p3, p0, p1, laid[begin]), area_share(p0, p1, p2, laid[begin + 1])),
            wp.min(area_share(p1, p2, p3, laid[begin + 2]), area_share(p2, p3, p0, laid[begin + 3])),
        )
