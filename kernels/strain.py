"""Worn strain and strain energy per cell in the fabric's axes, by paper eqs. (1)-(3) and by the membrane's law."""

import warp as wp

from .cells import (
    Cells,
    across,
    cell_corner,
    cell_weight,
    combined,
    count_cells,
    edge_matrix,
    flat_edges,
    laid_edges,
    on_body,
    principal_direction,
    turned_left,
)
from .indices import natural
from .membrane_cell import Cloth, sheared_threads, stretched_sheet

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.struct
class Membrane:
    """Plane stress of an orthotropic sheet: sigma_warp = c_warp e_warp + c_cross e_weft, tau = shear gamma.

    warp, weft: unit vectors in the plane. c_warp, c_weft, c_cross, shear: [N/m]. isotropic: 1 for a sheet without threads,
    whose stress follows from its principal strains.
    """

    warp: wp.vec2d
    weft: wp.vec2d
    isotropic: int
    c_warp: wp.float64
    c_weft: wp.float64
    c_cross: wp.float64
    shear: wp.float64


@wp.kernel
def measure_flat_cells(
    position: wp.array(dtype=wp.vec2d),
    corner: wp.array(dtype=wp.vec3i),
    first: int,
    # outputs
    area: wp.array(dtype=wp.float64),
):
    """Measure the signed area of cells in the plane.

    position: #V [m]. corner: #C. area: #C [m2], 0 or less where a cell is mirrored or collapsed.
    """
    c = natural(wp.tid() + first)
    area[c] = wp.float64(0.5) * wp.determinant(flat_edges(position, corner[c]))


@wp.func
def worn_strain(worn_warp: wp.vec2d, worn_weft: wp.vec2d):
    """Return the strains along two worn threads, and their shear."""
    return wp.vec3d(
        wp.length(worn_warp) - wp.float64(1.0), wp.length(worn_weft) - wp.float64(1.0), wp.dot(worn_warp, worn_weft)
    )


@wp.func
def against_grain(turn: wp.vec2d, s: wp.vec3d):
    """Return sigma_warp, sigma_weft, tau of principal stresses, the first one along `turn` from the warp."""
    c2 = turn[0] * turn[0]
    s2 = turn[1] * turn[1]
    return wp.vec3d(c2 * s[0] + s2 * s[1], s2 * s[0] + c2 * s[1], turn[0] * turn[1] * (s[0] - s[1]))


@wp.func
def stress_of(e: wp.vec3d, membrane: Membrane):
    """Return sigma_warp, sigma_weft, tau [N/m]."""
    return wp.vec3d(
        membrane.c_warp * e[0] + membrane.c_cross * e[1],
        membrane.c_weft * e[1] + membrane.c_cross * e[0],
        membrane.shear * e[2],
    )


@wp.func
def worn_state(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d, membrane: Membrane):
    """Return the determinant of a cell's edges in the plane [m2], its strains and stresses, and its energy density.

    The determinant of a mirrored cell is 0 or less, and the others are 0.
    """
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    e = wp.vec3d()
    s = wp.vec3d()
    density = wp.float64(0.0)
    if det > wp.float64(0.0):
        worn_warp = on_body(laid, across(D, membrane.warp)) / det
        worn_weft = on_body(laid, across(D, membrane.weft)) / det
        e = worn_strain(worn_warp, worn_weft)
        if membrane.isotropic != 0:
            turn = principal_direction(worn_warp, worn_weft)
            principal = worn_strain(
                combined(turn, worn_warp, worn_weft), combined(turned_left(turn), worn_warp, worn_weft)
            )
            s = stress_of(principal, membrane)
            density = wp.float64(0.5) * wp.dot(s, principal)
            s = against_grain(turn, s)
        else:
            s = stress_of(e, membrane)
            density = wp.float64(0.5) * wp.dot(s, e)
    return det, e, s, density


@wp.func
def stored_energy(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d, membrane: Membrane):
    """Return the strain energy of a cell with all of its area [J]."""
    det, _e, _s, density = worn_state(p0, p1, p2, laid, membrane)
    return wp.float64(0.5) * density * det


@wp.kernel
def compute_worn_strain(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    membrane: Membrane,
    first: int,
    # outputs
    strain: wp.array(dtype=wp.vec3d),
    stress: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
    area: wp.array(dtype=wp.float64),
):
    """Compute worn strain, stress and energy of cells.

    The cloth is flat when relaxed and strained when worn: e = |F e_warp| - 1, |F e_weft| - 1, gamma = F e_warp . F
    e_weft.

    U = 1/2 (sigma_warp e_warp + sigma_weft e_weft + tau gamma) a, eq. (3), with a the signed flat area of the cell; in
    an isotropic sheet of its principal strains and stresses, so that it does not depend on the grain.

    Launched over the faces. position: #V [m]. strain: #C (e_warp, e_weft, gamma). stress: #C (sigma_warp, sigma_weft,
    tau) [N/m].
    energy: #C [J]. area: #C, the weighted flat area [m2], 0 or less in a mirrored cell, whose strain is then given as
    0.
    """
    f = natural(wp.tid() + first)
    face = cells.face[f]
    k = int(0)
    count = count_cells(face)
    while k < count:
        c = natural(cells.first[f] + k)
        at = cell_corner(face, k)
        p0 = position[natural(at[0])]
        p1 = position[natural(at[1])]
        p2 = position[natural(at[2])]
        det, e, s, density = worn_state(p0, p1, p2, cells.laid[c], membrane)
        flat = wp.float64(0.5) * det * cell_weight(face)
        strain[c] = e
        stress[c] = s
        energy[c] = density * flat
        area[c] = flat
        k += 1


