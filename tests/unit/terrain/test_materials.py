"""Materials of the ground: where they lie, what is refused, what truth and engines hold."""

import csv
import json

import mujoco
import numpy as np
import pytest
import rasterio
from PIL import Image

from terrain_forge.base import RecipeError
from terrain_forge.making import plan
from terrain_forge.model import exporter
from terrain_forge.pipeline import realise
from terrain_forge.recipe import recipe_from_json
from terrain_forge.terrain.materials import classify_ground
from terrain_forge.truth import write_truth

SOILS = [
    {"kind": "dust", "mask": {"slope": {"below_deg": 4, "fade_deg": 4}}, "cover": 0.5},
    {"kind": "bedrock", "mask": {"height": {"above_m": 0.0}}},
    {"kind": "sand", "name": "dark sand", "mask": {"hollow": {"above_m": 0.004}}, "cover": 0.9},
]


def recipe(materials, size=(24, 20), **more):
    terrain = {"spacing_m": 0.25, "layers": [{"kind": "fractal"}], "materials": materials}
    return recipe_from_json(json.dumps(
        {"name": "soils", "body": "mars", "dtm": {"kind": "flat", "size_m": size},
         "terrain": terrain, "rocks": {"library": {"shapes": 1}},
         "horizon": {"reach_m": 0}, **more}
    ))  # fmt: skip


@pytest.fixture(scope="module")
def site():
    return plan(recipe(SOILS))


@pytest.fixture(scope="module")
def world(site):
    return realise(site)


def test_materials_lie_where_their_masks_let_them_and_hide_those_before(world):
    looks, heights = world.appearance, world.ground.elevation
    assert [m.name for m in looks.materials] == ["ground", "dust", "bedrock", "dark sand"]
    assert set(np.unique(looks.material)) == {0, 1, 2, 3}
    assert (heights[looks.material == 2] > -1e-3).all()
    assert np.isin(looks.material[heights > 1e-3], (2, 3)).all()
    sand = looks.material == 3
    cells = 4  # half a baseline of 2 m
    inner = np.s_[cells:-cells, cells:-cells]
    z = heights.astype(float)
    around = 0.25 * (
        z[cells:-cells, 2 * cells :] + z[cells:-cells, : -2 * cells]
        + z[2 * cells :, cells:-cells] + z[: -2 * cells, cells:-cells]
    )  # fmt: skip
    low = around - z[inner] > 0.004
    assert not sand[inner][~low].any()
    assert sand[inner][low].mean() == pytest.approx(0.9, abs=0.12)
    red = looks.ground_rgb[..., 0].astype(float)
    assert red[looks.material == 1].mean() > red[looks.material == 0].mean() > red[sand].mean()


def test_the_soil_of_a_named_regolith_is_as_pebbly_as_its_material():
    """Wherever regolith lies; what lies on it is as it was."""
    plains, sand = (
        realise(
            plan(
                recipe_from_json(json.dumps(
                    {"name": "soils", "body": "mars", "dtm": {"kind": "flat", "size_m": [8, 8]},
                     "terrain": {"spacing_m": 0.5, "materials": SOILS,
                                 "appearance": {"regolith": soil}},
                     "rocks": {"library": {"shapes": 1}}, "horizon": {"reach_m": 0}}
                ))
            )
        ).appearance.materials
        for soil in ("mars_plains", "mars_sand")
    )  # fmt: skip
    assert sand[0].pebbles == sand[3].pebbles < 0.1 < 0.5 < plains[0].pebbles
    assert sand[0].roughness == sand[3].roughness < plains[0].roughness
    assert [m.pebbles for m in sand[1:]] == [m.pebbles for m in plains[1:]]


@pytest.mark.parametrize("cover", [0.01, 0.05, 0.3, 0.8, 0.98])
@pytest.mark.parametrize("patch", [0.1, 1.0])
def test_a_material_covers_the_share_that_it_says(cover, patch):
    site = plan(recipe([{"kind": "dust", "cover": cover, "patch_m": patch}], size=(100, 100)))
    flat = np.zeros((site.window.rows + 1, site.window.columns + 1))
    laid = classify_ground(
        site.recipe.terrain.materials,
        site=site, window=site.window, around=site.window, heights=flat,
    )  # fmt: skip
    assert laid.mean() == pytest.approx(cover, abs=0.003 + 0.1 * cover * (1.0 - cover))


