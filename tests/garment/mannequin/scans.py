"""The body scans of the tests, each read and measured once in a process."""

from __future__ import annotations

import functools
from unittest import mock

import numpy as np
import trimesh
from bodies import had_by_all
from body_copies import copy_of_body
from body_tapes import armpit_and_crotch
from real_files import DATA

from warpflat.flat.surface.io.read import read_scan
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.read_body import ReadBody, read_body
from warpflat.garment.mannequin.scan_pose import ScanOptions


@functools.cache
def scan(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices #V by 3 [m], feet at y = 0, and faces #F by 4 (-1 in the last column for a triangle)."""
    points, faces = read_scan(DATA / f"body_{name}.obj")
    points = np.asarray(points, float)
    return points - [0.0, points[:, 1].min(), 0.0], np.asarray(faces)


@functools.cache
def _read(name: str) -> ReadBody:
    return had_by_all(f"scan {name}".encode(), lambda: read_body(*scan(name), ScanOptions()))


@functools.cache
def scanned_body(name: str, resolution_mm: float = 20.0) -> Mannequin:
    """The mannequin on a scan as it is; the scan is measured once for all resolutions."""
    with mock.patch("warpflat.garment.mannequin.scan.read_body", return_value=_read(name)):
        return Mannequin.from_scan(*scan(name), resolution_mm=resolution_mm)


def triangles_of(faces: np.ndarray) -> np.ndarray:
    """Faces #F by 4 as triangles, quads split along their first diagonal."""
    return np.concatenate([faces[:, :3], faces[faces[:, 3] >= 0][:, [0, 2, 3]]]).astype(np.int64)


@functools.cache
def posed_scan(name: str, pose: str) -> np.ndarray:
    """Vertices [m] of a scan whose arms or legs were turned, by a name of `body_copies`."""
    points, faces = scan(name)
    marks = armpit_and_crotch(trimesh.Trimesh(points, triangles_of(faces), process=False))
    return copy_of_body(points, faces, pose, *marks)[0]


@functools.cache
def posed_body(name: str, pose: str) -> Mannequin:
    """The mannequin on a scan whose arms or legs were turned."""
    return Mannequin.from_scan(posed_scan(name, pose), scan(name)[1], resolution_mm=20.0)
