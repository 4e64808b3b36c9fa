"""PLY, STL, GLB and glTF, read with trimesh, which cuts polygons into triangles."""

from __future__ import annotations

import io
import json
import logging
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.input_files import noting_resolver
from warpflat.flat.surface.io.gltf import gltf_notes, gltf_table, plain_gltf
from warpflat.flat.surface.io.raw_mesh import RawMesh, numbered, objects_in_turn

__all__ = ["GLTF", "read_with_trimesh"]


#: Kinds of glTF; an avatar in VRM is one with more in it.
GLTF = (".glb", ".gltf", ".vrm")


def read_with_trimesh(file: Path, *, node: str | None) -> RawMesh:
    """Read a file's meshes as one.

    Args:
        file: .ply, .stl, .glb or .gltf.
        node: the name of the one node of a scene to read; None for all.

    Raises:
        InputError: without the file's name: it cannot be read, has no such node, or no faces.
    """
    import trimesh

    suffix = file.suffix.lower()
    scene, materials, notes = _load_scene(file)
    meshes = list[_Instance]()
    for name in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[name]
        mesh = scene.geometry[geometry]
        if not isinstance(mesh, trimesh.Trimesh):
            continue
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        matrix = np.asarray(transform, dtype=np.float64)
        if not np.array_equal(matrix, np.eye(4)):
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
        faces = faces if np.linalg.det(matrix[:3, :3]) >= 0 else faces[:, ::-1]
        texture = np.full((len(vertices), 2), np.nan)
        given = np.asarray(mesh.vertex_attributes.get("_EXCOORD_0", texture))
        if given.shape == texture.shape and given.dtype.kind in "fiu":
            texture = given.astype(np.float64)
        meshes.append(_Instance(name, geometry, vertices, faces, texture))
    if node is not None:
        names = [one.node for one in meshes]
        meshes = [one for one in meshes if one.node == node]
        if not meshes:
            raise InputError(f"there is no mesh node {node!r}; {nearest(node, names)}")
    if not any(len(one.faces) for one in meshes):
        raise InputError(f"has no faces: not a mesh, or not a readable {suffix[1:].upper()} file")
    start = np.cumsum([0, *(len(one.vertices) for one in meshes)]).tolist()
    textured = suffix == ".ply" and any(
        getattr(getattr(geometry, "visual", None), "kind", None) == "texture" for geometry in scene.geometry.values()
    )
    total = sum(len(one.vertices) for one in meshes)
    elements = list[NDArray[np.int64]]()
    for geometry in scene.geometry.values() if suffix == ".ply" else ():
        # Trimesh leaves the edges that a PLY file lists as they are.
        data = geometry.metadata.get("_ply_raw", {}).get("edge", {}).get("data")
        with suppress(IndexError, KeyError, TypeError, ValueError):  # none, or under other names
            pairs = [np.asarray(data[end]).ravel() for end in ("vertex1", "vertex2")]
            elements.append(np.stack(pairs, axis=1).astype(np.int64))
    edges = np.concatenate([*elements, np.empty((0, 2), dtype=np.int64)])
    if len(edges) and not 0 <= edges.min() <= edges.max() < total:
        raise InputError(f"an edge refers to vertex {edges.max()}, but the file has {total:,}, numbered from 0")
    # A corner beyond the vertices is refused later, by its face.
    textures = [one.texture[np.minimum(one.faces, len(one.texture) - 1)] for one in meshes if len(one.faces)]
    texture = np.concatenate(textures)
    size = [len(one.faces) for one in meshes]
    number, material = numbered([materials.get(one.geometry, "") for one in meshes])
    nodes = tuple(one.node for one in meshes)
    polygons = np.concatenate([one.faces + at for one, at in zip(meshes, start, strict=False)])
    return RawMesh(
        vertices=np.concatenate([one.vertices for one in meshes]),
        polygons=polygons,
        scale=1.0 if suffix in GLTF else None,
        split_corners=suffix in (".stl", *GLTF) or textured,
        notes=notes,
        objects=objects_in_turn(nodes, start[:-1], polygons) if suffix in GLTF else None,
        marked=list(edges),
        texture=texture if np.isfinite(texture).any() else None,
        face_material=(np.repeat(number, size), material),
        face_group=(np.repeat(np.arange(len(meshes)), size), nodes),
    )


