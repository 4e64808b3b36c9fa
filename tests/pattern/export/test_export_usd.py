from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_meshes import cut_up_the_middle, dome, mixed
from usd_validation import validate_usd

import warpflat
from warpflat.core.errors import InputError
from warpflat.pattern.export.colours import energy_colours, linear_rgb
from warpflat.pattern.export.usd import FrameWriter, film_scale

# A child finds the package and the helpers where this process found them.
FOUND = {
    **os.environ,
    "PYTHONPATH": os.pathsep.join(map(str, (Path(warpflat.__file__).parents[1], Path(__file__).parents[2]))),
}


def open_stage(path: Path) -> Any:
    from pxr import Usd

    return Usd.Stage.Open(str(path))


def mesh_at(stage: Any, path: str) -> Any:
    from pxr import UsdGeom

    return UsdGeom.Mesh(stage.GetPrimAtPath(path))


def pieces_of(stage: Any) -> list[Any]:
    from pxr import Kind, Usd

    return [
        prim for prim in stage.GetDefaultPrim().GetChildren() if Usd.ModelAPI(prim).GetKind() == Kind.Tokens.component
    ]


def density_of(mesh: Any, time: float) -> np.ndarray:
    return np.asarray(mesh.GetPrim().GetAttribute("primvars:strainEnergyDensity").Get(time))


def test_numbers_read_back_as_written(tmp_path: Path) -> None:
    shape = dome(9)
    rng = np.random.default_rng(0)
    frames = [(rng.standard_normal((81, 2)), rng.random(64)) for _ in range(5)]
    with FrameWriter(tmp_path / "frames.usdc", save_every=2, scale=1.0) as writer:
        writer.add_piece("dome", shape)
        numbers = [
            writer.write(
                "dome", positions=flat, face_energy_density=density, measures={"strain_energy_j": density.sum()}
            )
            for flat, density in frames
        ]
    assert numbers == [1, 2, 3, 4, 5]
    stage = open_stage(tmp_path / "frames.usdc")
    surface, pattern = mesh_at(stage, "/World/dome/dome_surface"), mesh_at(stage, "/World/dome/dome_pattern")
    np.testing.assert_array_equal(np.asarray(surface.GetPointsAttr().Get()), shape.vertices.astype(np.float32))
    assert pattern.GetPointsAttr().GetTimeSamples() == [1.0, 2.0, 3.0, 4.0, 5.0]
    for number, (flat, density) in zip(numbers, frames, strict=True):
        points = np.asarray(pattern.GetPointsAttr().Get(number))
        np.testing.assert_array_equal(points[:, :2], flat.astype(np.float32))
        assert not points[:, 2].any()
        np.testing.assert_array_equal(
            np.asarray(pattern.GetExtentAttr().Get(number)), [points.min(axis=0), points.max(axis=0)]
        )
        for mesh in (surface, pattern):
            np.testing.assert_array_equal(density_of(mesh, number), density.astype(np.float32))
        energy = stage.GetPrimAtPath("/World/dome").GetAttribute("warpflat:strain_energy_j")
        assert energy.Get(number) == density.sum()
    indices = np.asarray(pattern.GetFaceVertexIndicesAttr().Get(3)).reshape(-1, 4)
    np.testing.assert_array_equal(indices, shape.faces)
    # A reader that knows no time gets the end.
    np.testing.assert_array_equal(np.asarray(pattern.GetPointsAttr().Get())[:, :2], frames[-1][0].astype(np.float32))


def test_stage_says_what_it_is(tmp_path: Path) -> None:
    from pxr import Kind, Usd, UsdGeom

    shape = mixed()
    with FrameWriter(tmp_path / "frames.usdc", scale=1.0) as writer:
        writer.add_piece("Ärmel links", shape)
        for _ in range(3):
            writer.write("Ärmel links", positions=shape.vertices[:, :2], face_energy_density=np.ones(3))
    stage = open_stage(tmp_path / "frames.usdc")
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (1, 3, 24)
    assert stage.GetDefaultPrim().GetPath() == "/World"
    (piece,) = pieces_of(stage)
    assert piece.GetDisplayName() == "Ärmel links"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == Kind.Tokens.assembly
    assert Usd.ModelAPI(piece).GetKind() == Kind.Tokens.component
    pattern = mesh_at(stage, f"{piece.GetPath()}/{piece.GetName()}_pattern")
    assert pattern.GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none
    assert pattern.GetOrientationAttr().Get() == UsdGeom.Tokens.rightHanded
    assert list(pattern.GetFaceVertexCountsAttr().Get(2)) == [4, 3, 3]
    np.testing.assert_array_equal(np.asarray(pattern.GetNormalsAttr().Get(1)), [[0, 0, 1]] * 3)
    assert UsdGeom.PrimvarsAPI(pattern).GetPrimvar("strainEnergyDensity").GetInterpolation() == UsdGeom.Tokens.uniform


