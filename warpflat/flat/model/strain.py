"""Worn strain, stress and strain energy of a layout, and its errors as a map of the surface.

The cloth is flat when relaxed and strained when worn. Strain here is *worn* strain, L3/l2 - 1: a thread that is shorter
flat than on the body is in tension when worn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import launch_each
from warpflat.flat.fabric.fabric import Fabric, grain_axes
from warpflat.flat.fabric.limits import Demand
from warpflat.flat.model.membrane import Model, make_cloth
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.triangles import corner_triangles
from warpflat.flat.surface.untangle import signed_cell_areas
from warpflat.kernels.cells import Cells
from warpflat.kernels.membrane_cell import Cloth
from warpflat.kernels.strain import average_over_faces, compute_worn_strain

__all__ = [
    "LayoutErrors",
    "WornStrain",
    "area_beyond",
    "corner_strain",
    "face_areas",
    "layout_errors",
    "shear_angles",
    "strain_energy",
    "worn_cell_strain",
    "worn_strain",
]


# A cell smaller in the plane than this share of its area on the body is crushed to a point or a line.
_COLLAPSED = 1e-9


@dataclass(frozen=True, kw_only=True)
class WornStrain:
    """Worn strain, stress and energy of each face, means over its cells by flat area.

    Attributes:
        strain: #F by 3: along warp, along weft, and shear, the product of the worn threads' directions [1].
        stress: #F by 3: sigma_warp, sigma_weft, tau [N/m].
        energy: #F, strain energy, paper eq. (3) [J].
        area: #F, flat area [m2].
    """

    strain: FloatArray
    stress: FloatArray
    energy: FloatArray
    area: FloatArray

    @property
    def energy_density(self) -> FloatArray:
        """Strain energy per flat area, #F [J/m2]; at most the largest float32, where a face is crushed to a point."""
        with np.errstate(over="ignore", invalid="ignore"):
            density = self.energy / np.where(self.area > 0, self.area, np.inf)
        most = float(np.finfo(np.float32).max)
        return np.minimum(np.nan_to_num(density, nan=most, posinf=most), most)


def worn_strain(network: SpringNetwork, positions: FloatArray) -> WornStrain:
    """Return the worn strain of a layout (#V by 2 [m]) of the network's surface in the network's fabric.

    Stresses are linear for springs; a membrane's are its own, with the fabric's curves and its wrinkling.
    """
    offset, device = network.cell_arrays.of_face, network.device
    cells = [
        wp.array(offset, dtype=wp.int32, device=device, copy=False),
        *worn_cell_strain(network, positions, network.model),
    ]
    strain, stress, energy, area = faces = _worn_arrays(len(offset) - 1, device)
    launch_each(average_over_faces, len(offset) - 1, cells, faces, device=device)
    return WornStrain(strain=strain.numpy(), stress=stress.numpy(), energy=energy.numpy(), area=area.numpy())


def shear_angles(strain: FloatArray) -> FloatArray:
    """Return the angles by which worn warp and weft are off the right angle, #C [degrees].

    Args:
        strain: #C by 3: along warp, along weft, and shear, the product F e_warp . F e_weft.
    """
    lengths = np.maximum((1.0 + strain[:, 0]) * (1.0 + strain[:, 1]), 1e-12)
    return np.asarray(np.degrees(np.arcsin(np.clip(strain[:, 2] / lengths, -1.0, 1.0))))


def area_beyond(fabric: Fabric, strain: FloatArray, area: FloatArray) -> float:
    """Return how much cloth with worn strains (#C by 3, see `WornStrain`) and areas (#C [m2]) is beyond its limits [m2]."""
    return float(area[Demand.of(fabric, strain[:, 0], strain[:, 1], shear_angles(strain)).beyond].sum())


def strain_energy(network: SpringNetwork, positions: FloatArray) -> float:
    """Return the strain energy of a layout (#V by 2 [m]), the sum of the faces' energies of `worn_strain` [J]."""
    return float(worn_cell_strain(network, positions, network.model)[2].numpy().sum())


