"""Worn strain and strain energy per cell in the fabric's axes, by paper eqs. (1)-(3) and by the membrane's law."""

import warp as wp

from .cells import Cells, across, cell_corner, cell_weight, count_cells, edge_matrix, flat_edges, laid_edges, on_body
from .indices import natural
from .membrane import Cloth, sheared_threads, stretched_sheet

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


@wp.struct
class Membrane:
    """Plane stress of an orthotropic sheet: sigma_warp = c_warp e_warp + c_cross e_weft, tau = shear gamma.

    warp, weft: unit vectors in the plane. c_warp, c_weft, c_cross, shear: [N/m].
    """

    warp: wp.vec2d
    weft: wp.vec2d
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
def worn_strain(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d, membrane: Membrane):
    """Return the determinant of a cell's edges in the plane [m2], and its strains along warp and weft and in shear.

    The determinant of a mirrored cell is 0 or less, and its strains are 0.
    """
    D = edge_matrix(p0, p1, p2)
    det = wp.determinant(D)
    e = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
    if det > wp.float64(0.0):
        worn_warp = on_body(laid, across(D, membrane.warp)) / det
        worn_weft = on_body(laid, across(D, membrane.weft)) / det
        e = wp.vec3d(
            wp.length(worn_warp) - wp.float64(1.0),
            wp.length(worn_weft) - wp.float64(1.0),
            wp.dot(worn_warp, worn_weft),
        )
    return det, e


@wp.func
def stress_of(e: wp.vec3d, membrane: Membrane):
    """Return sigma_warp, sigma_weft, tau [N/m]."""
    return wp.vec3d(
        membrane.c_warp * e[0] + membrane.c_cross * e[1],
        membrane.c_weft * e[1] + membrane.c_cross * e[0],
        membrane.shear * e[2],
    )


@wp.func
def stored_energy(p0: wp.vec2d, p1: wp.vec2d, p2: wp.vec2d, laid: wp.vec3d, membrane: Membrane):
    """Return the strain energy of a cell with all of its area [J]."""
    det, e = worn_strain(p0, p1, p2, laid, membrane)
    return wp.float64(0.25) * wp.dot(stress_of(e, membrane), e) * det


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

    U = 1/2 (sigma_warp e_warp + sigma_weft e_weft + tau gamma) a, eq. (3), with a the signed flat area of the cell.

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
        det, e = worn_strain(p0, p1, p2, cells.laid[c], membrane)
        flat = wp.float64(0.5) * det * cell_weight(face)
        s = stress_of(e, membrane)
        strain[c] = e
        stress[c] = s
        energy[c] = wp.float64(0.5) * wp.dot(s, e) * flat
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
        e = wp.vec3d(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0))
        if det > wp.float64(0.0):
            F = laid_edges(cells.laid[c]) * wp.inverse(D)
            worn_warp = F * cloth.warp
            worn_weft = F * cloth.weft
            e = wp.vec3d(
                wp.length(worn_warp) - wp.float64(1.0),
                wp.length(worn_weft) - wp.float64(1.0),
                wp.dot(worn_warp, worn_weft),
            )
        law = stretched_sheet(wp.vec2d(e[0], e[1]), cloth)
        across = sheared_threads(e[2], cloth)
        strain[c] = e
        stress[c] = wp.vec3d(law[0], law[1], across[0])
        energy[c] = (law[2] + across[1]) * area[c]
        k += 1