def test_colours_have_one_scale_over_time_and_pieces(tmp_path: Path) -> None:
    shape = dome(5)
    flat = shape.vertices[:, :2]
    scale = film_scale([shape, shape], [np.full(16, 2.0), np.full(16, 1.0)])
    with FrameWriter(tmp_path / "frames.usdc", scale=scale) as writer:
        for name, first, last in (("front", 8.0, 2.0), ("back", 4.0, 1.0)):
            writer.add_piece(name, shape)
            writer.write(name, positions=flat, face_energy_density=np.full(16, first))
            writer.write(name, positions=flat, face_energy_density=np.full(16, last))
    stage = open_stage(tmp_path / "frames.usdc")
    expected = {("front", 1): 1.0, ("front", 2): 1.0, ("back", 1): 1.0, ("back", 2): 0.5}
    for (name, frame), share in expected.items():
        for kind in ("surface", "pattern"):
            colour = mesh_at(stage, f"/World/{name}/{name}_{kind}").GetDisplayColorPrimvar()
            assert colour.GetAttr().GetCustomData()["rangeMax"] == 2.0
            np.testing.assert_allclose(
                np.asarray(colour.ComputeFlattened(frame)),
                np.tile(linear_rgb(energy_colours(share, 1.0)), (25, 1)),
                atol=2e-3,
            )


def boxes(path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    """World boxes of all meshes over all frames."""
    from pxr import Usd, UsdGeom

    stage = open_stage(path)
    result = []
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            ranges = [
                UsdGeom.Imageable(prim).ComputeWorldBound(Usd.TimeCode(t), "default").ComputeAlignedRange()
                for t in range(1, int(stage.GetEndTimeCode()) + 1)
            ]
            result.append((np.min([r.GetMin() for r in ranges], axis=0), np.max([r.GetMax() for r in ranges], axis=0)))
    return result


def test_surfaces_and_patterns_lie_side_by_side(tmp_path: Path) -> None:
    front = dome(5)
    with FrameWriter(tmp_path / "frames.usdc", scale=1.0) as writer:
        writer.add_piece("front", front)
        for size in (1.0, 3.0, 0.5):
            writer.write("front", positions=front.vertices[:, :2] * size - 1.0, face_energy_density=np.ones(16))
        writer.add_piece("sleeve", mixed())
        writer.write("sleeve", positions=mixed().vertices[:, :2], face_energy_density=np.ones(3))
    front_surface, front_pattern, sleeve_surface, sleeve_pattern = boxes(tmp_path / "frames.usdc")
    surfaces = max(front_surface[1][0], sleeve_surface[1][0])
    assert front_pattern[0][0] > surfaces + 0.01
    assert sleeve_pattern[0][0] > surfaces + 0.01
    apart = np.maximum(sleeve_pattern[0] - front_pattern[1], front_pattern[0] - sleeve_pattern[1])
    assert apart[:2].max() > 0.01
    np.testing.assert_allclose(front_surface[0], front.vertices.min(axis=0), atol=1e-7)


def test_a_viewer_finds_cameras_light_material_and_texture(tmp_path: Path) -> None:
    from pxr import UsdGeom, UsdLux, UsdShade

    cut_film(tmp_path / "frames.usdc")
    stage = open_stage(tmp_path / "frames.usdc")
    last = stage.GetEndTimeCode()
    assert [prim.GetName() for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)] == ["all", "patterns"]
    # A sun of 2 degrees gives a thousandth of its light where it is not normalised: a black picture.
    (sun,) = [UsdLux.DistantLight(prim) for prim in stage.Traverse() if prim.IsA(UsdLux.DistantLight)]
    assert sun.GetNormalizeAttr().Get() is True
    assert sun.GetIntensityAttr().Get() * 2.0 ** sun.GetExposureAttr().Get() > 1.0
    pattern, surface = mesh_at(stage, "/World/front/front_pattern"), mesh_at(stage, "/World/front/front_surface")
    corners = np.asarray(pattern.GetPointsAttr().Get(last))[np.asarray(pattern.GetFaceVertexIndicesAttr().Get(last))]
    for mesh in (pattern, surface):
        assert UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0].GetPath() == "/World/Looks/energy"
        np.testing.assert_array_equal(np.asarray(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get()), corners[:, :2])
    lines = UsdGeom.Imageable(stage.GetPrimAtPath("/World/front/front_pattern_lines/bust_line"))
    assert lines.ComputePurpose() == UsdGeom.Tokens.guide
    cache = UsdGeom.BBoxCache(last, [UsdGeom.Tokens.default_])
    box = cache.ComputeWorldBound(stage.GetDefaultPrim()).ComputeAlignedRange()
    frustum = UsdGeom.Camera(stage.GetPrimAtPath("/World/cameras/all")).GetCamera(last).frustum
    assert all(frustum.Intersects(box.GetCorner(number)) for number in range(8))


