"""Coloured meshes for the browser: a glTF that another program reads, whose colours are shown as those of the scale."""

from __future__ import annotations

import io

import numpy as np
import trimesh

from warpflat.app.studio.glb import before_tone_mapping, coloured_mesh
from warpflat.pattern.export.colours import linear_rgb


def aces(colour: np.ndarray) -> np.ndarray:
    """The tone mapping of three.js, as its shader chunk `tonemapping_pars_fragment` has it."""
    into = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
    out = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
    v = into @ (colour / 0.6)
    return out @ ((v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081))


def test_a_mesh_is_read_back() -> None:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0.5]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    for lit in (True, False):
        data = coloured_mesh(positions, triangles, np.full((4, 3), 0.5), lit=lit)
        scene = trimesh.load(io.BytesIO(data), file_type="glb", process=False)
        (mesh,) = scene.geometry.values()
        np.testing.assert_allclose(mesh.vertices, positions, atol=1e-6)
        np.testing.assert_array_equal(mesh.faces, triangles)
        assert (b"KHR_materials_unlit" in data) is not lit


def test_colours_come_through_the_tone_mapping_as_they_were() -> None:
    colours = np.random.default_rng(4).uniform(0.05, 0.95, (50, 3))
    shown = np.array([aces(colour) for colour in before_tone_mapping(colours)])
    # What the display cannot show is clipped: strong colours lose a little.
    assert np.abs(shown - linear_rgb(colours)).max() < 0.03
    np.testing.assert_allclose(
        aces(before_tone_mapping(np.full((1, 3), 0.5))[0]), linear_rgb([[0.5] * 3])[0], atol=1e-5
    )
