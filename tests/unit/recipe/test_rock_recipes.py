"""Rocks as a recipe asks for them: what is read at plan, and what is refused there."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from PIL import Image as Picture

from terrain_forge import TerrainForgeError, plan
from terrain_forge.base import RecipeError
from terrain_forge.dtm import FlatDtm, read_image
from terrain_forge.recipe import recipe_json
from terrain_forge.recipe.limits import expected_rocks, rocks_of
from terrain_forge.rocks import (
    Clustered,
    Counts,
    Exponential,
    Golombek,
    LibrarySpec,
    PopulationSpec,
    PowerLaw,
    RockListSpec,
    RocksSpec,
    Tabulated,
    check_packing,
    check_rocks,
    expected_count,
    find_library,
)
from terrain_forge.rocks.arrangement import AroundCraters, Crater
from terrain_forge.rocks.laws.golombek import CoverAbove
from terrain_forge.rocks.library import MeshSpec
from terrain_forge.rocks.populations import ExclusionSpec
from tests.helpers.recipes import flat

SIZE = (40.0, 30.0)
LAW = Golombek(k=0.05)
LIBRARY = LibrarySpec(shapes=3)


def population(**changes):
    given = {"name": "rocks", "size_frequency": LAW, "diameter_m": (0.2, 1.0)}
    return PopulationSpec(**{**given, **changes})


def recipe(*populations, body="mars", **rocks):
    spec = RocksSpec(library=LIBRARY, populations=populations, **rocks)
    return flat(SIZE, 0.5, name="site", body=body, rocks=spec)


def complaint(wanted, folder, *words):
    """Key and text of what is said of a recipe, in which the words stand."""
    with pytest.raises(TerrainForgeError) as caught:
        plan(wanted, folder=folder)
    text = str(caught.value)
    assert [word for word in ("\n", *words) if word in text] == [*words]
    return caught.value.key, text


def test_counts_of_a_file_become_part_of_the_recipe(tmp_path):
    diameters = [0.2, 0.31, 0.25, 0.5, 0.22, 0.41, 0.27, 0.9]
    rows = "\n".join(map(str, diameters))
    (tmp_path / "rocks.csv").write_text(f"\ufeff# counted by hand\ndiameter_m\n\n{rows}\n")
    (tmp_path / "bins.csv").write_text("low_m, high_m, count\n0.2,0.4,12\n0.4,0.8,3\n")
    (tmp_path / "law.csv").write_text("diameter_m,number_per_m2\n0.1,1\n0.2,0.2\n1,0.001\n")
    laws = (
        Counts(file="rocks.csv", area_m2=20.0),
        Counts(file=str(tmp_path / "bins.csv"), area_m2=20.0, fit="power_law"),
        Tabulated(file="law.csv"),
    )
    wanted = recipe(
        *(population(name=str(n), size_frequency=law) for n, law in enumerate(laws)), body="moon"
    )
    site = plan(wanted, folder=tmp_path)
    found = [p.size_frequency for p in site.recipe.rocks.populations]
    assert found[0].diameters_m == tuple(diameters)
    assert found[0].q_of_k == "moon"
    assert found[1].bins == ((0.2, 0.4, 12), (0.4, 0.8, 3))
    assert found[2].numbers_per_m2 == (1.0, 0.2, 0.001)
    assert all(law.file is None for law in found)
    assert dict(site.inputs).keys() == {"rocks.csv", "bins.csv", "law.csv"}
    assert str(tmp_path) not in site.recipe_json
    again = plan(site.recipe, folder=tmp_path / "elsewhere")  # needs no file any more
    assert again.recipe == site.recipe
    assert recipe_json(again.recipe) == site.recipe_json


def test_the_body_sets_the_decay_before_a_law_is_judged(tmp_path):
    """A cover that Mars' law could not reach is nothing special on the Moon."""
    law = Golombek(cover=CoverAbove(fraction=0.2, above_m=0.8))
    with pytest.raises(TerrainForgeError, match="at most"):
        plan(recipe(population(size_frequency=law)), folder=tmp_path)
    site = plan(recipe(population(size_frequency=law), body="moon"), folder=tmp_path)
    assert site.recipe.rocks.populations[0].size_frequency.q_of_k == "moon"
    assert plan(recipe(population()), folder=tmp_path).recipe.rocks.populations[0] == population()


