from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.fabric.fabric import DEFAULT_FABRIC, GRADES, Fabric, value_names
from warpflat.flat.fabric.instruments import (
    FAST_LOADS,
    curve_from_fast,
    curve_from_kes,
    shear_stiffness_from_fast,
    shear_stiffness_from_kes,
    stiffness_from_extension,
)
from warpflat.flat.fabric.library import find_fabric, load_library

MEASURED = ("areal_density", "stiffness_warp", "stiffness_weft", "shear_stiffness")


def cloth(**changes: object) -> Fabric:
    values: dict = {
        "name": "cloth",
        "stiffness_warp": 2000.0,
        "stiffness_weft": 1000.0,
        "shear_stiffness": 30.0,
        "areal_density": 0.15,
    }
    return Fabric(**(values | changes))


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text)
    return path


# --- the library


def test_the_library_holds_the_entries_of_the_literature_table():
    expected = {
        "denim": (0.324, 411, 2028, 27),
        "trousers": (0.220, 4033, 4070, 52),
        "tablecloth": (0.128, 4004, 4055, 10),
        "jacket": (0.113, 86, 343, 7),
        "interlock": (0.187, 33, 69, 18),
        "rib": (0.276, 86, 130, 42),
        "swim": (0.204, 96, 209, 30),
        "ponte": (0.284, 62, 88, 16),
        "wool-plain": (0.168, 2130, 1670, 26.2),
    }
    library = load_library()
    for name, values in expected.items():
        fabric = library[name]
        assert tuple(getattr(fabric, key) for key in MEASURED) == pytest.approx(values)
    estimated = {"paper", "linen", "silk", "satin", "power-net", "neoprene", "leather"}
    second_hand = {"wool-suiting", "cotton", "stretch-twill"}
    assert set(expected) | estimated | second_hand | {"woven", "isotropic"} == set(library)
    for name in estimated:
        for key in ("stiffness_warp", "stiffness_weft", "areal_density"):
            assert library[name].provenance[key].is_estimate


@pytest.mark.parametrize("fabric", load_library().values(), ids=lambda fabric: fabric.name)
def test_every_shipped_value_says_where_it_comes_from(fabric: Fabric):
    assert set(MEASURED) | {"strain_limit", "shear_limit", "bending"} <= set(fabric.provenance)
    assert fabric.description
    for key, origin in fabric.provenance.items():
        assert origin.source not in ("", "not stated"), key
        assert origin.unit, key
        assert origin.grade in GRADES, key
        assert (origin.grade == "E") == origin.source.startswith("estimate"), key
        if key not in ("areal_density", "strain_limit", "poisson_ratio"):
            assert origin.test_load, key
        if origin.spread is not None:
            assert origin.spread[0] < getattr(fabric, key) < origin.spread[1], key


def test_woven_is_the_measured_wool_plain_weave_balanced():
    fabric = find_fabric("woven")
    wool = find_fabric("wool-plain")
    assert fabric.stiffness_warp == fabric.stiffness_weft == (wool.stiffness_warp + wool.stiffness_weft) / 2
    assert fabric.shear_stiffness == wool.shear_stiffness
    estimated = {key for key, origin in fabric.provenance.items() if origin.is_estimate}
    assert estimated <= {"shear_limit"}


def test_the_default_fabric_is_shipped():
    assert DEFAULT_FABRIC in load_library()


@pytest.mark.parametrize("name", ["isotropic", "neoprene", "leather", "paper"])
def test_isotropic_fabrics_obey_the_isotropic_relation(name: str):
    fabric = find_fabric(name)
    assert fabric.stiffness_warp == fabric.stiffness_weft
    relation = fabric.stiffness_warp / (2 * (1 + fabric.poisson_ratio))
    assert fabric.shear_stiffness == pytest.approx(relation, rel=1e-3)


