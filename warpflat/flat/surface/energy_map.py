"""Maps of the strain energy: its density at vertices, totals per region and line, and its peak, described in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.launch import launch_each
from warpflat.core.polyline import nearest_on_polyline, segment_lengths
from warpflat.core.sparse import factor_symmetric
from warpflat.flat.surface.mesh import Surface, once_per_surface
from warpflat.flat.surface.triangles import corner_triangles
from warpflat.kernels.unfold import measure_triangles

if TYPE_CHECKING:
    from scipy.sparse import csr_array

__all__ = [
    "EnergyMap",
    "EnergyPeak",
    "LineEnergy",
    "energy_map",
    "energy_peak",
    "energy_report",
    "integrate_along",
    "integrate_faces",
    "place_in_words",
    "smooth_to_vertices",
]


# Relative tolerance of the diffusion, and the number of iterations after which it is solved directly, as slivers may need.
_TOLERANCE = 1e-9
_MOST_ITERATIONS = 1000
# Surfaces of more vertices are smoothed with a preconditioner of several levels.
_LARGE = 50_000


@dataclass(frozen=True, kw_only=True)
class LineEnergy:
    """The energy density along a line.

    Attributes:
        length: of the line [m].
        integral: of the density along the line [J/m]: what a strip around it holds per metre of its width.
        mean: integral / length [J/m2]; of a line without length, the mean of its vertices.
        peak: the highest density on the line [J/m2].
        peak_vertex: the vertex with that density.
    """

    length: float
    integral: float
    mean: float
    peak: float
    peak_vertex: int


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyPeak:
    """The place of the highest energy density.

    Attributes:
        vertex: the surface vertex.
        position: where it is [m].
        density: there [J/m2].
        lines: distance [m] from the peak to each feature line, nearest first.
        landmarks: distance [m] to each landmark, nearest first.
        words: the place as a sentence for a pattern maker.
    """

    vertex: int
    position: FloatArray
    density: float
    lines: Mapping[str, float]
    landmarks: Mapping[str, float]
    words: str


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyMap:
    """The energy distribution over a surface.

    Attributes:
        face_density: #F [J/m2].
        vertex_density: #V [J/m2], smoothed.
        total: the energy of the whole surface [J].
        regions: the energy of each named face set [J].
        lines: the energy along each feature line.
        peak: the place of the highest smoothed density.
    """

    face_density: FloatArray
    vertex_density: FloatArray
    total: float
    regions: Mapping[str, float]
    lines: Mapping[str, LineEnergy]
    peak: EnergyPeak


def energy_map(
    surface: Surface,
    face_density: ArrayLike,
    *,
    regions: Mapping[str, ArrayLike] | None = None,
    landmarks: Mapping[str, ArrayLike | int] | None = None,
    smoothing_length: float = 0.0,
    up: ArrayLike = (0.0, 1.0, 0.0),
) -> EnergyMap:
    """Map the energy of a piece: smoothed density, totals, and its peak.

    Args:
        surface: the surface the density belongs to.
        face_density: #F, strain energy per area of the 3D face [J/m2].
        regions: face sets by name (bricks, say): face indices, or #F booleans.
        landmarks: named places: vertex indices or positions [m].
        smoothing_length: see :func:`smooth_to_vertices` [m].
        up: the direction in which something is "above".

    Raises:
        InputError: for arrays of the wrong shape, values that are not finite, faces or landmarks that do not exist.
    """
    density = _checked_density(face_density, len(surface.faces), "face")
    at_vertices = smooth_to_vertices(surface, density, smoothing_length=smoothing_length)
    return EnergyMap(
        face_density=density,
        vertex_density=at_vertices,
        total=float(density @ _face_areas(surface)),
        regions=integrate_faces(surface, density, regions or {}),
        lines={name: integrate_along(surface, at_vertices, line) for name, line in surface.lines.items()},
        peak=energy_peak(surface, at_vertices, landmarks=landmarks, up=up),
    )


def energy_report(
    surface: Surface, face_energy: ArrayLike, *, regions: Mapping[str, ArrayLike] | None = None
) -> dict[str, Any]:
    """Describe the energy distribution of a piece, as in `metrics.json`.

    Args:
        surface: the surface the energies belong to.
        face_energy: #F, strain energy of each face [J].
        regions: face sets by name, bricks say.

    Returns:
        "peak" in words, per line its length and its mean and highest density, per region its joules.
    """
    areas = _face_areas(surface)
    density = np.asarray(face_energy, dtype=np.float64) / np.where(areas > 0.0, areas, np.inf)
    found = energy_map(surface, density, regions=regions)
    report: dict[str, Any] = {
        "peak": found.peak.words,
        "peak_j_per_m2": found.peak.density,
        "lines": {
            name: {"length_m": line.length, "mean_j_per_m2": line.mean, "peak_j_per_m2": line.peak}
            for name, line in found.lines.items()
        },
    }
    if regions:
        report["bricks"] = dict(found.regions)
    return report


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
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import cg, spsolve

    density = _checked_density(face_density, len(surface.faces), "face")
    if not (np.isfinite(smoothing_length) and smoothing_length >= 0):
        raise InputError(f"smoothing_length is a length in metres, 0 or more, got {smoothing_length!r}")
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
    from scipy.sparse import csr_array, diags_array

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


def integrate_faces(surface: Surface, face_density: ArrayLike, regions: Mapping[str, ArrayLike]) -> dict[str, float]:
    """Return the energy of named face sets [J].

    Args:
        surface: the surface.
        face_density: #F [J/m2].
        regions: face indices (each counted once), or #F booleans, by name.
    """
    energy = _checked_density(face_density, len(surface.faces), "face") * _face_areas(surface)
    totals = {}
    for name, chosen in regions.items():
        faces = np.asarray(chosen)
        if faces.dtype == bool:
            if faces.shape != energy.shape:
                raise InputError(f"region {name!r}: {faces.shape[0]} flags for {len(energy)} faces; give one per face")
            faces = np.flatnonzero(faces)
        faces = np.unique(faces).astype(np.int64)
        if len(faces) and (faces[0] < 0 or faces[-1] >= len(energy)):
            wrong = int(faces[0] if faces[0] < 0 else faces[-1])
            raise InputError(f"region {name!r}: face {wrong} does not exist; valid: 0 to {len(energy) - 1}")
        totals[name] = float(energy[faces].sum())
    return totals


def integrate_along(surface: Surface, vertex_density: ArrayLike, line: ArrayLike) -> LineEnergy:
    """Integrate the energy density along a line of vertices, linear between them.

    Args:
        surface: the surface.
        vertex_density: #V [J/m2].
        line: vertex indices in order, at least one; a closed line repeats its first.
    """
    density = _checked_density(vertex_density, len(surface.vertices), "vertex")
    vertices = np.asarray(line)
    if vertices.ndim != 1 or len(vertices) == 0:
        raise InputError(f"a line is a row of vertex indices, at least one, got shape {vertices.shape}")
    outside = np.flatnonzero((vertices < 0) | (vertices >= len(density)))
    if len(outside):
        raise InputError(f"line: vertex {int(vertices[outside[0]])} does not exist; valid: 0 to {len(density) - 1}")
    along = density[vertices]
    step = segment_lengths(surface.vertices[vertices])
    length = float(step.sum())
    integral = float((0.5 * (along[:-1] + along[1:]) * step).sum())
    highest = int(np.argmax(along))
    return LineEnergy(
        length=length,
        integral=integral,
        mean=integral / length if length > 0 else float(along.mean()),
        peak=float(along[highest]),
        peak_vertex=int(vertices[highest]),
    )


def energy_peak(
    surface: Surface,
    vertex_density: ArrayLike,
    *,
    landmarks: Mapping[str, ArrayLike | int] | None = None,
    up: ArrayLike = (0.0, 1.0, 0.0),
) -> EnergyPeak:
    """Return the vertex of highest density, and its place relative to the nearest lines and the nearest landmark.

    Distances are straight in space: near a line that is what a tape measures to less than a millimetre.

    Args:
        surface: the surface.
        vertex_density: #V [J/m2].
        landmarks: named places: vertex indices or positions [m].
        up: the direction in which something is "above".
    """
    density = _checked_density(vertex_density, len(surface.vertices), "vertex")
    if len(density) == 0:
        raise InputError("the surface has no vertices, so no peak")
    vertex = int(np.argmax(density))
    return _place(surface, vertex, float(density[vertex]), landmarks or {}, up)


def place_in_words(surface: Surface, vertex: int) -> str:
    """Describe the place of a vertex as a sentence for a pattern maker."""
    return _place(surface, vertex, 0.0, {}, (0.0, 1.0, 0.0)).words


def _place(
    surface: Surface, vertex: int, density: float, landmarks: Mapping[str, ArrayLike | int], up: ArrayLike
) -> EnergyPeak:
    """Return the place of a vertex with its density."""
    here = surface.vertices[vertex]
    upwards = np.asarray(up, dtype=float)
    norm = np.linalg.norm(upwards)
    if upwards.shape != (3,) or not np.isfinite(norm) or norm <= 0:
        raise InputError(f"up is a direction, three finite numbers, not all zero, got {up!r}")
    offsets = {name: nearest_on_polyline(here, surface.vertices[line]) - here for name, line in surface.lines.items()}
    marks = {}
    for name, place in landmarks.items():
        if isinstance(place, (int, np.integer)):
            count = len(surface.vertices)
            if not 0 <= place < count:
                raise InputError(f"landmark {name!r}: vertex {place} does not exist; valid: 0 to {count - 1}")
            marks[name] = surface.vertices[place]
            continue
        marks[name] = np.asarray(place, dtype=float)
        if marks[name].shape != (3,) or not np.isfinite(marks[name]).all():
            raise InputError(f"landmark {name!r} is a vertex index or three finite numbers [m], got {place!r}")
    to_lines = _by_distance({name: float(np.linalg.norm(offset)) for name, offset in offsets.items()})
    to_marks = _by_distance({name: float(np.linalg.norm(mark - here)) for name, mark in marks.items()})
    # For example "4 mm above bust line, 12 mm from princess front; 13 mm from bust point".
    phrases = []
    for name, distance in list(to_lines.items())[:2]:
        if distance < 1e-3:
            phrases.append(f"on {name}")
            continue
        rise = -float(offsets[name] @ upwards / norm) / distance
        # Within 45 degrees of the vertical a line lies above or below, else beside.
        side = "above" if rise > np.sqrt(0.5) else "below" if rise < -np.sqrt(0.5) else "from"
        phrases.append(f"{distance * 1e3:.0f} mm {side} {name}")
    words = ", ".join(phrases)
    if to_marks:
        name, distance = next(iter(to_marks.items()))
        mark = f"at {name}" if distance < 1e-3 else f"{distance * 1e3:.0f} mm from {name}"
        words = f"{words}; {mark}" if words else mark
    if not words:
        words = f"vertex {vertex} at ({', '.join(f'{x:.3f}' for x in here)}) m"
    return EnergyPeak(
        vertex=vertex,
        position=here.copy(),
        density=density,
        lines=to_lines,
        landmarks=to_marks,
        words=words,
    )


def _by_distance(distances: Mapping[str, float]) -> dict[str, float]:
    # Lines that are equally near, to the micrometre, stay in the surface's order.
    return dict(sorted(distances.items(), key=lambda item: round(item[1], 6)))


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


def _checked_density(values: ArrayLike, count: int, what: str) -> FloatArray:
    density = np.asarray(values, dtype=float)
    if density.shape != (count,):
        raise InputError(f"energy density: one value per {what} expected, {count} of them, got shape {density.shape}")
    wrong = np.flatnonzero(~np.isfinite(density))
    if len(wrong):
        raise InputError(f"energy density of {what} {int(wrong[0])} is not finite: {density[wrong[0]]}")
    return density


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