def test_smallest_diameter_may_come_from_the_law(tmp_path):
    counts = Counts(diameters_m=(0.3, 0.35, 0.5, 0.45, 0.9, 0.6), area_m2=9.0)
    table = Tabulated(diameters_m=(0.2, 2.0), numbers_per_m2=(1.0, 0.001))
    for law, smallest in ((counts, 0.3), (table, 0.2)):
        spec = population(size_frequency=law, diameter_m=(None, None))
        assert spec.with_diameters(100.0).diameters[0] == smallest
        plan(recipe(spec), folder=tmp_path)
    for law in (LAW, Exponential(number_per_m2=1.0, decay_per_m=3.0)):
        key, text = complaint(recipe(population(size_frequency=law, diameter_m=(None, 1.0))), ".")
        assert key[-1] == "diameter_m"
        assert "smallest diameter" in text


def test_lists_are_read_and_their_rocks_counted(tmp_path):
    (tmp_path / "mine.csv").write_text("x_m,y_m,diameter_m,yaw_deg\n1,2,3.5,90\n-4,0,0.5,0\n")
    wanted = recipe(population(), lists=(RockListSpec(name="mine", file="mine.csv"),))
    site = plan(wanted, folder=tmp_path)
    table = site.table("mine.csv")
    np.testing.assert_array_equal(table.column("diameter_m"), [3.5, 0.5])
    assert site.largest_rock == 3.5
    assert dict(site.inputs).keys() == {"mine.csv"}


def test_meshes_are_read_once_under_names_that_keep_their_families(tmp_path):
    for place in ("here", "there"):
        (tmp_path / place).mkdir()
        trimesh.creation.box((1.0, 0.8, 0.6)).export(tmp_path / place / "rock.stl")
    files = [str(tmp_path / place / "rock.stl") for place in ("here", "there", "here")]
    library = LibrarySpec(shapes=0, meshes=tuple(MeshSpec(file=file) for file in files))
    wanted = recipe(population(families=("rock",)))
    site = plan(replace(wanted, rocks=replace(wanted.rocks, library=library)), folder=tmp_path)
    assert [mesh.path for mesh in site.meshes] == ["rock.stl", "1/rock.stl"]
    assert [mesh.file for mesh in site.recipe.rocks.library.meshes] == [
        *("rock.stl", "1/rock.stl", "rock.stl")
    ]
    assert site.recipe.rocks.library.family_names() == ("rock",)
    assert str(tmp_path) not in site.recipe_json


def test_meshes_that_cannot_be(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=3)
    bowl = ball.faces[ball.triangles_center[:, 2] < 0.0]
    trimesh.Trimesh(ball.vertices, bowl, process=False).export(tmp_path / "open.stl")
    for file, word in (("open.stl", "open.stl"), ("none.stl", "no such file")):
        library = LibrarySpec(shapes=0, meshes=(MeshSpec(file=file),))
        wanted = recipe(population())
        key, text = complaint(
            replace(wanted, rocks=replace(wanted.rocks, library=library)), tmp_path
        )
        assert key == ("rocks", "library", "meshes", 0, "file")
        assert word in text


def test_density_images_are_read_north_up(tmp_path):
    pixels = np.zeros((4, 6), np.uint8)
    pixels[0] = 255
    Picture.fromarray(pixels).save(tmp_path / "density.png")
    site = plan(recipe(population(density_image="density.png")), folder=tmp_path)
    assert site.image("density.png")[-1].min() == 1.0
    assert site.image("density.png")[0].max() == 0.0
    assert dict(site.inputs).keys() == {"density.png"}
    alone = plan(recipe(population()), folder=tmp_path)
    assert rocks_of(site) == pytest.approx(0.25 * rocks_of(alone))


