"""The layers of which a USD stage is composed are checked as the file itself is."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from warpflat.core.errors import InputError
from warpflat.core.input_files import FORMATS, listening_to_reads
from warpflat.core.usd_layers import check_layers
from warpflat.flat.surface.io.read import read_surface

MESH = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{
    def Mesh "front"
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    }
}
"""
ARCS = {
    "reference": 'def Xform "World" (\n    references = @{}@\n)\n{{\n}}\n',
    "payload": 'def Xform "World" (\n    payload = @{}@\n)\n{{\n}}\n',
    "variant": 'def Xform "World" (\n    variants = {{\n        string v = "a"\n    }}\n    prepend variantSets = "v"\n)\n{{\n'
    '    variantSet "v" = {{\n        "a" (\n            references = @{}@\n        ) {{\n        }}\n    }}\n}}\n',
}


def stage(folder: Path, arc: str, to: str) -> Path:
    head = '    defaultPrim = "World"\n    metersPerUnit = 1\n    upAxis = "Y"\n'
    head += f"    subLayers = [@{to}@]\n" if arc == "sublayer" else ""
    folder.mkdir(exist_ok=True)
    (folder / "stage.usda").write_text(f"#usda 1.0\n(\n{head})\n{ARCS.get(arc, '').format(to)}")
    return folder / "stage.usda"


@pytest.mark.parametrize("arc", ["reference", "payload", "variant", "sublayer"])
def test_a_layer_beside_it_is_read_and_known(arc: str, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in/mesh.usda").write_text(MESH)
    read: list[Path] = []
    with listening_to_reads(read.append):
        assert len(read_surface(stage(tmp_path / "in", arc, "./mesh.usda")).faces) == 1
    assert {path.name for path in read} == {"stage.usda", "mesh.usda"}


@pytest.mark.parametrize("arc", ["reference", "payload", "variant", "sublayer"])
def test_what_is_not_as_an_input_is_named(arc: str, tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "mesh.usda").write_text(MESH)
    (folder / "link.usda").symlink_to("../mesh.usda")
    os.mkfifo(folder / "pipe.usda")
    (folder / "noise.usda").write_text("no USD")
    for to, words in (
        ("../mesh.usda", "'../mesh.usda', which lies outside its folder"),
        (f"{tmp_path}/mesh.usda", "which lies outside its folder"),
        ("link.usda", "'link.usda', which lies outside its folder"),
        ("pipe.usda", "'pipe.usda', which is a pipe"),
        ("none.usda", "'none.usda', which is missing"),
        ("noise.usda", "'noise.usda', which is no readable USD file"),
    ):
        with pytest.raises(InputError, match=f"stage.usda refers to .*{words}"):
            read_surface(stage(folder, arc, to))


def test_layers_of_layers_are_checked_and_a_prim_that_is_missing_is_named(tmp_path: Path) -> None:
    (tmp_path / "mesh.usda").write_text(stage(tmp_path, "reference", "deeper.usda").read_text())
    with pytest.raises(InputError, match=r"mesh\.usda refers to 'deeper\.usda', which is missing"):
        read_surface(stage(tmp_path, "reference", "mesh.usda"))
    (tmp_path / "mesh.usda").write_text(MESH)
    file = stage(tmp_path, "reference", "mesh.usda")
    file.write_text(file.read_text().replace("@mesh.usda@", "@mesh.usda@</Nope>"))
    with pytest.raises(InputError, match="/World is not whole"):
        read_surface(file)


def test_values_in_clips_are_named(tmp_path: Path) -> None:
    clips = "clips = {\n        dictionary default = {\n            asset[] assetPaths = [@c.usda@]\n        }\n    }"
    file = tmp_path / "stage.usda"
    file.write_text(MESH.replace('def Mesh "front"', f'def Mesh "front" (\n    {clips}\n    )'))
    with pytest.raises(InputError, match="/World/front takes its values from clips"):
        read_surface(file)


def test_a_package_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pxr import UsdUtils

    (tmp_path / "mesh.usda").write_text(MESH)
    stage(tmp_path, "reference", "./mesh.usda")
    monkeypatch.chdir(tmp_path)
    assert UsdUtils.CreateNewUsdzPackage("stage.usda", "stage.usdz")
    for name in ("mesh.usda", "stage.usda"):
        (tmp_path / name).unlink()
    package = tmp_path / "stage.usdz"
    assert len(read_surface(package).faces) == 1
    # Its layers are parts of one file, which counts once.
    for share in (1.5, 0.5):
        most = replace(FORMATS["mesh"], most=int(share * package.stat().st_size))
        monkeypatch.setattr("warpflat.core.usd_layers.FORMATS", {"mesh": most})
        if share > 1.0:
            check_layers(package)
        else:
            with pytest.raises(InputError, match="which has"):
                check_layers(package)