@wp.kernel
def compute_strain_energy(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    membrane: Membrane,
    first: int,
    # outputs
    energy: wp.array(dtype=wp.float64),
):
    """Compute the energy of `compute_worn_strain` alone, per face. position: #V [m]. energy: #F [J]."""
    f = natural(wp.tid() + first)
    face = cells.face[f]
    c = natural(cells.first[f])
    p0 = position[natural(face[0])]
    p1 = position[natural(face[1])]
    p2 = position[natural(face[2])]
    if face[3] < 0:
        energy[f] = stored_energy(p0, p1, p2, cells.laid[c], membrane)
    else:
        p3 = position[natural(face[3])]
        energy[f] = wp.float64(0.5) * (
            stored_energy(p3, p0, p1, cells.laid[c], membrane)
            + stored_energy(p0, p1, p2, cells.laid[natural(c + 1)], membrane)
            + stored_energy(p1, p2, p3, cells.laid[natural(c + 2)], membrane)
            + stored_energy(p2, p3, p0, cells.laid[natural(c + 3)], membrane)
        )


@wp.kernel
def average_over_faces(
    offset: wp.array(dtype=wp.int32),
    strain: wp.array(dtype=wp.vec3d),
    stress: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
    area: wp.array(dtype=wp.float64),
    first: int,
    # outputs
    face_strain: wp.array(dtype=wp.vec3d),
    face_stress: wp.array(dtype=wp.vec3d),
    face_energy: wp.array(dtype=wp.float64),
    face_area: wp.array(dtype=wp.float64),
):
    """Add up the energies and areas of each face's cells, and average their strains and stresses by area.

    offset: #F+1, where each face's cells begin. strain, stress, energy, area: #C. The same with face_: #F.
    """
    f = natural(wp.tid() + first)
    total = wp.float64(0.0)
    stored = wp.float64(0.0)
    for c in range(offset[f], offset[f + 1]):
        total += area[c]
        stored += energy[c]
    e = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    s = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    if total > wp.float64(0.0):
        for c in range(offset[f], offset[f + 1]):
            share = area[c] / total
            e += share * strain[c]
            s += share * stress[c]
    face_strain[f] = e
    face_stress[f] = s
    face_energy[f] = stored
    face_area[f] = total


@wp.kernel
def compute_membrane_strain(
    position: wp.array(dtype=wp.vec2d),
    cells: Cells,
    cloth: Cloth,
    first: int,
    # outputs
    strain: wp.array(dtype=wp.vec3d),
    stress: wp.array(dtype=wp.vec3d),
    energy: wp.array(dtype=wp.float64),
    area: wp.array(dtype=wp.float64),
):
    """Compute the worn strain against the unstretched cloth, with the membrane's stresses and energy.

    Launched over the faces. position: #V [m]. strain: #C (e_warp, e_weft, gamma). stress: #C (sigma_warp, sigma_weft,
    tau) [N/m].
    energy: #C [J]. area: #C, the weighted flat area [m2], 0 or less in a mirrored cell, whose strain is then given as
    0.
    """
    f = natural(wp.tid() + first)
    face = cells.face[f]
    k = int(0)
    count = count_cells(face)
    while k < count:
        c = natural(cells.first[f] + k)
        D = flat_edges(position, cell_corner(face, k))
        det = wp.determinant(D)
        area[c] = wp.float64(0.5) * det * cell_weight(face)
        e = wp.vec3d()
        along = wp.vec3d()
        turn = wp.vec2d(wp.float64(1.0), wp.float64(0.0))
        if det > wp.float64(0.0):
            F = laid_edges(cells.laid[c]) * wp.inverse(D)
            worn_warp = F * cloth.warp
            worn_weft = F * cloth.weft
            e = worn_strain(worn_warp, worn_weft)
            along = e
            if cloth.isotropic != 0:
                turn = principal_direction(worn_warp, worn_weft)
                along = worn_strain(
                    combined(turn, worn_warp, worn_weft), combined(turned_left(turn), worn_warp, worn_weft)
                )
                along[2] = wp.float64(0.0)
        law = stretched_sheet(wp.vec2d(along[0], along[1]), cloth)
        shear = sheared_threads(along[2], cloth)
        strain[c] = e
        s = wp.vec3d(law[0], law[1], shear[0])
        if cloth.isotropic != 0:
            s = against_grain(turn, s)
        stress[c] = s
        energy[c] = (law[2] + shear[1]) * area[c]
        k += 1