def _palette(values, colours):
    picture = Picture.new("P", values.shape[::-1])
    picture.putdata(values.ravel().tolist())
    picture.putpalette(np.ravel(colours).tolist())
    return picture


@pytest.mark.parametrize("ending", ["png", "tif"])
def test_images_are_as_bright_as_they_look(tmp_path, ending):
    """One bit, a palette, grey and equal colours tell the same; of colours the luma counts."""
    light = np.zeros((4, 6), np.uint8)
    light[0], light[:, 0] = 255, 51
    dark = light.copy()
    dark[:, 0] = 0
    pictures = {
        "grey": (Picture.fromarray(light), light),
        "bit": (Picture.fromarray(dark).convert("1"), dark),
        "palette": (
            _palette(np.where(light == 0, 1, light // 255 * 2), [(51,) * 3, (0,) * 3, (255,) * 3]),
            light,
        ),
        "equal": (Picture.fromarray(np.stack([light] * 3, -1)), light),
        "red": (
            Picture.fromarray(np.stack([light, 0 * light, 0 * light], -1)),
            0.2126 * light,
        ),
        "sixteen": (Picture.fromarray(257 * light.astype(np.uint16)), light),
    }
    for name, (picture, wanted) in pictures.items():
        picture.save(tmp_path / f"{name}.{ending}")
        found = read_image(f"{name}.{ending}", tmp_path, ())[::-1]
        np.testing.assert_allclose(found, wanted / 255, atol=1e-12, err_msg=name)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_m,y_m\n1,2\n", ["no column 'diameter_m'", "found x_m, y_m"]),
        ("x_m,y_m,diameter_m,size\n1,2,1,1\n", ["unknown column 'size'", "yaw_deg"]),
        ("x_m,y_m,diameter_m,x_m\n1,2,1,1\n", ["two columns 'x_m'"]),
        ("x_m,y_m,diameter_m\n", ["at least one more"]),
        ("x_m,y_m,diameter_m\n1,2,1\n1,2\n", ["line 3", "2 fields, expected 3"]),
        ("x_m,y_m,diameter_m\n# two\n1,2,big\n", ["line 3", "diameter_m", "'big'"]),
        ("x_m,y_m,diameter_m\n1,nan,1\n", ["line 2", "y_m", "not finite"]),
        ("x_m,y_m,diameter_m\n1,2,1\n1,2,0\n", ["diameter_m of rock 2 is 0", "0.001 to 15"]),
        ("x_m,y_m,diameter_m\n-20.5,2,1\n", ["x_m of rock 1 is -20.5", "-20 to 20"]),
        ("x_m,y_m,diameter_m,prototype\n1,2,1,3\n", ["prototype", "is 3", "0 to 2"]),
        ("x_m,y_m,diameter_m,prototype\n1,2,1,1.5\n", ["prototype", "whole numbers"]),
        ("x_m,y_m,diameter_m,buried_fraction\n1,2,1,0.9\n", ["buried_fraction", "0 to 0.5"]),
        (b"\xff\xfe\x00", ["no text in UTF-8"]),
        (None, ["no such file"]),
    ],
)
def test_lists_that_cannot_be(tmp_path, text, words):
    if text is not None:
        data = text if isinstance(text, bytes) else text.encode()
        (tmp_path / "mine.csv").write_bytes(data)
    key, _ = complaint(
        recipe(lists=(RockListSpec(name="a", file="mine.csv"),)), tmp_path, "mine.csv", *words
    )
    assert key == ("rocks", "lists", 0, "file")