def cut_film(path: Path) -> tuple[np.ndarray, np.ndarray, list[list[int]]]:
    """Whole; then cut; then the same cut in another numbering, so that the number of points stays."""
    shape = dome(9)
    flat = shape.vertices[:, :2]
    faces, to_surface, crack = cut_up_the_middle(shape, 9, 4)
    shuffled = np.random.default_rng(3).permutation(len(to_surface))
    renumbered = np.argsort(shuffled).astype(np.int32)
    density = np.linspace(0.0, 1.0, 64)
    with FrameWriter(path, scale=1.0) as writer:
        writer.add_piece("front", shape)
        writer.write("front", positions=flat, face_energy_density=density)
        writer.write("front", positions=1.1 * flat, face_energy_density=density)
        cut = flat[to_surface]
        writer.write("front", positions=cut, face_energy_density=density, faces=faces, cuts={"waist dart": crack})
        writer.write("front", positions=1.2 * cut, face_energy_density=density)
        lines = {name: renumbered[line] for name, line in shape.lines.items()}
        cuts = {"waist dart": [renumbered[side] for side in crack]}
        again = {"faces": renumbered[faces], "lines": lines, "cuts": cuts}
        writer.write("front", positions=cut[shuffled], face_energy_density=density, **again)
        writer.write("front", positions=1.3 * cut[shuffled], face_energy_density=density, cuts={})
    return faces, cut, crack


def test_validators_and_topology_pass_on_every_frame(tmp_path: Path) -> None:
    cut_film(tmp_path / "frames.usdc")
    assert validate_usd(tmp_path / "frames.usdc") == []


def test_validation_finds_what_is_wrong(tmp_path: Path) -> None:
    from pxr import Vt

    cut_film(tmp_path / "frames.usdc")
    stage = open_stage(tmp_path / "frames.usdc")
    mesh = mesh_at(stage, "/World/front/front_pattern")
    mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray([999] * 256), 3)
    mesh.GetPointsAttr().Set(Vt.Vec3fArray([9.0 * point for point in mesh.GetPointsAttr().Get(4)]), 4)
    mesh.GetDisplayColorAttr().Set(Vt.Vec3fArray([(0.0, 0.0, 0.0)] * 3), 2)
    stage.ClearDefaultPrim()
    stage.Export(str(tmp_path / "bad.usdc"))
    messages = "\n".join(validate_usd(tmp_path / "bad.usdc"))
    assert "Out of range face vertex index 999" in messages
    assert "displayColor needs 81 values, has 3" in messages
    assert "extent does not hold the points" in messages
    try:
        from pxr import UsdValidation  # noqa: F401
    except ImportError:
        pytest.skip("this build of USD has no UsdValidation")
    assert "MissingDefaultPrim" in messages