def test_only_isotropic_fabrics_are_isotropic():
    isotropic = [name for name, fabric in load_library().items() if fabric.is_isotropic]
    assert isotropic == ["isotropic", "paper", "neoprene", "leather"]
    assert not cloth(stiffness_warp=1000.0, shear_stiffness=490.0).is_isotropic
    assert cloth(stiffness_warp=1000.0, shear_stiffness=500.0).is_isotropic
    assert not cloth(stiffness_warp=1010.0, shear_stiffness=500.0).is_isotropic


def test_a_limit_of_shear_that_nobody_gave_is_an_estimate_by_kind(tmp_path: Path):
    assert cloth().shear_limit == 15.0
    assert cloth().provenance["shear_limit"].is_estimate
    knit = cloth(strain_limit=0.15)
    # Threads of unit length at 90 degrees less the limit: their bisector's diagonal grows by the strain limit.
    diagonal = 2.0 * math.cos(math.radians(90.0 - knit.shear_limit) / 2.0)
    assert diagonal / math.sqrt(2.0) == pytest.approx(1.15)
    assert cloth(strain_limit=1.0).shear_limit == 80.0
    assert find_fabric("paper").shear_limit < 1.0
    file = '[a]\nbase = "interlock"\nstrain_limit = 0.25\n[b]\nbase = "denim"\nstrain_limit = 0.04\n'
    of_base = load_library([write(tmp_path, file)])
    assert of_base["a"].shear_limit == cloth(strain_limit=0.25).shear_limit
    assert of_base["b"].shear_limit == find_fabric("denim").shear_limit
    allowed = find_fabric("woven").allowing(8.0)
    assert (allowed.shear_limit, allowed.provenance["shear_limit"].source) == (8.0, "asked for")
    assert allowed.strain_limit == find_fabric("woven").strain_limit
    with pytest.raises(
        InputError, match="says nothing of paper, an isotropic sheet, which has no threads; take a cloth"
    ):
        find_fabric("paper").allowing(8.0)
    given = cloth(strain_limit=0.15, shear_limit=9.0)
    assert given.shear_limit == 9.0
    assert "shear_limit" not in given.provenance


def test_names_and_aliases_are_found_as_people_type_them():
    assert find_fabric("Power Net").name == "power-net"
    assert find_fabric("WOOL_plain").name == "wool-plain"
    jersey, interlock = find_fabric("Jersey"), find_fabric("interlock")
    assert (jersey.name, jersey.aliases) == ("jersey", ("interlock", "t-shirt"))
    assert replace(jersey, name=interlock.name, aliases=interlock.aliases) == interlock
    with pytest.raises(InputError, match=r"^unknown fabric 'demin': did you mean 'denim'\? valid: cotton, denim"):
        find_fabric("demin")


# --- what no cloth can be


@pytest.mark.parametrize("key", [*MEASURED, "strain_limit", "compression_factor"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, None, "2000", True])
def test_impossible_values_are_refused_by_name(key: str, value: object):
    with pytest.raises(InputError, match=f"^fabric 'cloth': {key} .*(must lie between|is not a number)"):
        cloth(**{key: value})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shear_stiffness": 1200.0}, "shear_stiffness = 1200 N/m is more than the softer tensile stiffness, 1000 N/m"),
        (
            {"areal_density": 1000.0},
            r"areal_density = 1000 kg/m2 is out of range; .* 5 kg/m2 \(if that is in g/m2, write 1\)",
        ),
        ({"strain_limit": 5.0}, r"strain_limit = 5 .* \(if that is in percent, write 0.05\)"),
        ({"shear_limit": 0.26}, r"shear_limit = 0.26 degrees .* \(if that is in radians, write 14.9\)"),
        ({"shear_limit": 90.0}, "shear_limit = 90 degrees is out of range; must lie between 0.5 and 80 degrees"),
        ({"poisson_ratio": -0.1}, "poisson_ratio = -0.1 is out of range; must lie between 0 and 0.99"),
        ({"poisson_ratio": 0.8, "stiffness_warp": 500.0}, r"poisson_ratio = 0.8 .* must be below .* = 0.707"),
        ({"curve_warp": ((0.1, 5.0), (0.05, 9.0))}, r"curve_warp\[1\] = \(0.05, 9\) does not rise"),
        ({"curve_weft": ((0.1, math.nan),)}, r"curve_weft\[0\]"),
    ],
)
def test_absurd_values_are_refused_with_what_would_be_right(changes: dict, message: str):
    with pytest.raises(InputError, match=message) as caught:
        cloth(**changes)
    assert "\n" not in str(caught.value)