def worn_cell_strain(network: SpringNetwork, positions: FloatArray, law: Model) -> list[wp.array]:
    """Return worn strain and stress (#C by 3), energy [J] and area [m2] (#C) of the cells; see `kernels.strain`.

    Stress and energy are those of plane stress, or with `law` "membrane" those of the membrane with the fabric's
    curves.
    """
    device = network.device
    at = wp.array(np.ascontiguousarray(positions), dtype=wp.vec2d, device=device)
    cells = _worn_arrays(network.cell_count, device)
    cloth = _cloth(network.fabric, network.grain_angle, device.alias, law)
    launch_each(compute_worn_strain, network.face_count, [at, network.cells, cloth], cells, device=device)
    return cells


def corner_strain(network: SpringNetwork, places: FloatArray) -> FloatArray:
    """Return the worn strain of cells whose corners lie apart from their neighbours', #C by 3 (see `WornStrain`).

    Args:
        network: of the piece.
        places: #C by 3 by 2, of each cell's corners [m].
    """
    device, count = network.device, network.cell_count
    apart = np.full((count, 4), -1, dtype=np.int32)
    apart[:, :3] = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    cells = Cells()
    cells.face, cells.laid = wp.array(apart, dtype=wp.vec4i, device=device), network.cells.laid
    cells.first = wp.array(np.arange(count, dtype=np.int32), dtype=wp.int32, device=device)
    at = wp.array(np.ascontiguousarray(places.reshape(-1, 2)), dtype=wp.vec2d, device=device)
    made = _worn_arrays(count, device)
    cloth = _cloth(network.fabric, network.grain_angle, device.alias, "membrane")
    launch_each(compute_worn_strain, count, [at, cells, cloth], made, device=device)
    return np.array(made[0].numpy())


@lru_cache
def _cloth(fabric: Fabric, grain_angle: float, device: str, law: Model) -> Cloth:
    return make_cloth(fabric, grain_axes(grain_angle), wp.get_device(device), linear=law == "springs")


def _worn_arrays(count: int, device: wp.Device) -> list[wp.array]:
    return [wp.empty(count, dtype=kind, device=device) for kind in (wp.vec3d, wp.vec3d, wp.float64, wp.float64)]


@dataclass(frozen=True, kw_only=True)
class LayoutErrors:
    """The errors of a layout against an isometry.

    Attributes:
        length_error: sum |l2 - L3| / sum L3 over the mesh edges (Wang 2002, E_c).
        area_error: sum |a2 - A3| / sum A3 over the faces (Wang 2002, E_s).
        boundary_error: |border length in the plane - in space| / in space.
        flipped_faces: faces of which a cell (a triangle; a quad's corner triangle) is mirrored or collapsed, to less
            than a billionth of its area on the body.
    """

    length_error: float
    area_error: float
    boundary_error: float
    flipped_faces: int


def layout_errors(surface: Surface, network: SpringNetwork, positions: FloatArray) -> LayoutErrors:
    """Return the errors of a layout (#V by 2 [m]) of the network's surface."""
    he = half_edges_of(surface)
    edges = he.edges
    in_space, in_plane = _lengths(surface.vertices, edges), _lengths(positions, edges)
    corner, face, weight = corner_triangles(network.cell_arrays.faces)
    signed = weight * signed_cell_areas(corner, positions)
    flat, body = face_areas(network, positions)
    border = he.count == 1
    border_space, border_plane = in_space[border].sum(), in_plane[border].sum()
    return LayoutErrors(
        length_error=float(np.abs(in_plane - in_space).sum() / in_space.sum()),
        area_error=float(np.abs(flat - body).sum() / body.sum()),
        boundary_error=float(abs(border_plane - border_space) / border_space),
        flipped_faces=len(np.unique(face[signed <= _COLLAPSED * network.cell_arrays.area])),
    )


def face_areas(network: SpringNetwork, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the faces' areas in a layout (#V by 2 [m]), negative where mirrored, and on the body, #F each [m2]."""
    cells = network.cell_arrays
    corner, face, weight = corner_triangles(cells.faces)
    faces = len(network.surface.faces)
    flat = np.bincount(face, weight * signed_cell_areas(corner, positions), minlength=faces)
    body = np.bincount(face, cells.area, minlength=faces)
    return np.asarray(flat, dtype=np.float64), np.asarray(body, dtype=np.float64)


def _lengths(points: FloatArray, edges: IntArray) -> FloatArray:
    return np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
