"""Maps of the strain energy: its density at vertices, totals per region and line, and its peak, described in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator

from warpflat.core.arrays import BoolArray, FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.launch import launch_each
from warpflat.core.polyline import nearest_on_polyline, segment_lengths
from warpflat.core.sparse import factor_symmetric
from warpflat.flat.surface.mesh import Surface, once_per_surface
from warpflat.flat.surface.triangles import corner_triangles
from warpflat.kernels.unfold import measure_triangles

__all__ = ["energy_report", "place_in_words", "smooth_to_vertices"]


# Relative tolerance of the diffusion, and the number of iterations after which it is solved directly, as slivers may need.
_TOLERANCE = 1e-9
_MOST_ITERATIONS = 1000
# Surfaces of more vertices are smoothed with a preconditioner of several levels.
_LARGE = 50_000


def energy_report(
    surface: Surface, face_energy: ArrayLike, *, regions: Mapping[str, BoolArray] | None = None
) -> dict[str, Any]:
    """Describe the energy distribution of a piece, as in `metrics.json`.

    Args:
        surface: the surface the energies belong to.
        face_energy: #F, strain energy of each face [J].
        regions: face sets by name (bricks, say), #F each.

    Returns:
        "peak" in words, per line its length and its mean and highest density, per region its joules.

    Raises:
        InputError: an energy is not finite.
    """
    areas = _face_areas(surface)
    density = np.asarray(face_energy, dtype=np.float64) / np.where(areas > 0.0, areas, np.inf)
    at_vertices = smooth_to_vertices(surface, density)
    peak = int(np.argmax(at_vertices))
    lines = {}
    for name, line in surface.lines.items():
        # Linear between its vertices.
        along, step = at_vertices[line], segment_lengths(surface.vertices[line])
        length = float(step.sum())
        integral = float((0.5 * (along[:-1] + along[1:]) * step).sum())
        mean = integral / length if length > 0 else float(along.mean())
        lines[name] = {"length_m": length, "mean_j_per_m2": mean, "peak_j_per_m2": float(along.max())}
    report: dict[str, Any] = {
        "peak": place_in_words(surface, peak),
        "peak_j_per_m2": float(at_vertices[peak]),
        "lines": lines,
    }
    if regions:
        energy = density * areas
        report["bricks"] = {name: float(energy[faces].sum()) for name, faces in regions.items()}
    return report


def place_in_words(surface: Surface, vertex: int, *, lines: int = 2) -> str:
    """Describe the place of a vertex for a pattern maker, such as "4 mm above bust line, 12 mm from princess front".

    Distances to the nearest lines, two unless more are asked for, are straight in space: near a line that is what a tape measures to
    less than a millimetre. Without a line the vertex is named, as it was read.
    """
    here = surface.vertices[vertex]
    offsets = {name: nearest_on_polyline(here, surface.vertices[line]) - here for name, line in surface.lines.items()}
    away = {name: float(np.linalg.norm(offset)) for name, offset in offsets.items()}
    phrases = []
    # Lines that are equally near, to the micrometre, stay in the surface's order.
    for name in sorted(away, key=lambda name: round(away[name], 6))[:lines]:
        if away[name] < 1e-3:
            phrases.append(f"on {name}")
            continue
        rise = -float(offsets[name][1]) / away[name]
        # Within 45 degrees of the vertical a line lies above or below, else beside.
        side = "above" if rise > np.sqrt(0.5) else "below" if rise < -np.sqrt(0.5) else "from"
        phrases.append(f"{away[name] * 1e3:.0f} mm {side} {name}")
    at = ", ".join(f"{x:.3f}" for x in here)
    return ", ".join(phrases) or f"vertex {int(surface.input_index[vertex])} at ({at}) m"


def smooth_to_vertices(surface: Surface, face_density: ArrayLike, *, smoothing_length: float = 0.0) -> FloatArray:
    """Return the energy density at the vertices, with the same total energy.

    Each face gives its energy and its area to its corners in equal parts.
    A smoothing length then spreads the energy over the surface as heat spreads: (M + l^2/2 L) d' = M d, with M the
    vertex areas and L the cotangent stiffness, one implicit step. This removes differences that depend on the mesh, on slivers
    above all, and conserves the energy, since the columns of L sum to zero.

    Args:
        surface: the surface.
        face_density: #F [J/m2].
        smoothing_length: standard distance over which a point of energy is spread [m]; 0 for none.

    Returns:
        #V [J/m2]; 0 at vertices without a face of positive area.

    Raises:
        InputError: a density is not finite.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import cg, spsolve

    density = np.asarray(face_density, dtype=np.float64)
    wrong = np.flatnonzero(~np.isfinite(density))
    if len(wrong):
        raise InputError(f"energy density of face {int(wrong[0])} is not finite: {density[wrong[0]]}")
    # Each face gives its vertices equal parts of its area [m2] and its energy [J].
    count = len(surface.vertices)
    is_corner = surface.faces >= 0
    part = _face_areas(surface) / is_corner.sum(axis=1)
    spread = np.broadcast_to(part[:, None], is_corner.shape)[is_corner]
    held = spread * np.broadcast_to(density[:, None], is_corner.shape)[is_corner]
    corner = surface.faces[is_corner]
    area, energy = (np.bincount(corner, parts, minlength=count).astype(np.float64) for parts in (spread, held))
    if smoothing_length > 0:
        system, edge = _diffusion_matrix(surface, area, smoothing_length)
        used = np.flatnonzero(area > 0)
        if len(used) < count:
            system = system[used][:, used]
        # Heat does not spread far in one step, so a few dozen iterations suffice, where a factorisation would grow faster than the mesh.
        # Where an edge is a small part of the length, sums over cubes save two thirds of them.
        first = energy[used] / area[used]
        inverse = (
            diags_array(1.0 / system.diagonal())
            if len(used) < _LARGE
            else multilevel_preconditioner(system, surface.vertices[used], edge)
        )
        solved, left = cg(
            system,
            energy[used],
            x0=first,
            rtol=_TOLERANCE,
            maxiter=_MOST_ITERATIONS,
            M=inverse,
        )
        smooth = np.zeros(count)
        smooth[used] = solved if left == 0 else spsolve(system.tocsc(), energy[used])
        # Spread evenly, what the iterations leave: the total is kept to rounding.
        smooth[used] += (energy[used].sum() - area[used] @ smooth[used]) / area[used].sum()
        energy = area * smooth
    return np.divide(energy, area, out=np.zeros(len(area)), where=area > 0)


