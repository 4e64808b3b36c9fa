"""Worn strain, stress and strain energy per cell in the fabric's axes, paper eqs. (1)-(3) and the membrane's law."""

import warp as wp

from .cells import Cells, cell_corner, cell_weight, count_cells, flat_edges
from .indices import natural
from .membrane_cell import Cloth, worn_cell

wp.set_module_options({"enable_backward": False, "fuse_fp": False})


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


@wp.kernel
def compute_worn_strain(
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
    """Compute worn strain, stress and energy of cells against the unstretched cloth.

    The cloth is flat when relaxed and strained when worn: e = |F e_warp| - 1, |F e_weft| - 1, gamma = F e_warp . F
    e_weft.

    Stresses and energy are those of the membrane's law (`membrane_cell.cloth_law`). For a linear cloth this is eq. (3),
    U = 1/2 (sigma_warp e_warp + sigma_weft e_weft + tau gamma) a, with a the signed flat area of the cell. In an isotropic
    sheet they follow from the principal strains, so that the energy does not depend on the grain.

    Launched over the faces. position: #V [m]. strain: #C (e_warp, e_weft, gamma). stress: #C (sigma_warp, sigma_weft,
    tau) [N/m].
    energy: #C [J]. area: #C, the weighted flat area [m2], 0 or less in a mirrored cell, whose strain is then given as
    0.
    """
    f = natural(wp.tid() + first)
    face = cells.face[f]
    unstretched = wp.vec2d(wp.float64(1.0), wp.float64(1.0))
    k = int(0)
    count = count_cells(face)
    while k < count:
        c = natural(cells.first[f] + k)
        D = flat_edges(position, cell_corner(face, k))
        det = wp.determinant(D)
        area[c] = wp.float64(0.5) * det * cell_weight(face)
        strain[c] = wp.vec3d()
        stress[c] = wp.vec3d()
        energy[c] = wp.float64(0.0)
        if det > wp.float64(0.0):
            cell = worn_cell(D, cells.laid[c], cloth, unstretched)
            warp = cell.F * cloth.warp
            weft = cell.F * cloth.weft
            strain[c] = wp.vec3d(
                wp.length(warp) - wp.float64(1.0), wp.length(weft) - wp.float64(1.0), wp.dot(warp, weft)
            )
            # The stress along the cell's directions, turned to warp and weft.
            cosine = wp.dot(cell.warp, cloth.warp)
            sine = wp.dot(cell.warp, cloth.weft)
            s = wp.mat22d(cell.law.sigma[0], cell.law.tau, cell.law.tau, cell.law.sigma[1])
            turn = wp.mat22d(cosine, -sine, sine, cosine)
            s = turn * s * wp.transpose(turn)
            stress[c] = wp.vec3d(s[0, 0], s[1, 1], s[0, 1])
            energy[c] = cell.law.energy * area[c]
        k += 1


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