@pytest.mark.parametrize(
    ("law", "text", "words"),
    [
        (Counts(file="a.csv", area_m2=1.0), "diameter\n1\n", ["unknown column 'diameter'"]),
        (Counts(file="a.csv", area_m2=1.0), "low_m,count\n1,2\n", ["low_m, high_m and count"]),
        (Counts(file="a.csv", area_m2=1.0), "diameter_m\n-1\n", ["above 0", "-1"]),
        (Counts(file="a.csv", area_m2=1.0), "low_m,high_m,count\n1,2,1.5\n", ["whole number"]),
        (Counts(file="a.csv", area_m2=1.0), "diameter_m\n1\n2\n", ["at least 5"]),
        (Counts(file="a.csv", area_m2=1.0), None, ["no such file"]),
        (Tabulated(file="a.csv"), "diameter_m,number_per_m2\n1,1\n2,0\n", ["number_per_m2", "0"]),
        (Tabulated(file="a.csv"), "diameter_m,number_per_m2\n1,1\n2,1\n", ["must fall"]),
        (Tabulated(file="a.csv"), "diameter_m,number_per_m2\n1,1\n2,.1\n", ["begins at 1 m"]),
    ],
)
def test_law_files_that_cannot_be(tmp_path, law, text, words):
    if text is not None:
        (tmp_path / "a.csv").write_text(text)
    key, _ = complaint(recipe(population(size_frequency=law)), tmp_path, *words)
    assert key[:3] == ("rocks", "populations", 0)


def test_files_that_are_too_long(tmp_path):
    rows = "\n".join(f"{n},{1 / n}" for n in range(1, 10_003))
    (tmp_path / "a.csv").write_text(f"diameter_m,number_per_m2\n{rows}\n")
    wanted = recipe(population(size_frequency=Tabulated(file="a.csv")))
    assert "10,002 rows, at most 10,000" in complaint(wanted, tmp_path)[1]


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.zeros((3, 3), np.uint8), ["black all over"]),
        (np.full((3, 3), 1.5, np.float32), ["1.5", "0 (no rocks) to 1"]),
        (None, ["no such file"]),
    ],
)
def test_density_images_that_cannot_be(tmp_path, pixels, words):
    if pixels is not None:
        Picture.fromarray(pixels).save(tmp_path / "density.tif")
    wanted = recipe(population(density_image="density.tif"))
    key, _ = complaint(wanted, tmp_path, "density.tif", *words)
    assert key == ("rocks", "populations", 0, "density_image")


FAR = AroundCraters(craters=(Crater(centre_m=(400, 0), diameter_m=50),))
OLD = AroundCraters(craters=(Crater(centre_m=(0, 0), diameter_m=20, age_ga=4.2),))
SMALL = AroundCraters(craters=(Crater(centre_m=(0, 0), diameter_m=0.5),))
TIGHT = Clustered(clusters_per_m2=0.001, radius_m=0.5)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"diameter_m": (0.5, 0.2)}, ("diameter_m",), ["0.5", "0.2", "must be larger"]),
        ({"diameter_m": (0.2, 18.0)}, ("diameter_m",), ["18 m", "15 m"]),
        ({"diameter_m": (1e-5, 1.0)}, ("diameter_m",), ["at most", "raise the smallest"]),
        ({"buried_fraction": (0.4, 0.1)}, ("buried_fraction",), ["0.4", "comes first"]),
        ({"families": ("block", "boulder")}, ("families", 1), ["'boulder'", "block, slab"]),
        ({"dynamic_m": (0.5, 0.3)}, ("dynamic_m",), ["0.5", "comes first"]),
        ({"dynamic_m": (2.0, 3.0)}, ("dynamic_m",), ["2 to 3 m", "0.2 to 1 m"]),
        ({"dynamic_m": (0.2, 0.4), "collision_min_m": 0.3}, ("dynamic_m",), ["below 0.3 m"]),
        ({"arrangement": FAR}, ("arrangement", "craters"), ["400, 0", "±20"]),
        ({"arrangement": OLD}, ("arrangement", "craters"), ["no rock is left"]),
        ({"arrangement": SMALL}, ("arrangement", "craters"), ["0.154 m", "0.2 m"]),
        ({"arrangement": TIGHT}, ("arrangement",), ["densest", "12.2", "at most 0.4"]),
    ],
)
def test_populations_that_cannot_be(changes, key, words):
    found_key, _ = complaint(recipe(population(**changes)), ".", *words)
    assert found_key == ("rocks", "populations", 0, *key)


