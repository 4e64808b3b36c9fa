"""Surfaces in space: reading and mending them, asking how they hang together, feature lines, distances on them."""

from __future__ import annotations

from warpflat.surface.border import line_on_border
from warpflat.surface.geodesic import distance_from, extend_to_border, signed_distance_and_station
from warpflat.surface.lines import line_between, line_from_curve, line_from_indices, line_on_plane, with_lines
from warpflat.surface.mend import make_surface
from warpflat.surface.mesh import Surface
from warpflat.surface.read import read_surface
from warpflat.surface.slivers import degenerate_faces, merge_degenerate_faces
from warpflat.surface.topology import (
    border_edges,
    border_loops,
    components,
    corner_triangles,
    edge_faces,
    euler_characteristic,
    half_edges,
    mesh_edges,
    non_manifold_edges,
    non_manifold_vertices,
    orient,
    triangulate,
    unfold_quad_diagonals,
)
from warpflat.surface.untangle import untangle

__all__ = [
    "Surface",
    "border_edges",
    "border_loops",
    "components",
    "corner_triangles",
    "degenerate_faces",
    "distance_from",
    "edge_faces",
    "euler_characteristic",
    "extend_to_border",
    "half_edges",
    "line_between",
    "line_from_curve",
    "line_from_indices",
    "line_on_border",
    "line_on_plane",
    "make_surface",
    "merge_degenerate_faces",
    "mesh_edges",
    "non_manifold_edges",
    "non_manifold_vertices",
    "orient",
    "read_surface",
    "signed_distance_and_station",
    "triangulate",
    "unfold_quad_diagonals",
    "untangle",
    "with_lines",
]
