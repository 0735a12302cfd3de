"""What lies around craters and what truth tells of them."""

from __future__ import annotations

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from terrain_forge.base import DataError, RecipeError
from terrain_forge.dtm import FlatDtm
from terrain_forge.making import plan
from terrain_forge.model import Window
from terrain_forge.pipeline import realise
from terrain_forge.report.page import render
from terrain_forge.report.section import Built
from terrain_forge.report.sections.ground import Craters as CratersSection
from terrain_forge.rocks import (
    Golombek,
    LibrarySpec,
    PopulationSpec,
    RocksSpec,
    make_library,
    scatter,
)
from terrain_forge.rocks.arrangement import AroundCraters
from terrain_forge.rocks.scattering import layer_craters
from terrain_forge.terrain import (
    BodyProduction,
    CraterLayer,
    CraterTable,
    Resurfacing,
    population_of,
)
from terrain_forge.terrain.masks import Mask
from terrain_forge.truth.craters import write_craters
from terrain_forge.validation.checks.truth import Craters as CratersCheck
from tests.helpers.craters import ALPHA, everywhere, layer, listed, near, recipe


def blocks(largest=0.8, **around):
    """Rocks around craters, by default those of `layer` from 12 m up."""
    around = around or {"layer": "craters", "smallest_crater_m": 12.0}
    return PopulationSpec(
        name="blocks",
        size_frequency=Golombek(k=0.02),
        diameter_m=(0.1, largest),
        arrangement=AroundCraters(**around),
    )


def test_rocks_lie_around_the_craters_of_a_layer():
    rocks = RocksSpec(library=LibrarySpec(shapes=2), populations=(blocks(),))
    site = plan(recipe(layer(), rocks=rocks))
    (spec,) = site.recipe.rocks.populations
    craters = everywhere(layer(), site)
    near = craters.select((craters.diameter >= 12.0) & (craters.wear < 1.0))
    assert isinstance(spec.arrangement, AroundCraters)
    assert spec.arrangement.layer is None
    assert [c.diameter_m for c in spec.arrangement.craters] == near.diameter.tolist()
    assert [c.age_ga for c in spec.arrangement.craters] == near.age.tolist()
    rocks = realise(site).field
    assert len(rocks) > 50
    away = np.hypot(*(rocks.position[:, None, :2] - near.xy).transpose(2, 0, 1)) / near.diameter
    assert np.all((away < 1.05).any(axis=1))
    limit = 0.25 * near.diameter**0.7
    assert np.all(rocks.diameter <= np.where(away < 1.05, limit, 0.0).max(axis=1))
    again = plan(site.recipe)
    assert again.recipe_json == site.recipe_json


def test_rocks_around_a_layer_that_cannot_be(monkeypatch):
    def planned(**more):
        rocks = RocksSpec(populations=(blocks(2.0, **more),))
        return plan(recipe(layer(), rocks=rocks, dtm=FlatDtm(size_m=(200.0, 200.0))))

    with pytest.raises(RecipeError, match="no layer of craters is called 'mine', there are: crat"):
        planned(layer="mine")
    with pytest.raises(RecipeError, match=r"0 craters of 55 m and more .* allowed: 1 to 100000"):
        planned(layer="craters", smallest_crater_m=55.0)
    monkeypatch.setattr(layer_craters, "MAX_CRATERS", 500)
    with pytest.raises(RecipeError, match=r"craters of 2 m and more .* allowed: 1 to 500"):
        planned(layer="craters", smallest_crater_m=2.0)
    with pytest.raises(ValueError, match="one of craters and layer"):
        AroundCraters()


def test_rocks_of_a_layers_craters_are_scattered_once_these_are_known():
    site = plan(recipe(layer()))
    library = make_library(LibrarySpec(shapes=2))
    with pytest.raises(RecipeError, match=r"craters of layer 'craters' are not known yet"):
        scatter(site=site, populations=(blocks(),), library=library, window=site.window)