def _diffusion_matrix(surface: Surface, area: FloatArray, length: float) -> tuple[csr_array, float]:
    """Return M + l^2/2 L, #V by #V, and the length of a typical edge [m]."""
    from scipy.sparse import diags_array

    triangles, _, weight = corner_triangles(surface.faces)
    triangle_area, product = _measured(surface, triangles)
    # Negative cotangents of obtuse corners could make densities negative, and those of slivers are rounding noise.
    # Without them the diffusion is a little slower there and still conserves energy.
    np.maximum(product, 0.0, out=product)
    # A corner below 0.001 rad counts as 0.001 rad: it couples its neighbours almost rigidly anyway.
    half = 1e-3 * product
    half += np.finfo(float).tiny
    np.maximum(2.0 * triangle_area[:, None], half, out=half)
    np.divide(product, half, out=half)
    del product  # a million vertices' takes 50 MB
    half *= 0.25 * length**2 * weight[:, None]
    across = np.roll(triangles, -1, axis=1).ravel(), np.roll(triangles, 1, axis=1).ravel()
    count = len(surface.vertices)
    # The sum of this matrix with its transpose couples neighbours.
    joined = csr_array((half.ravel(), across), shape=(count, count))
    joined = joined + joined.T
    return (diags_array(area + joined.sum(axis=1)) - joined).tocsr(), float(np.sqrt(triangle_area.mean()))


@once_per_surface
def _face_areas(surface: Surface) -> FloatArray:
    """Return #F, the areas of faces [m2]; that of a quad is the mean of both ways of splitting it."""
    triangles, face, weight = corner_triangles(surface.faces)
    area, _ = _measured(surface, triangles)
    total = np.bincount(face, weights=weight * area, minlength=len(surface.faces)).astype(np.float64)
    total.flags.writeable = False
    return total


def _measured(surface: Surface, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the areas of triangles (#T by 3 vertices), and at each corner the scalar product of the edges that leave it [m2]."""
    area, product = np.empty(len(triangles)), np.empty((len(triangles), 3))
    launch_each(measure_triangles, len(triangles), [surface.vertices, triangles], [area, product])
    return area, product


# The first cubes are so many edges wide; there are sums down to a level of at most so many cubes, which is solved.
_FIRST_CUBE = 1.5
_COARSEST = 3_000


def multilevel_preconditioner(matrix: csr_array, places: FloatArray, edge_length: float) -> LinearOperator:
    """Return an approximate inverse of a symmetric matrix of diffusion, the sum of those on all levels.

    Args:
        matrix: #V by #V, positive definite.
        places: #V by 3 [m].
        edge_length: of a typical edge [m].
    """
    cube = np.floor((places - places.min(axis=0)) / (_FIRST_CUBE * edge_length)).astype(np.int64)
    inverse, into = [1.0 / matrix.diagonal()], []
    while matrix.shape[0] > _COARSEST:
        _, sizes_y, sizes_z = (cube.max(axis=0) + 1).tolist()
        _, first, label = np.unique(
            (cube[:, 0] * sizes_y + cube[:, 1]) * sizes_z + cube[:, 2], return_index=True, return_inverse=True
        )
        rows = np.arange(len(label) + 1, dtype=np.int32)
        sums = csr_array((np.ones(len(label)), label.astype(np.int32), rows), shape=(len(label), len(first)))
        matrix = (sums.T @ (matrix @ sums)).tocsr()
        inverse.append(1.0 / matrix.diagonal())
        into.append(label)
        cube = cube[first] // 2
    solve = factor_symmetric(matrix)

    def apply(residual: FloatArray) -> FloatArray:
        residuals: list[FloatArray] = [residual]
        for label, known in zip(into, inverse[1:], strict=True):
            residuals.append(np.bincount(label, residuals[-1], minlength=len(known)).astype(np.float64, copy=False))
        result: FloatArray = solve(residuals[-1])
        for level in range(len(into) - 1, -1, -1):
            result = result[into[level]]
            result += inverse[level] * residuals[level]
        return result

    return LinearOperator((len(places), len(places)), matvec=apply, dtype=np.float64)