def test_validation_finds_points_that_run_across_a_change(tmp_path: Path) -> None:
    from pxr import Vt

    with FrameWriter(tmp_path / "a.usdc", scale=1.0) as writer:
        shape = dome(3)
        writer.add_piece("front", shape)
        for size in (1.0, 2.0):
            writer.write("front", positions=size * shape.vertices[:, :2], face_energy_density=np.ones(4))
    stage = open_stage(tmp_path / "a.usdc")
    indices = mesh_at(stage, "/World/front/front_pattern").GetFaceVertexIndicesAttr()
    indices.Set(Vt.IntArray(list(indices.Get(1))[::-1]), 2)
    stage.Export(str(tmp_path / "bad.usdc"))
    assert any("interpolated across it" in message for message in validate_usd(tmp_path / "bad.usdc"))


def test_validation_of_a_file_that_is_not_usd(tmp_path: Path) -> None:
    (tmp_path / "a.usdc").write_bytes(b"noise")
    with pytest.raises(InputError, match="not a USD file"):
        validate_usd(tmp_path / "a.usdc")


@pytest.mark.parametrize(("before", "after"), [(2, 3), (4, 5)])
def test_fractional_frames_hold_across_a_change_of_topology(tmp_path: Path, before: int, after: int) -> None:
    cut_film(tmp_path / "frames.usdc")
    stage = open_stage(tmp_path / "frames.usdc")
    pattern = mesh_at(stage, "/World/front/front_pattern")

    def corners(time: float) -> np.ndarray:
        """What is drawn: the corners of each face."""
        points = np.asarray(pattern.GetPointsAttr().Get(time))
        return points[np.asarray(pattern.GetFaceVertexIndicesAttr().Get(time))]

    for time in (before + 0.01, before + 0.5, before + 0.99):
        np.testing.assert_array_equal(corners(time), corners(before))
    assert np.abs(corners(after) - corners(before)).max() > 0.01
    # Elsewhere frames are blended.
    np.testing.assert_allclose(corners(3.5), 0.5 * (corners(3) + corners(4)), atol=1e-7)
    lines = stage.GetPrimAtPath("/World/front/front_pattern_lines/bust_line").GetAttribute("points")
    np.testing.assert_array_equal(np.asarray(lines.Get(before + 0.5)), np.asarray(lines.Get(before)))


def test_drawn_faces_are_those_given_whatever_the_numbering(tmp_path: Path) -> None:
    faces, cut, _ = cut_film(tmp_path / "frames.usdc")
    stage = open_stage(tmp_path / "frames.usdc")
    pattern = mesh_at(stage, "/World/front/front_pattern")
    for time, size in ((3, 1.0), (4, 1.2), (5, 1.0), (6, 1.3)):
        points = np.asarray(pattern.GetPointsAttr().Get(time))
        drawn = points[np.asarray(pattern.GetFaceVertexIndicesAttr().Get(time))][:, :2]
        np.testing.assert_allclose(drawn, (size * cut)[faces].reshape(-1, 2), atol=1e-7)


def test_lines_follow_the_mesh_and_cuts_show_while_they_exist(tmp_path: Path) -> None:
    from pxr import UsdGeom

    _, cut, crack = cut_film(tmp_path / "frames.usdc")
    stage = open_stage(tmp_path / "frames.usdc")
    shape = dome(9)
    on_surface = stage.GetPrimAtPath("/World/front/front_surface_lines/centre_front")
    assert on_surface.GetDisplayName() == "centre front"
    np.testing.assert_allclose(
        np.asarray(on_surface.GetAttribute("points").Get()), shape.vertices[shape.lines["centre front"]], atol=1e-7
    )
    for place in ("surface_cuts", "pattern_cuts"):
        dart = UsdGeom.BasisCurves(stage.GetPrimAtPath(f"/World/front/front_{place}/waist_dart"))
        seen = [dart.ComputeVisibility(time) for time in (1, 2, 2.5, 3, 4, 5, 5.5, 6)]
        assert seen == ["invisible"] * 3 + ["inherited"] * 4 + ["invisible"]
    counts = list(dart.GetCurveVertexCountsAttr().Get(3))
    assert counts == [5, 5]
    points = np.asarray(dart.GetPointsAttr().Get(4))[:, :2]
    np.testing.assert_allclose(points, 1.2 * cut[np.concatenate(crack)], atol=1e-7)