def test_young_ejecta_are_bright():
    place, spec = listed([(0, 0, 40.0, 0.0), (60, 50, 40.0, 1.0), (-50, -40, 8.0, 0.01)])
    factor = spec.brightness(site=place, window=place.window)
    assert factor is not None
    assert factor[near(0, 0, 15)] == pytest.approx(1.0 + 0.4 * 0.4)
    assert factor[near(60, 50, 15)] == pytest.approx(1.0)
    assert 1.0 < factor[near(-50, -40, 2)].max() < 1.0 + 0.4 * 0.08
    part = Window(column=150, row=100, columns=80, rows=90)
    np.testing.assert_array_equal(
        spec.brightness(site=place, window=part), factor[100:191, 150:231]
    )
    assert layer(ejecta_contrast=0.0).brightness(site=place, window=part) is None


def test_production_of_the_users_table(tmp_path):
    """Counts of one's own, from a file as from lists, and hashed as an input."""
    lines = "diameter_m,number_per_km2\n2,15000\n8,900\n60,4\n"
    (tmp_path / "counts.csv").write_text(lines)
    from_file = layer(production=CraterTable(file="counts.csv", age_ga=3.5))
    lists = CraterTable(diameters_m=(2, 8, 60), numbers_per_km2=(15000, 900, 4), age_ga=3.5)
    site = plan(recipe(from_file), folder=tmp_path)
    assert [name for name, _ in site.inputs] == ["counts.csv"]
    given = plan(recipe(layer(production=lists)))
    assert site.recipe.terrain == given.recipe.terrain
    (spec,) = site.recipe.terrain.layers
    found = everywhere(spec, site)
    assert np.array_equal(found.xy, everywhere(spec, given).xy)
    wanted = population_of(spec, site=site).number(np.array([2.0, 8.0, 60.0])) * 1e6
    assert wanted[:2] - wanted[2] == pytest.approx([14996.0, 896.0])
    for text, match in (
        ("2,15000\n8,30000\n", "numbers fall"),
        ("2,15000\n", "two diameters"),
        ("2,0\n8,-1\n", "must be above 0"),
    ):
        (tmp_path / "counts.csv").write_text("diameter_m,number_per_km2\n" + text)
        with pytest.raises(DataError, match=match) as error:
            plan(recipe(from_file), folder=tmp_path)
        assert error.value.key == ("terrain", "layers", 0, "production", "file")


def test_truth_lists_the_craters(tmp_path):
    (tmp_path / "mine.csv").write_text("x_m,y_m,diameter_m\n7,-5,20\n-52,0,10\n")
    site = plan(recipe(layer(diameter_m=(2.0, 30.0), file="mine.csv")), folder=tmp_path)
    world = realise(site)
    files = write_craters(world, tmp_path)
    assert [path.name for path in files] == ["craters.csv", "crater_counts.json"]
    rows = list(csv.DictReader(files[0].read_text().splitlines()))
    mine = [row for row in rows if row["listed"] == "1"]
    assert [(float(row["x_m"]), float(row["y_m"]), row["inside"]) for row in mine] == [
        (7.0, -5.0, "1"),
        (-52.0, 0.0, "0"),
    ]
    for row in rows:
        lost = 1.0 - float(row["depth_m"]) / float(row["fresh_depth_m"])
        assert float(row["degradation"]) == pytest.approx(lost, abs=1e-5)
    assert float(mine[0]["degradation"]) == pytest.approx(0.0, abs=2e-3)
    metre = 180.0 / (np.pi * 1737.4e3)
    assert float(mine[0]["lat_deg"]) + 3.0 == pytest.approx(-5.0 * metre, abs=1e-7)
    assert len({row["id"] for row in rows}) == len(rows)
    part = realise(site, Window(column=20, row=30, columns=60, rows=50))
    write_craters(part, tmp_path)
    inside = {row["id"]: row for row in csv.DictReader(files[0].read_text().splitlines())}
    known = {row["id"]: row for row in rows}
    assert 0 < len(inside) < len(known)
    for name, row in inside.items():
        assert row["diameter_m"] == known[name]["diameter_m"]


