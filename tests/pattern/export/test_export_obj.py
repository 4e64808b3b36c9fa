from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from export_meshes import cut_up_the_middle, dome, mixed

from warpflat.pattern.export.obj import write_obj


def read(path: Path) -> tuple[np.ndarray, np.ndarray, list[list[tuple[int, int]]]]:
    """v, vt and the corners (v, vt) of each face, from 0, as the file has them."""
    rows: dict[str, list[list[float]]] = {"v": [], "vt": []}
    faces = []
    for line in path.read_text().splitlines():
        word, *rest = line.split()
        if word in rows:
            rows[word].append([float(number) for number in rest])
        elif word == "f":
            faces.append([(int(corner.split("/")[0]) - 1, int(corner.split("/")[1]) - 1) for corner in rest])
    return np.array(rows["v"]), np.array(rows["vt"]), faces


def test_floats_read_back_identical(tmp_path: Path) -> None:
    shape = dome(9)
    rng = np.random.default_rng(1)
    flat = rng.standard_normal((81, 2)) * 10.0 ** rng.integers(-12, 6, (81, 2))
    write_obj(tmp_path / "a.obj", shape, flat)
    v, vt, faces = read(tmp_path / "a.obj")
    np.testing.assert_array_equal(v, shape.vertices)
    np.testing.assert_array_equal(vt, flat)
    np.testing.assert_array_equal(np.array(faces)[..., 0], shape.faces)


def test_quads_and_triangles_keep_their_order(tmp_path: Path) -> None:
    shape = mixed()
    write_obj(tmp_path / "a.obj", shape, shape.vertices[:, :2])
    _, _, faces = read(tmp_path / "a.obj")
    assert [[v for v, _ in face] for face in faces] == [[0, 1, 2, 3], [1, 4, 5], [1, 5, 2]]
    assert all(v == vt for face in faces for v, vt in face)


def test_a_cut_doubles_vt_and_not_v(tmp_path: Path) -> None:
    shape = dome(9)
    faces, to_surface, _ = cut_up_the_middle(shape, 9, 4)
    flat = shape.vertices[to_surface, :2]
    write_obj(tmp_path / "a.obj", shape, flat, faces=faces, pattern_to_surface=to_surface)
    v, vt, corners = read(tmp_path / "a.obj")
    assert len(v) == 81
    assert len(vt) == 85
    np.testing.assert_array_equal(np.array(corners)[..., 0], shape.faces)
    np.testing.assert_array_equal(np.array(corners)[..., 1], faces)


def test_v_is_the_input_in_its_order(tmp_path: Path) -> None:
    shape = dome(3)
    # As welding leaves it: the input has each vertex twice, shuffled.
    order = np.random.default_rng(0).permutation(18)
    doubled = np.concatenate([shape.vertices, shape.vertices])[order]
    index = np.array([np.flatnonzero(order % 9 == vertex)[0] for vertex in range(9)], dtype=np.int32)
    shape = dataclasses.replace(shape, input_vertices=doubled, input_index=index)
    write_obj(tmp_path / "a.obj", shape, shape.vertices[:, :2])
    v, _, faces = read(tmp_path / "a.obj")
    np.testing.assert_array_equal(v, doubled)
    np.testing.assert_array_equal(v[np.array(faces)[..., 0]], shape.vertices[shape.faces])


def test_trimesh_reads_it(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    shape = dome(5)
    write_obj(tmp_path / "a.obj", shape, shape.vertices[:, :2])
    mesh = trimesh.load(tmp_path / "a.obj", process=False)
    assert len(mesh.faces) == 2 * len(shape.faces)
    np.testing.assert_allclose(mesh.visual.uv, mesh.vertices[:, :2], atol=1e-12)


def test_arrays_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    shape = dome(3)
    flat = shape.vertices[:, :2]
    with pytest.raises(ValueError, match="#P by 2"):
        write_obj(tmp_path / "a.obj", shape, shape.vertices)
    with pytest.raises(ValueError, match="beyond the 8 positions"):
        write_obj(tmp_path / "a.obj", shape, flat[:8])
    with pytest.raises(ValueError, match="one per position"):
        write_obj(tmp_path / "a.obj", shape, flat, pattern_to_surface=[0])
    assert list(tmp_path.iterdir()) == []