# --- curves


def test_tension_follows_the_curve_and_goes_on_beyond_it():
    fabric = cloth(curve_warp=((0.01, 5.0), (0.03, 45.0)), compression_factor=0.1)
    np.testing.assert_allclose(fabric.tension([0.0, 0.005, 0.02, 0.03, 0.04]), [0.0, 2.5, 25.0, 45.0, 65.0])
    np.testing.assert_allclose(fabric.tension([-0.01]), [-0.1 * 2000.0 * 0.01])
    np.testing.assert_allclose(fabric.tension([-0.01, 0.02], "weft"), [-1.0, 20.0])
    with pytest.raises(InputError, match="did you mean 'weft'"):
        fabric.tension(0.0, "wefft")  # type: ignore[arg-type]


def test_shipped_curves_meet_the_measured_secants():
    jacket = find_fabric("jacket")
    assert float(jacket.tension(0.167, "weft")) == pytest.approx(810 * 0.167)
    # Secants change evenly from the first to the last; chords of that parabola are stiffer by a tenth at most, where it begins.
    strains = np.linspace(1e-4, 0.167, 100)
    for name, ends in (("jacket", (86.0, 150.0)), ("interlock", (69.0, 812.0))):
        found = find_fabric(name).tension(strains, "warp" if name == "jacket" else "weft") / strains
        ratio = found / np.interp(strains, (0.0, 0.167), ends)
        assert ratio.min() >= 1.0 - 1e-9
        assert ratio.max() < 1.1
        assert np.abs(ratio[10:] - 1.0).max() < 0.03
    wool = find_fabric("wool-plain")
    assert float(wool.tension(0.0460)) == pytest.approx(98.07, abs=0.01)
    assert float(wool.tension(0.0067)) / 0.0067 == pytest.approx(730, rel=0.01)


# --- instruments


def test_instrument_readings_become_si():
    assert stiffness_from_extension(2.29, 490.3325) == pytest.approx(21_400, rel=1e-3)
    assert stiffness_from_extension(4.60, FAST_LOADS["e100"]) == pytest.approx(2130, rel=2e-3)
    assert FAST_LOADS["e5"] == pytest.approx(4.9, abs=0.01)
    assert shear_stiffness_from_kes(1.0) == pytest.approx(56.19, abs=0.01)
    assert shear_stiffness_from_fast(4.7) == pytest.approx(26.2, abs=0.05)
    for function in (shear_stiffness_from_kes, shear_stiffness_from_fast):
        with pytest.raises(InputError, match="must be above zero"):
            function(0.0)
    with pytest.raises(InputError, match="extension = -1"):
        stiffness_from_extension(-1.0, 98.0)
    with pytest.raises(InputError, match="e20 = nan"):
        curve_from_fast(0.5, math.nan, 3.0)


@pytest.mark.parametrize("linearity", [1.0, 0.6])
def test_a_kes_curve_has_the_measured_extension_and_energy(linearity: float):
    load, top = 490.3, 0.05
    points = curve_from_kes(5.0, linearity, load)
    assert points[-1] == pytest.approx((top, load))
    exponents = [math.log(tension / load) / math.log(strain / top) for strain, tension in points[:-1]]
    np.testing.assert_allclose(exponents, exponents[0])
    energy = load * top / (exponents[0] + 1.0)
    assert energy / (0.5 * load * top) == pytest.approx(linearity)
    with pytest.raises(InputError, match="linearity lies between 0 and 1"):
        curve_from_kes(5.0, 1.2, load)


# --- files of one's own