def test_an_image_by_its_absolute_path_is_a_mask(tmp_path):
    half = np.zeros((20, 24), np.uint8)
    half[:, :12] = 255
    Image.fromarray(half).save(tmp_path / "half.png")
    found = [
        realise(plan(recipe([{"kind": "sand", "mask": {"image": str(name)}}]), folder=tmp_path))
        for name in ("half.png", tmp_path / "half.png")
    ]
    relative, absolute = (world.appearance.material for world in found)
    assert np.array_equal(relative, absolute)
    assert relative[:, :40].all()
    assert not relative[:, 60:].any()


def test_a_window_has_the_materials_of_the_whole(site, world):
    part = realise(site, window=site.window.replace(column=17, row=9, columns=40, rows=33))
    whole = world.appearance.material[9 : 9 + 34, 17 : 17 + 41]
    assert np.array_equal(part.appearance.material, whole)
    tile = next(t for t in world.tiles(cells=32) if t.number == 3).world
    assert tile.appearance.material.shape == tile.ground.shape


def test_truth_names_the_classes(world, tmp_path):
    write_truth(world, tmp_path)
    with rasterio.open(tmp_path / "truth" / "material.tif") as file:
        assert np.array_equal(file.read(1)[::-1], world.appearance.material)
        tags = file.tags()
        assert tags["TERRAIN_FORGE_CLASS_3"] == "dark sand"
        assert file.colormap(1)[2][3] == 255
    with (tmp_path / "truth" / "materials.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["ground", "dust", "bedrock", "dark sand"]
    assert sum(float(row["share"]) for row in rows) == pytest.approx(1.0, abs=1e-5)
    assert float(rows[2]["friction"]) == 0.8


def test_each_material_is_felt_in_mujoco_and_the_ground_is_as_high_as_before(world, tmp_path):
    mjcf = exporter("mjcf")
    mjcf.export(world, tmp_path, options=mjcf.Options())
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "world.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    touched = model.geom_conaffinity > 0
    model.geom_group[:] = np.where(touched, 0, 5)
    groups = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    random = np.random.default_rng(1)
    west, south, east, north = world.ground.bounds
    frictions = [m.friction for m in world.appearance.materials]
    felt, same = set(), 0
    for _ in range(300):
        x, y = random.uniform(west, east), random.uniform(south, north)
        geom = np.zeros(1, np.int32)
        far = mujoco.mj_ray(
            model, data, np.array([x, y, 50.0]), np.array([0, 0, -1.0]), groups, 1, -1, geom
        )
        assert 50.0 - far == pytest.approx(world.ground.height_at(x, y), abs=1e-4)
        i, j = int((x - west) / 0.25), int((y - south) / 0.25)
        wanted = frictions[world.appearance.material[j, i]]
        # Cells alone or in strips one cell wide have their neighbours' friction.
        same += model.geom_friction[geom[0], 0] == pytest.approx(wanted)
        felt.add(model.geom_friction[geom[0], 0])
    assert same > 240
    assert felt == {0.58, 0.66, 0.8}  # sand and dust are alike


@pytest.mark.parametrize(
    ("materials", "told"),
    [
        ([{"kind": "sand"}], "a material needs a mask or a cover below 1"),
        ([{"kind": "own", "cover": 0.5}], "kind own needs rgb and friction"),
        ([{"kind": "own", "cover": 0.5, "rgb": [0.3, 0.3, 0.3]}], "kind own needs friction"),
        ([{"kind": "sand", "cover": 0.5, "texture": "s.png"}], "texture"),
        ([{"kind": "mud", "cover": 0.5}], "bedrock"),
        ([{"kind": "sand", "cover": 0.5}] * 2, "a material before is called 'sand' too"),
        (
            [{"kind": "sand", "name": "ground", "cover": 0.5}],
            "'ground' is what the ground without materials is called",
        ),
        ([{"kind": "sand", "mask": {"hollow": {}}}], "above_m or below_m is needed"),
        ([{"kind": "sand", "name": f"s{n}", "cover": 0.5} for n in range(16)], "at most 15"),
        ([{"kind": "sand", "cover": 0.5, "patch_m": 241}], "241 m: at most 240 m, 10 times the"),
        *(
            ([{"kind": "sand", "mask": {name: band | {"baseline_m": 25}}}], "25 m: at most 24 m")
            for name, band in (
                ("hollow", {"above_m": 0}),
                ("roughness", {"above_m": 0}),
                ("slope", {"above_deg": 5}),
            )
        ),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(materials, told):
    with pytest.raises(RecipeError) as caught:
        plan(recipe(materials))
    assert told in str(caught.value)
    assert "materials" in f"{caught.value.key} {caught.value}"