def _load_scene(file: Path) -> tuple[Any, dict[str, str], list[str]]:
    """Load a file with trimesh, whose log and warnings are silenced meanwhile.

    Returns the scene, the materials of its geometry, and what the file has beside it.
    """
    import trimesh

    suffix = file.suffix.lower()
    if suffix == ".ply":
        check_ply(file)
    elif suffix == ".stl":
        check_stl(file)
    # Textures are never opened.
    options = {} if suffix == ".stl" else {"skip_materials": True}
    options |= {"fix_texture": False} if suffix == ".ply" else {}
    # Its log goes nowhere, but to the handlers of a program that has its own.
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if suffix not in GLTF:
                return trimesh.load_scene(str(file), process=False, resolver=noting_resolver(file), **options), {}, []
            data = plain_gltf(file.read_bytes(), noting_resolver(file))
            binary = data[:4] == b"glTF"
            first, last = (20, 20 + int.from_bytes(data[12:16], "little")) if binary else (0, len(data))
            # Trimesh reads texture coordinates together with the pictures only; under this name they are an attribute like any other.
            head = data[first:last].replace(b'"TEXCOORD_0"', b'"_EXCOORD_0"')
            scene = trimesh.load_scene(
                io.BytesIO(data[:first] + head + data[last:]),
                file_type="glb" if binary else "gltf",
                process=False,
                resolver=noting_resolver(file),
                **options,
            )
            return scene, _materials(head, list(scene.geometry)), gltf_notes(gltf_table(data))
    except InputError:
        raise
    # Any error of a parser is the file's fault, of whatever type it is.
    except Exception as error:
        raise InputError(
            f"not a readable {suffix[1:].upper()} file: damaged, cut short, or with more in it than its reader knows; save it again with "
            "vertices and faces alone"
        ) from error


def _materials(head: bytes, geometry: list[str]) -> dict[str, str]:
    """Return the name of its material for each geometry that trimesh has made of a glTF file, in the order of its primitives."""
    try:
        table = json.loads(head)
        primitives = [
            one for mesh in table["meshes"] for one in mesh["primitives"] if one.get("mode", 4) in (0, 1, 4, 5)
        ]
        given = [one.get("material") for one in primitives]
        names = [
            None if of is None else str(table["materials"][of].get("name") or f"material_{of + 1}") for of in given
        ]
    # Names are extras: without them the file is what it was.
    except (AttributeError, IndexError, KeyError, RecursionError, TypeError, ValueError):
        return {}
    return {key: name for key, name in zip(geometry, names, strict=True) if name} if len(names) == len(geometry) else {}


class _Instance(NamedTuple):
    """A mesh at its place in a scene: world positions, triangles, and texture coordinates of vertices, nan where there are none."""

    node: str
    geometry: str
    vertices: FloatArray
    faces: NDArray[np.int64]
    texture: FloatArray


def check_ply(path: Path) -> None:
    """Check that an ASCII file has all rows that its header announces, each with all numbers of its lists.

    Trimesh checks the length of binary files, and refuses what is no header.

    Raises:
        InputError: without the file's name, but with the line's number.
    """
    head, found, body = path.read_bytes().partition(b"end_header")
    # Each element's name, its count, and which of its properties are lists.
    elements: list[tuple[str, int, list[bool]]] = []
    for line in head.decode("ascii", errors="replace").splitlines():
        words = line.split()
        if len(words) == 3 and words[0] == "element" and words[2].isdigit() and len(words[2]) < 12:
            elements.append((words[1], int(words[2]), []))
        elif len(words) > 1 and words[0] == "property" and elements:
            elements[-1][2].append(words[1] == "list")
    if not found or not elements or b"ascii" not in head:
        return
    rows = body.decode("ascii", errors="replace").splitlines()[1:]
    above = head.count(b"\n") + 2
    at = 0
    for name, count, properties in elements:
        if at + count > len(rows):
            raise InputError(
                f"is cut short: it holds {max(len(rows) - at, 0):,} of its {count:,} rows of element {name!r}"
            )
        for number in range(at, at + count):
            if (reason := _fault(rows[number].split(), properties)) is not None:
                raise InputError(f"line {above + number}: {rows[number].strip()[:40]!r} is no {name!r}: {reason}")
        at += count


def check_stl(path: Path) -> None:
    """Check that a binary file is as long as its number of triangles requires; trimesh checks the end of text files.

    Raises:
        InputError: without the file's name.
    """
    with path.open("rb") as file:
        head = file.read(1000)
    size = path.stat().st_size
    count = int.from_bytes(head[80:84], "little")
    if b"facet" not in head.lower() and size != 84 + 50 * count:
        raise InputError(
            f"not a readable STL file: {size:,} bytes long, but its header tells of {count:,} triangles of 50 bytes each"
        )


def _fault(words: list[str], properties: list[bool]) -> str | None:
    """Return what is wrong with a row, or None."""
    at = 0
    for is_list in properties:
        if at >= len(words):
            return f"{len(words)} numbers are too few"
        if is_list and not (words[at].isdigit() and len(words[at]) < 9):
            return f"{words[at][:20]!r} is not the length of a list"
        at += 1 + (int(words[at]) if is_list else 0)
    return None if at <= len(words) else f"its list is cut short, {at} numbers are needed"