def test_cover_that_cannot_be_packed():
    dense = [population(name=n, size_frequency=Golombek(k=0.4)) for n in "abc"]
    key, text = complaint(recipe(*dense), ".")
    assert key == ("rocks", "populations")
    assert "cover 0.64 of the ground, at most 0.4 can be packed" in text


def even(cover, low, high, **more):
    """Rocks of number ∝ D⁻² that cover a part of the ground."""
    one = PowerLaw(number_per_m2=1.0, exponent=2.0)
    unit = float(one.cumulative_area(low) - one.cumulative_area(high))
    law = PowerLaw(number_per_m2=cover / unit, exponent=2.0)
    return population(size_frequency=law, diameter_m=(low, high), **more)


@cache
def library():
    return find_library(LibrarySpec(shapes=6))


@pytest.mark.parametrize(
    "dense",
    [
        pytest.param([even(0.30, 0.9, 1.0)], marks=pytest.mark.slow),
        [even(0.09, 0.15, 1.0, name=name) for name in "abcd"],
        [population(size_frequency=Golombek(k=0.36), diameter_m=(0.15, 2), dynamic_m=(0.15, 2))],
        [even(0.26, 0.5, 1.0, families=("slab",)), even(0.05, 0.5, 1.0, name="more")],
    ],
)
def test_cover_that_leaves_no_room_for_the_last_rocks(dense):
    """Below 0.4, but these sizes leave more than one rock in a thousand without a place."""
    with pytest.raises(RecipeError, match=r"cover 0\.[23].*packed.*lower their numbers") as refused:
        check_packing(tuple(dense), SIZE, library)
    assert refused.value.key == ("rocks", "populations")


def test_wide_ranges_of_sizes_pack_densely():
    still = [population(size_frequency=Golombek(k=k), diameter_m=(0.1, 2)) for k in (0.3, 0.35)]
    dynamic = population(size_frequency=Golombek(k=0.3), diameter_m=(0.15, 2), dynamic_m=(0.15, 2))
    for dense in (*still, dynamic):
        check_rocks(RocksSpec(populations=(dense,)), SIZE)
        check_packing((dense,), SIZE, library)


def test_packing_knows_the_shapes_at_hand():
    """Ventifacts have larger footprints than the default shapes: fewer of them fit."""
    dense = (even(0.22, 0.5, 1.0),)
    check_packing(dense, SIZE, library)
    ventifacts = find_library(LibrarySpec(shapes=3, families=("ventifact",)))
    with pytest.raises(RecipeError, match="packed"):
        check_packing(dense, SIZE, lambda: ventifacts)


def test_the_automatic_largest_rock_must_fit_the_site_too():
    law = PowerLaw(number_per_m2=0.0316, exponent=0.5)
    wanted = recipe(population(size_frequency=law, diameter_m=(0.1, None)))
    key, _ = complaint(
        replace(wanted, dtm=FlatDtm(size_m=(10.0, 10.0))), ".", "9.99 m", "5 m", "give the largest"
    )
    assert key == ("rocks", "populations", 0, "diameter_m")


@pytest.mark.parametrize(
    ("changes", "kept", "words"),
    [
        ({}, (ExclusionSpec(centre_m=(0, 0), radius_m=26.0, clearance_m=0.2),),
         "corridors and circles"),
        ({"arrangement": AroundCraters(craters=(Crater(centre_m=(5, 0), diameter_m=8),))},
         (ExclusionSpec(centre_m=(5, 0), radius_m=9.0),), "its craters, corridors and circles"),
        ({"density_image": "half.png"}, (ExclusionSpec(centre_m=(-20, 0), radius_m=30),),
         "density"),
    ],
)  # fmt: skip
def test_masks_that_leave_no_place(tmp_path, changes, kept, words):
    half = np.zeros((10, 10), np.uint8)
    half[:, :5] = 255
    Picture.fromarray(half).save(tmp_path / "half.png")
    key, text = complaint(recipe(population(**changes), exclusion_zones=kept), tmp_path)
    assert key == ("rocks", "populations", 0)
    assert "no place is left for 'rocks'" in text
    assert words in text