def test_truth_tells_of_resurfacing(tmp_path):
    event = Resurfacing(age_ga=1.2, below_m=6.0)
    production = BodyProduction(kind="neukum", age_ga=3.5, resurfaced=(event,))
    spec = CraterLayer(production=production, diameter_m=(5.0, 30.0))
    world = realise(plan(recipe(spec)), Window(column=0, row=0, columns=20, rows=20))
    (counts,) = json.loads(write_craters(world, tmp_path)[1].read_text())["layers"]
    assert counts["resurfaced"] == [{"age_ga": 1.2, "below_m": 6.0}]


def test_truth_tells_which_craters_were_masked_out(tmp_path):
    """West of the middle the mask is black: the ground is level there and the table says so."""
    from PIL import Image as Picture

    black_and_white = np.repeat([0, 255], 100).astype(np.uint8)
    Picture.fromarray(np.tile(black_and_white, (160, 1))).save(tmp_path / "mask.png")
    spec = CraterLayer(
        production=BodyProduction(kind="neukum", age_ga=3.5),
        diameter_m=(2.0, 30.0),
        mask=Mask(image="mask.png"),
    )
    site = plan(recipe(spec), folder=tmp_path)
    for window in (site.window, Window(column=30, row=20, columns=120, rows=90)):
        world = realise(site, window)
        rows = list(csv.DictReader(write_craters(world, tmp_path)[0].read_text().splitlines()))
        weight = np.array([float(row["mask_weight"]) for row in rows])
        east = np.array([float(row["x_m"]) for row in rows])
        assert set(weight[east < -5.0]) == {0.0}
        assert set(weight[east > 5.0]) == {1.0}
        assert not world.ground.elevation[:, world.ground.east < -5.0].any()
        assert world.ground.elevation[:, world.ground.east > 5.0].any()


def test_nothing_is_written_where_no_craters_are_made(tmp_path):
    world = realise(plan(recipe()))
    assert write_craters(world, tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def counted(spec, folder):
    """A world with a layer, the file of its counts, and what that says of the layer."""
    world = realise(plan(recipe(spec, name="counts")))
    (folder / "truth").mkdir()
    _, counts = write_craters(world, folder / "truth")
    (report,) = json.loads(counts.read_text())["layers"]
    return world, counts, report


def test_proof_of_the_numbers(tmp_path):
    world, counts, report = counted(layer(), tmp_path)
    assert abs(report["number"]["z"]) < norm.isf(0.5 * ALPHA)
    assert report["sizes"]["p_value"] > ALPHA
    built = SimpleNamespace(directory=tmp_path)
    checks = CratersCheck().checks(built)
    assert [check.passed for check in checks] == [True, True]
    bent = json.loads(counts.read_text())
    bent["layers"][0]["number"]["z"] = -4.0
    counts.write_text(json.dumps(bent))
    assert [check.passed for check in CratersCheck().checks(built)] == [False, True]
    counts.write_text(json.dumps({"layers": [report]}))
    shown = render("blocks.html", blocks=CratersSection().blocks(Built(world, tmp_path)))
    assert all(said in shown for said in (">neukum<", "3.5·10⁹ years", ">trask<", "2 to 60 m"))
    assert shown.count("<td") == 4 * 5
    assert report["cumulative"]["expected"][0] == pytest.approx(report["number"]["expected"])


def test_numbers_count_from_the_smallest(tmp_path):
    """Also where that lies within an octave."""
    spec = layer(diameter_m=(2.7, 21.0))
    world, _, report = counted(spec, tmp_path)
    wanted = 100.0 * 80.0 * population_of(spec, site=world.site).density(2.7, 21.0)
    assert report["number"]["expected"] == pytest.approx(wanted)
    assert report["cumulative"]["diameter_m"] == [2.7, 4.0, 8.0, 16.0]
    assert report["cumulative"]["expected"][0] == pytest.approx(wanted)
    assert abs(report["number"]["z"]) < norm.isf(0.5 * ALPHA)