def test_a_file_with_plain_numbers_units_readings_and_a_base(tmp_path: Path):
    path = write(
        tmp_path,
        """
        [sources]
        lab = "our own lab, 2020"
        [plain]
        stiffness_warp = 1500
        stiffness_weft = 900.0
        shear_stiffness = { value = 0.5, unit = "gf/(cm deg)", source = "lab", grade = "B", test_load = "KES" }
        areal_density = { value = 150, unit = "g/m2" }
        [plain-stiffer]
        base = "plain"
        stiffness_weft = 1400.0
        [by-kes.kes]
        emt_warp = 4.0
        emt_weft = 8.0
        lt_warp = 0.7
        g = 0.6
        b = 0.05
        w = 18.0
        [by-fast]
        areal_density = 0.2
        [by-fast.fast]
        e5_warp = 0.67
        e20_warp = 1.87
        e100_warp = 4.6
        e100_weft = 5.87
        eb5 = 4.7
        c = 15.0
        w = 168.0
        [softer-denim]
        base = "denim"
        stiffness_warp = 300.0
        """,
    )
    library = load_library([path])
    plain = library["plain"]
    assert plain.shear_stiffness == pytest.approx(0.5 * 56.19, rel=1e-4)
    assert plain.areal_density == pytest.approx(0.15)
    assert plain.provenance["shear_stiffness"].source == "our own lab, 2020"
    assert plain.provenance["stiffness_warp"].source == "not stated"
    assert library["plain-stiffer"].stiffness_weft == 1400.0
    assert library["plain-stiffer"].shear_stiffness == plain.shear_stiffness
    kes = library["by-kes"]
    assert kes.stiffness_warp == pytest.approx(490.33 / 0.04, rel=1e-4)
    assert kes.areal_density == pytest.approx(0.18)
    assert kes.curve_warp
    assert not kes.curve_weft
    assert kes.bending == pytest.approx(4.903e-6, rel=1e-3)
    fast = library["by-fast"]
    assert fast.stiffness_weft == pytest.approx(1670, rel=1e-3)
    assert fast.shear_stiffness == pytest.approx(26.2, rel=1e-2)
    assert fast.areal_density == 0.2
    assert fast.bending == pytest.approx(5.56e-6, rel=1e-3)  # as the report says that these readings give
    assert len(fast.curve_warp) == 3
    assert not fast.curve_weft
    softer = library["softer-denim"]
    assert not softer.curve_warp
    assert softer.curve_weft == library["denim"].curve_weft
    assert "jersey" not in softer.aliases


GOOD = "stiffness_warp = 1500\nstiffness_weft = 900\nshear_stiffness = 30\nareal_density = 0.15\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD, "stiffness_warp: stands outside a fabric's table"),
        ("", "has no fabric"),
        ("[x\n", r"is not valid TOML: .*line 1"),
        (
            "[x]\n" + GOOD.replace("stiffness_warp", "stifness_warp"),
            r"x: stifness_warp: unknown key .*did you mean 'stiffness_warp'",
        ),
        (
            "[x]\n" + GOOD.replace("0.15", "{ value = 0.15, unit = 'kg/m2', sorce = 'me' }"),
            r"x: areal_density.sorce: unknown key .*'source'",
        ),
        (
            "[x]\n" + GOOD.replace("0.15", "{ value = 0.15, unit = 'g/m' }"),
            r"fabric 'x': areal_density: unknown unit 'g/m'; did you mean 'g/m2'",
        ),
        ("[x]\n" + GOOD.replace("1500", "'1500'"), r"x: stiffness_warp: should be a valid number, got '1500'"),
        (
            "[x]\n" + GOOD.replace("1500", "-1500"),
            r"fabric 'x': stiffness_warp = -1500 N/m is out of range; must lie between",
        ),
        ("[x]\n" + GOOD.replace("1500", "nan"), r"x: stiffness_warp: should be a finite number"),
        ("[x]\n" + GOOD.replace("areal_density = 0.15", ""), r"fabric 'x': areal_density is missing; write"),
        ("[x]\nbase = 'wovn'\n", r"fabric 'x': base: unknown fabric 'wovn': did you mean 'woven'"),
        ("[x.kes]\nEMT_warp = 4.3\n", r"unknown key 'EMT_warp'; did you mean 'emt_warp'"),
        ("[x]\nbase = 'denim'\n[x.fast]\ne100_warp = 3\n", r"x: fast.e100_weft: is missing"),
        (
            "[x]\nbase = 'denim'\n[x.kes]\nemt_warp = 0\nemt_weft = 3\n",
            r"x: kes.emt_warp: should be greater than 0, got 0",
        ),
        ("[x]\nbase = 'denim'\ncurve_warp = { unit = 'N/m' }\n", r"x: curve_warp: give either points"),
        (
            "[x]\nbase = 'denim'\nstrain_limit = { value = 5, unit = 'percent', grade = 'F' }\n",
            r"strain_limit.grade: should be 'A'",
        ),
        ("sources = 3\n[x]\nbase = 'denim'\n", "sources: must be a table of texts"),
    ],
)
def test_mistakes_in_a_file_are_told_in_one_line(tmp_path: Path, text: str, message: str):
    path = write(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        load_library([path])
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_are_none_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="is a directory"):
        load_library([tmp_path])
    write(tmp_path, "")
    with pytest.raises(InputError, match=r"no such file; did you mean .*mine.toml"):
        load_library([tmp_path / "mien.toml"])
    noise = tmp_path / "noise.toml"
    noise.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="is not a text file"):
        load_library([noise])


