"""The files that a recipe names: found by their marks, read, hashed and named."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
import pytest
import trimesh
from PIL import Image as Picture

from terrain_forge import DataError, load_recipe, plan
from terrain_forge.base import InputFile, Spec
from terrain_forge.paths import PathSpec, Recorded
from terrain_forge.recipe import InputFiles
from terrain_forge.recipe.inputs import find_inputs
from terrain_forge.rocks import (
    Counts,
    LibrarySpec,
    MeshSpec,
    PopulationSpec,
    RockListSpec,
    RocksSpec,
    Tabulated,
)
from terrain_forge.rovers import FileRover
from terrain_forge.terrain import CraterLayer, CraterTable, DisplacementMap, Layer
from terrain_forge.terrain.detail import DetailSpec
from terrain_forge.terrain.masks import Mask
from terrain_forge.terrain.orthoimage import OrthoimageSpec
from tests.helpers.recipes import flat


def recipe(*, layers=(), rocks=None, **more):
    given = {"terrain": {"layers": layers}, "rocks": rocks or RocksSpec(), "exports": (), **more}
    return flat((20.0, 10.0), 0.5, name="site", **given)


def population(name, law=None, **more):
    law = law or Tabulated(diameters_m=(0.2, 1.0), numbers_per_m2=(0.1, 0.001))
    return PopulationSpec(name=name, size_frequency=law, **more)


def picture(path, low=0, high=255):
    path.parent.mkdir(exist_ok=True)
    values = np.random.default_rng(1).integers(low, high, (10, 20))
    Picture.fromarray(values.astype(np.uint8)).save(path)


@dataclass(frozen=True, kw_only=True)
class Part(Spec):
    more: Annotated[str, InputFile(kind="image")] | None = None


@dataclass(frozen=True, kw_only=True)
class Foreign(Layer):
    """A layer that nobody here knows."""

    kind: Literal["foreign"] = "foreign"
    label: str = "no file"
    pictures: tuple[Annotated[str, InputFile(kind="image")], ...] = ()
    parts: dict[str, Part]
    table: Annotated[str, InputFile(kind="table", columns=("a",), blanks=(("a", 7.0),))]


@dataclass(frozen=True, kw_only=True)
class Seven(Layer):
    file: Annotated[str, InputFile(kind="table", columns=("a", "b"), blanks=(("a", 7.0),))]


@dataclass(frozen=True, kw_only=True)
class Eight(Layer):
    file: Annotated[str, InputFile(kind="table", columns=("a", "b"), blanks=(("a", 8.0),))]


@dataclass(frozen=True, kw_only=True)
class Law(Spec):
    """A law of another package: it takes its numbers over."""

    file: Annotated[str, InputFile(kind="table", columns=("a",), positive=("a",))] | None = None
    numbers: tuple[float, ...] = ()

    def with_table(self, table):
        if len(table.values) < 2:
            raise ValueError("two rows at least")
        return replace(self, file=None, numbers=tuple(table.column("a").tolist()))


@dataclass(frozen=True, kw_only=True)
class Lawful(Layer):
    law: Law


def test_a_foreign_law_takes_its_table_over(tmp_path):
    layers = (Lawful(law=Law(numbers=(3.0,))), Lawful(law=Law(file="law.csv")))
    wanted, file = recipe(layers=layers), tmp_path / "law.csv"
    inputs = InputFiles(wanted, tmp_path)
    for text, words in (
        (None, "no such file: law.csv"),
        ("a\n1\n", "law.csv: two rows at least"),
        ("a\n1\n-2\n", "law.csv: a must be above 0, found -2"),
    ):
        if text:
            file.write_text(text)
        with pytest.raises(DataError) as caught:
            inputs.taken_over(wanted)
        assert str(caught.value) == words
        assert caught.value.key == ("terrain", "layers", 1, "law", "file")
    file.write_text("a\n1\n2\n")
    found = inputs.taken_over(wanted)
    assert [layer.law.numbers for layer in found.terrain.layers] == [(3.0,), (1.0, 2.0)]
    assert inputs.portable(found) == found
    assert inputs.tables() == ()
    assert [name for name, _ in inputs.hashes(patch=None, rover_files=())] == ["law.csv"]


def test_any_spec_that_marks_a_field_has_its_file_read_hashed_and_named(tmp_path):
    away = tmp_path / "away"
    for path in (tmp_path / "one.png", away / "one.png", away / "two.png"):
        picture(path)
    (tmp_path / "a.csv").write_text("a\n1\n2\n")
    pictures = ("one.png", str(away / "one.png"))
    layer = Foreign(pictures=pictures, parts={"p": Part(more=str(away / "two.png"))}, table="a.csv")
    wanted = recipe(layers=(layer,))
    inputs = InputFiles(wanted, tmp_path)
    key = ("terrain", "layers", 0)
    assert [(one.key, one.path) for one in inputs.found] == [
        ((*key, "pictures", 0), pictures[0]),
        ((*key, "pictures", 1), pictures[1]),
        ((*key, "table"), "a.csv"),
        ((*key, "parts", "p", "more"), str(away / "two.png")),
    ]
    names = ["one.png", "1/one.png", "two.png"]
    assert [image.path for image in inputs.images()] == names
    assert [table.path for table in inputs.tables()] == ["a.csv"]
    hashes = dict(inputs.hashes(patch=None, rover_files=()))
    assert set(hashes) == {*names, "a.csv"}
    found = inputs.portable(wanted).terrain.layers[0]
    assert found == replace(
        layer, pictures=("one.png", "1/one.png"), parts={"p": Part(more="two.png")}
    )
    (away / "two.png").unlink()
    with pytest.raises(DataError, match=r"no such file: .*two\.png") as caught:
        inputs.require()
    assert caught.value.key == (*key, "parts", "p", "more")


def test_all_our_keys_that_name_files_are_found():
    layers = (
        DisplacementMap(image="a", height_m=1.0, mask=Mask(image="b")),
        CraterLayer(file="c", production=CraterTable(file="d", age_ga=3.0)),
    )
    rocks = RocksSpec(
        library=LibrarySpec(meshes=(MeshSpec(file="g"),)),
        populations=(
            population("i", Counts(file="h", area_m2=1.0)),
            population("k", Tabulated(file="j"), density_image="i"),
        ),
        lists=(RockListSpec(name="l", file="k"),),
    )
    wanted = recipe(
        layers=layers,
        rocks=rocks,
        paths=(PathSpec(name="p", route=Recorded(file="l"), speed_m_s=0.1),),
        rover=FileRover(file="m", packages={"p": "n"}),
    )
    looks = replace(
        wanted.terrain.appearance,
        orthoimage=OrthoimageSpec(image="e"),
        detail=DetailSpec(image="f", size_m=1.0),
    )
    wanted = replace(wanted, terrain=replace(wanted.terrain, appearance=looks))
    found = find_inputs(wanted)
    assert {one.path for one in found} == set("abcdefghijklmn")
    assert {one.path for one in found if one.taken_over} == set("dhj")
    names = {"image", "file", "density_image", "p"}
    assert {one.key[-1] for one in found} == names


def test_one_file_at_many_keys(tmp_path):
    """In two populations, as image and as density, as table of craters and of rocks."""
    picture(tmp_path / "map.png")
    (tmp_path / "list.csv").write_text("x_m,y_m,diameter_m\n1,2,2.5\n-4,0,3\n")
    trimesh.creation.box((1.0, 0.8, 0.6)).export(tmp_path / "box.stl")
    here = str(tmp_path / "list.csv")
    rocks = RocksSpec(
        library=LibrarySpec(shapes=1, meshes=(MeshSpec(file="box.stl"), MeshSpec(file="box.stl"))),
        populations=tuple(population(name, density_image="map.png") for name in "ab"),
        lists=(RockListSpec(name="c", file=here), RockListSpec(name="d", file=here)),
    )
    layers = (DisplacementMap(image="map.png", height_m=0.1), CraterLayer(file=here))
    site = plan(recipe(layers=layers, rocks=rocks), folder=tmp_path)
    assert [image.path for image in site.images] == ["map.png"]
    assert [table.path for table in site.tables] == ["list.csv"]
    assert [mesh.path for mesh in site.meshes] == ["box.stl"]
    assert [name for name, _ in site.inputs] == ["map.png", "list.csv", "box.stl"]
    assert site.recipe.terrain.layers[1].file == "list.csv"
    assert [spec.file for spec in site.recipe.rocks.lists] == ["list.csv"] * 2


def test_one_path_at_two_keys_and_each_error_names_its_own(tmp_path):
    """The file serves the first key, and not the second."""
    picture(tmp_path / "dark.png", 0, 1)
    (tmp_path / "craters.csv").write_text("x_m,y_m,diameter_m,age_ga\n1,2,3,0.1\n")
    path = tmp_path / "recipe.yaml"
    head = (
        "schema: 1\nname: a\nbody: mars\nexports: []\ndtm: {kind: flat, size_m: [20, 10]}\n"
        "terrain:\n  spacing_m: 0.5\n  layers:\n"
        "    - {kind: displacement_map, image: dark.png, height_m: 0.1}\n"
        "    - {kind: craters, file: craters.csv}\n"
    )
    sizes = "size_frequency: {kind: golombek, k: 0.05}, diameter_m: [0.2, 1]"
    first = f"rocks:\n  populations:\n    - {{name: a, {sizes}}}\n"
    for tail, key, words in (
        (f"    - {{name: b, {sizes}, density_image: dark.png}}\n",
         "14: rocks.populations[1].density_image", "black all over"),
        ("  lists:\n    - {name: mine, file: craters.csv}\n",
         "15: rocks.lists[0].file", "unknown column 'age_ga'"),
        ("    - {name: b, size_frequency: {kind: counts, file: craters.csv, area_m2: 9}}\n",
         "14: rocks.populations[1].size_frequency.file", "unknown column 'x_m'"),
    ):  # fmt: skip
        path.write_text(head + first + tail)
        file = load_recipe(path)
        with pytest.raises(DataError) as caught:
            plan(file.recipe, folder=file.folder)
        message = file.locate(caught.value)
        assert message.startswith(f"{path}:{key}: ")
        assert words in message


def test_two_keys_that_read_empty_fields_otherwise(tmp_path):
    """One table cannot hold both."""
    (tmp_path / "a.csv").write_text("a,b\n1,1\n,2\n")

    same = InputFiles(recipe(layers=(Seven(file="a.csv"), Seven(file="a.csv"))), tmp_path)
    assert same.tables()[0].column("a").tolist() == [1.0, 7.0]
    with pytest.raises(DataError, match="used elsewhere") as caught:
        InputFiles(recipe(layers=(Seven(file="a.csv"), Eight(file="a.csv"))), tmp_path).tables()
    assert caught.value.key == ("terrain", "layers", 1, "file")


def test_text_that_equals_a_path_is_left_alone(tmp_path):
    """Names are changed where a file is named, and nowhere else."""
    path = str(tmp_path / "map.png")
    picture(tmp_path / "map.png")
    layer = DisplacementMap(image=path, height_m=0.1)
    rocks = RocksSpec(lists=(), populations=())
    wanted = recipe(layers=(layer,), rocks=rocks, rover=FileRover(file="a", base=path))
    found = InputFiles(wanted, tmp_path).portable(wanted)
    assert found.terrain.layers[0].image == "map.png"
    assert found.rover.base == path


def test_both_diameters_stand_in_the_planned_recipe(tmp_path):
    """And planned again they stay, even where no rock is expected."""
    few = Tabulated(diameters_m=(0.2, 1.0), numbers_per_m2=(1e-6, 1e-9))
    wanted = recipe(rocks=RocksSpec(populations=(population("a"), population("b", few))))
    site = plan(wanted, folder=tmp_path)
    (low, high), none = (one.diameter_m for one in site.recipe.rocks.populations)
    law = wanted.rocks.populations[0].size_frequency
    assert low == 0.2
    assert float(law.cumulative_number(high)) * 200.0 == pytest.approx(1.0, rel=1e-9)
    assert high == float(f"{high:.10g}")
    assert none == (0.2, 0.2)
    assert plan(site.recipe, folder=tmp_path).recipe == site.recipe
    with pytest.raises(Exception, match="the largest must be larger"):
        plan(recipe(rocks=RocksSpec(populations=(population("a", diameter_m=(0.3, 0.3)),))))