def test_a_table_needs_two_rows(tmp_path):
    (tmp_path / "t1.csv").write_text("diameter_m,number_per_m2\n0.2,1\n")
    key, text = complaint(recipe(population(size_frequency=Tabulated(file="t1.csv"))), tmp_path)
    assert key == ("rocks", "populations", 0, "size_frequency")
    assert "1 row, a table needs at least 2" in text


def test_rocks_need_a_shape():
    wanted = recipe(population())
    bare = replace(wanted, rocks=replace(wanted.rocks, library=LibrarySpec(shapes=0)))
    key, text = complaint(bare, ".")
    assert key == ("rocks", "library")
    assert "no meshes" in text


def test_names_are_unique_across_populations_and_lists():
    lists = (RockListSpec(name="rocks", file="mine.csv"),)
    key, text = complaint(recipe(population(), lists=lists), ".")
    assert key == ("rocks", "lists")
    assert "'rocks'" in text


@pytest.mark.parametrize(
    ("circles", "key", "words"),
    [
        (
            (ExclusionSpec(centre_m=(30, 0), radius_m=9.0),),
            ("rocks", "exclusion_zones", 0),
            ["outside", "±20"],
        ),
        (
            (ExclusionSpec(centre_m=(0, 0), radius_m=26.0),),
            ("rocks", "exclusion_zones"),
            ["no place"],
        ),
        (
            (
                ExclusionSpec(centre_m=(-12, 0), radius_m=19.0),
                ExclusionSpec(centre_m=(12, 0), radius_m=19.0),
            ),
            ("rocks", "exclusion_zones"),
            ["no place"],
        ),
    ],
)
def test_circles_that_cannot_be(circles, key, words):
    found_key, _ = complaint(recipe(population(), exclusion_zones=circles), ".", *words)
    assert found_key == key


def test_circles_become_clearings():
    circles = (
        ExclusionSpec(centre_m=(3, 4), radius_m=2.0),
        ExclusionSpec(centre_m=(0, 0), radius_m=20.0, clearance_m=0.3),
    )
    site = plan(recipe(population(), exclusion_zones=circles))
    assert [(c.centre, c.radius, c.clearance) for c in site.exclusion_zones] == [
        ((3.0, 4.0), 2.0, 0.0),
        ((0.0, 0.0), 20.0, 0.3),
    ]


def test_expected_count_around_craters_is_the_integral_of_their_weight():
    crater = Crater(centre_m=(1.0, -2.0), diameter_m=12.0, age_ga=1.0)
    spec = population(arrangement=AroundCraters(craters=(crater,)), diameter_m=(0.2, 9.0))
    east = np.linspace(-20, 20, 2001)[::4]
    area = crater.weight(east[None, :], east[:, None]).sum() * (4 * 0.02) ** 2
    number = LAW.cumulative_number([0.2, crater.largest_rock_m])
    expected = area * (number[0] - number[1])
    assert expected_count(spec, SIZE) == pytest.approx(expected, rel=5e-3)
    assert expected_rocks(recipe(spec, replace(spec, name="b"))) == 2 * expected_count(spec, SIZE)


def test_expected_count_at_the_rim_of_a_crater_larger_than_the_site():
    crater = Crater(centre_m=(-3000.0, 1.0), diameter_m=6000.0)
    spec = population(arrangement=AroundCraters(craters=(crater,)), diameter_m=(0.2, 9.0))
    east = np.linspace(-20, 20, 2001)
    share = crater.weight(east[None, :], east[:, None]).mean()
    alike = expected_count(population(diameter_m=(0.2, 9.0)), SIZE)
    assert expected_count(spec, SIZE) == pytest.approx(share * alike, rel=0.02)