def test_every_measured_value_is_listed():
    assert set(value_names()) == {
        *MEASURED, "poisson_ratio", "strain_limit", "shear_limit", "compression_factor", "bending", "curve_warp", "curve_weft"
    }  # fmt: skip


def test_what_is_no_name_and_no_list_of_files_is_told():
    with pytest.raises(InputError, match="name is of type int; it must be that of a fabric"):
        find_fabric(3)  # type: ignore[arg-type]
    for wrong in (3, "cloth.toml"):
        with pytest.raises(InputError, match=r"extra_files is of type .*; it must be a list of the paths of files"):
            load_library(wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="a path in extra_files is of type int"):
        load_library([3])  # type: ignore[list-item]


def test_secants_that_begin_above_zero_begin_with_their_first(tmp_path: Path):
    file = '[a]\nbase = "woven"\ncurve_warp = { secants = [[0.05, 1000], [0.10, 3000]], unit = "N/m" }\n'
    assert load_library([write(tmp_path, file)])["a"].tension(0.05) == pytest.approx(50.0)


def test_a_limit_that_was_estimated_is_estimated_anew_for_another_kind_of_cloth(tmp_path: Path):
    file = '[a]\nbase = "isotropic"\nshear_stiffness = 30\n[b]\nbase = "a"\nstrain_limit = 0.3\n'
    library = load_library([write(tmp_path, file)])
    assert library["a"].shear_limit == cloth().shear_limit == 15.0
    assert library["b"].shear_limit == cloth(strain_limit=0.3).shear_limit


def test_a_stiffness_of_the_table_is_not_overruled_by_a_curve_of_readings(tmp_path: Path):
    readings = "emt_warp = 5\nemt_weft = 5\nlt_warp = 0.6\nlt_weft = 0.6\ng = 1\nw = 15\n"
    file = f"[a]\nstiffness_warp = 20000\n[a.kes]\n{readings}"
    found = load_library([write(tmp_path, file)])["a"]
    assert found.tension(0.05) == pytest.approx(1000.0)
    assert found.curve_weft


def test_a_sheet_with_a_curve_along_one_thread_is_not_isotropic():
    curved = cloth(stiffness_warp=1000.0, stiffness_weft=1000.0, shear_stiffness=500.0, poisson_ratio=0.0)
    assert curved.is_isotropic
    assert not replace(curved, curve_warp=[(0.1, 20.0), (0.2, 400.0)]).is_isotropic


def test_curves_given_as_lists_are_values_like_any_others():
    assert hash(cloth(curve_warp=[[0.1, 100.0]])) == hash(cloth(curve_warp=((0.1, 100.0),)))