def test_names_stay_apart(tmp_path: Path) -> None:
    shape = mixed()
    with FrameWriter(tmp_path / "a.usdc", scale=1.0) as writer:
        for name in ("1 a", "1_a", "_1a"):
            writer.add_piece(name, shape)
        with pytest.raises(ValueError, match="already"):
            writer.add_piece("1 a", shape)
    stage = open_stage(tmp_path / "a.usdc")
    assert len({prim.GetName() for prim in pieces_of(stage)}) == 3


def test_arrays_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    shape = dome(5)
    flat, density = shape.vertices[:, :2], np.ones(16)
    with FrameWriter(tmp_path / "a.usdc", scale=1.0) as writer:
        writer.add_piece("front", shape)
        with pytest.raises(ValueError, match="energy densities for 16 faces"):
            writer.write("front", positions=flat, face_energy_density=density[:3])
        with pytest.raises(ValueError, match="24 positions for 25"):
            writer.write("front", positions=flat[:24], face_energy_density=density)
        with pytest.raises(ValueError, match="not finite"):
            writer.write("front", positions=flat * np.nan, face_energy_density=density)
        with pytest.raises(ValueError, match="not those of the surface"):
            writer.write("front", positions=flat, face_energy_density=density, faces=shape.faces[:3])
        with pytest.raises(ValueError, match="two vertices of the surface"):
            writer.write("front", positions=flat, face_energy_density=density, faces=np.zeros_like(shape.faces))
        with pytest.raises(ValueError, match="line 'a'"):
            writer.write("front", positions=flat, face_energy_density=density, lines={"a": [0, 25]})


def test_an_exception_leaves_nothing(tmp_path: Path) -> None:
    shape = dome(5)

    def diverge() -> None:
        with FrameWriter(tmp_path / "a.usdc", save_every=1, scale=1.0) as writer:
            writer.add_piece("front", shape)
            writer.write("front", positions=shape.vertices[:, :2], face_energy_density=np.ones(16))
            raise RuntimeError("diverged")

    with pytest.raises(RuntimeError, match="diverged"):
        diverge()
    assert os.listdir(tmp_path) == []


def test_a_folder_that_vanishes_is_one_line(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    shape = dome(5)

    def write() -> None:
        with FrameWriter(folder / "a.usdc", scale=1.0) as writer:
            writer.add_piece("front", shape)
            writer.write("front", positions=shape.vertices[:, :2], face_energy_density=np.ones(16))
            shutil.rmtree(folder)

    with pytest.raises(InputError, match="cannot write") as failure:
        write()
    assert "\n" not in str(failure.value)


STREAM = """
import sys
import numpy as np
from export_meshes import dome
from warpflat.pattern.export.usd import FrameWriter

def anonymous():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("RssAnon")) / 1024

path, count, stop = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "stop"
shape = dome(71)
with FrameWriter(path, save_every=8, scale=1.0) as writer:
    writer.add_piece("front", shape)
    rng = np.random.default_rng(0)
    before = anonymous()
    for frame in range(count):
        writer.write("front", positions=rng.random((5041, 2)), face_energy_density=rng.random(4900))
    if stop:
        print("writing", flush=True)
        sys.stdin.read()
print(anonymous() - before)
"""


def test_a_killed_run_leaves_no_file_under_the_final_name(tmp_path: Path) -> None:
    command = [sys.executable, "-c", STREAM, str(tmp_path / "frames.usdc"), "20", "stop"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, env=FOUND, text=True, **pipes) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "writing\n"
        process.send_signal(signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
    assert not (tmp_path / "frames.usdc").exists()
    assert all(name.startswith(".") for name in os.listdir(tmp_path))


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc to tell a process's own memory")
def test_memory_does_not_grow_with_the_number_of_frames(tmp_path: Path) -> None:
    grown = []
    for count in (60, 240):
        command = [sys.executable, "-c", STREAM, str(tmp_path / f"{count}.usdc"), str(count), "go"]
        done = subprocess.run(command, env=FOUND, text=True, capture_output=True, check=True)
        grown.append(float(done.stdout))
    # 180 frames more are 50 MB of points, energies and colours.
    assert grown[1] < grown[0] + 6.0
