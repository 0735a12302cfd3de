import json
from importlib import import_module

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from terrain_forge.exporters.glb import Options, export
from terrain_forge.exporters.glb.rocks import node_texts

from terrain_forge.base import ExportError, linear_from_srgb
from terrain_forge.geometry import rock_maps, rock_texture, skin
from terrain_forge.scene import rock_tints, tint_colours
from tests.helpers import worlds
from tests.helpers.ground_pictures import (
    PIXELS,
    detailed,
    shows_its_detail,
    shows_its_nodes,
    speckled,
)
from tests.helpers.node import run_node
from tests.helpers.plain_readers import glb_parts


def exported(world, directory, **options):
    directory.mkdir()
    report = export(world, directory, options=Options(**options))
    assert [path.name for path in directory.iterdir()] == ["world.glb"]
    assert list(map(str, report.files)) == ["world.glb"]
    return directory / "world.glb"


@pytest.fixture(scope="module")
def glb(small_world, tmp_path_factory):
    """The small world in four tiles, its larger rocks one by one."""
    directory = tmp_path_factory.mktemp("glb") / "glb"
    return exported(detailed(small_world), directory, tile_cells=48, instances_min_m=0.5)


@pytest.fixture(scope="module")
def scene(glb):
    return trimesh.load(glb, process=False)


def placed(scene, prefix):
    """Names, vertices in the world's frame (east, north, up) and faces of the nodes so named."""
    for node in sorted(scene.graph.nodes_geometry):
        if node.startswith(prefix):
            matrix, geometry = scene.graph[node]
            mesh = scene.geometry[geometry]
            x, y, z = trimesh.transform_points(mesh.vertices, matrix).T
            yield node, np.stack([x, -z, y], axis=-1), mesh.faces


def test_large_rocks_share_their_meshes(small_world, glb):
    text, _ = glb_parts(glb)
    field = small_world.field
    large = field.diameter >= 0.5
    tints = rock_tints(field.id[large], small_world.site.seed)
    kinds = set(zip(field.prototype[large], field.population[large], tints, strict=True))
    shared = [mesh for mesh in text["meshes"] if mesh["name"].startswith("rock_shape_")]
    assert len(shared) == len(kinds) <= large.sum()
    positions = {mesh["primitives"][0]["attributes"]["POSITION"] for mesh in shared}
    assert len(positions) == len({prototype for prototype, *_ in kinds})


def test_soil_and_rocks_have_no_gloss(small_world, tmp_path):
    path = exported(worlds.with_horizon(small_world), tmp_path / "glb", instances_min_m=0.5)
    text, _ = glb_parts(path)
    assert {"ground_000", "horizon", "sky"} <= {look["name"] for look in text["materials"]}
    for look in text["materials"]:
        assert look["extensions"]["KHR_materials_specular"] == {"specularFactor": 0.0}


@pytest.mark.parametrize(
    "options",
    [{}, {"horizon": False}, pytest.param({"close_within_m": 2.0}, marks=pytest.mark.slow)],
)
def test_all_extensions_are_named(small_world, tmp_path, options):
    text, _ = glb_parts(exported(detailed(small_world), tmp_path / "glb", **options))
    assert extensions_of(text) - {"extensionsUsed"} <= set(text["extensionsUsed"])


def extensions_of(part):
    """Names of the extensions that a part of a glTF uses."""
    if isinstance(part, list):
        return set().union(*map(extensions_of, part))
    if not isinstance(part, dict):
        return set()
    return set(part.get("extensions", {})) | extensions_of(list(part.values()))


def test_the_texture_lies_the_right_way(small_world, tmp_path):
    world = speckled(small_world)
    path = exported(world, tmp_path / "glb", tile_cells=48, texture_pixels=PIXELS)
    scene = trimesh.load(path, process=False)
    for name, vertices, _ in placed(scene, "ground_"):
        mesh = scene.geometry[scene.graph[name][1]]
        pixels = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"))
        u, v = mesh.visual.uv.T  # trimesh turns v over: here it runs up
        assert shows_its_nodes(pixels, u, v, world, vertices)
    assert "KHR_texture_transform" not in glb_parts(path)[0]["extensionsUsed"]


def test_the_soils_normals_repeat_where_they_belong(small_world, glb, scene):
    text, arrays = glb_parts(glb)
    assert "KHR_texture_transform" in text["extensionsUsed"]
    looks = {material["name"]: material for material in text["materials"]}
    for name, vertices, _ in placed(scene, "ground_"):
        normals = looks[name]["normalTexture"]
        texture = text["textures"][normals["index"]]
        sampler = text["samplers"][texture["sampler"]]
        assert (sampler["wrapS"], sampler["wrapT"]) == (10497, 10497)
        place = normals["extensions"]["KHR_texture_transform"]
        mesh = scene.geometry[scene.graph[name][1]]
        part = next(m for m in text["meshes"] if m["name"] == name)["primitives"][0]
        tangents = arrays[part["attributes"]["TANGENT"]]
        upright = arrays[part["attributes"]["NORMAL"]]
        assert np.allclose(np.linalg.norm(tangents[:, :3], axis=1), 1, atol=1e-6)
        assert np.abs((tangents[:, :3] * upright).sum(axis=1)).max() < 1e-6
        across = np.cross(upright, tangents[:, :3]) * tangents[:, 3:]
        assert tangents[:, 0].min() > 0.8
        assert across[:, 1].min() > 0.8  # the image's top is north
        u, v = mesh.visual.uv.T
        down = np.stack([u, 1 - v], axis=-1)  # as in the file
        s, t = (down * place["scale"] + place["offset"]).T
        pixels = np.asarray(mesh.visual.material.normalTexture.convert("RGB"))
        assert shows_its_detail(pixels, s, 1 - t, detailed(small_world), vertices)


def test_without_the_soils_normals_rocks_alone_have_maps(small_world, tmp_path):
    world = worlds.with_horizon(detailed(small_world))
    text, _ = glb_parts(exported(world, tmp_path / "glb", soil_normals=False))
    assert "KHR_texture_transform" not in text["extensionsUsed"]
    bumpy = {look["name"] for look in text["materials"] if "normalTexture" in look}
    assert bumpy
    assert not [name for name in bumpy if name.startswith(("ground", "horizon"))]
    (ground,) = (mesh for mesh in text["meshes"] if mesh["name"] == "ground_000")
    assert "TANGENT" not in ground["primitives"][0]["attributes"]


def test_rocks_show_the_texture_where_their_shape_says(small_world, scene):
    field = small_world.field
    row = int(field.diameter.argmax())
    mesh = scene.geometry[scene.graph[f"rock_{field.id[row]}"][1]]
    cut, uvs = skin(small_world.library.prototypes[field.prototype[row]])
    wanted = np.concatenate([cut.vertices[cut.faces], uvs], axis=2)
    found = np.concatenate([mesh.vertices[mesh.faces], mesh.visual.uv[mesh.faces]], axis=2)
    assert np.allclose(found, wanted, atol=1e-6)
    look = mesh.visual.material
    image = np.asarray(look.baseColorTexture.convert("RGB"))
    population = int(field.population[row])
    assert np.array_equal(image, rock_texture(small_world, population, tinted=True))
    colours = tint_colours(small_world)[population]
    tint = rock_tints(field.id[row : row + 1], small_world.site.seed)[0]
    factor = np.asarray(look.baseColorFactor)[:3] / 255.0
    assert np.allclose(factor * colours.max(axis=0), colours[tint], atol=0.005)
    normals, roughness = rock_maps(small_world)
    assert np.array_equal(np.asarray(look.normalTexture.convert("RGB")), normals)
    rough = np.asarray(look.metallicRoughnessTexture.convert("RGB"))
    assert np.array_equal(rough[..., 1], roughness)


def test_merged_rocks_have_their_own_colours_and_dust_on_top(small_world, glb):
    """What factor and vertices show together is a rock's colour below, mostly soil above."""
    text, arrays = glb_parts(glb)
    soil = linear_from_srgb(small_world.site.body.ground_rgb)
    looks = {look["name"]: look for look in text["materials"]}
    corners = {node["name"]: node["translation"] for node in text["nodes"] if "translation" in node}
    seen = 0
    for population, name in enumerate(small_world.field.populations):
        bare = tint_colours(small_world)[population]
        for mesh in text["meshes"]:
            if f"_{name}" not in mesh["name"] or "rock_shape" in mesh["name"]:
                continue
            part = mesh["primitives"][0]["attributes"]
            colours = arrays[part["COLOR_0"]]
            up = arrays[part["NORMAL"]][:, 2]
            assert (colours[:, 3] == 255).all()
            factor = looks[f"{name}_merged"]["pbrMetallicRoughness"]["baseColorFactor"][:3]
            shown = colours[:, :3] / 255.0 * factor
            places = arrays[part["POSITION"]] + corners[mesh["name"]]
            rocks = small_world.field.select(small_world.field.population == population)
            away = np.linalg.norm(places[:, None] - rocks.position, axis=2) / rocks.scale
            own = bare[rock_tints(rocks.id, small_world.site.seed)[away.argmin(axis=1)]]
            sure = np.sort(away, axis=1)[:, :2] @ [-1.0, 1.0] > 1.0
            assert np.allclose(shown[sure & (up < 0.3)], own[sure & (up < 0.3)], atol=0.006)
            above = sure & (up > 0.9)
            wanted = own + 0.55 * (soil - own)
            assert np.allclose(shown[above], wanted[above], atol=0.006)
            seen += len(np.unique(own[above], axis=0))
    assert seen > 3


def test_the_sun_shines_from_where_it_stands(small_world, glb, tmp_path):
    text, _ = glb_parts(glb)
    node = next(node for node in text["nodes"] if node["name"] == "sun")
    shines = Rotation.from_quat(node["rotation"]).apply([0, 0, -1])
    assert np.allclose(shines, -small_world.lighting.towards_sun, atol=1e-12)
    root = text["nodes"][text["scenes"][text["scene"]]["nodes"][0]]
    up = Rotation.from_quat(root["rotation"]).apply([0, 0, 1])
    assert np.allclose(up, [0, 1, 0])
    light, lamp = text["extensions"]["KHR_lights_punctual"]["lights"]
    assert light["type"] == "directional"
    level = light["intensity"] * small_world.lighting.towards_sun[2] / np.pi
    assert 0.5 < level < 1.0  # of its own albedo, in viewers that take lux as they stand
    assert lamp["range"] < 0.01
    real, _ = glb_parts(exported(small_world, tmp_path / "real", lights="physical"))
    (light,) = real["extensions"]["KHR_lights_punctual"]["lights"]
    assert light["intensity"] == pytest.approx(98 * small_world.lighting.irradiance)
    dim, _ = glb_parts(exported(small_world, tmp_path / "dim", sun_lux=3))
    assert dim["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] == 3


def test_a_quaternion_never_flips_over(small_world, tmp_path):
    rpy = small_world.trajectories[0].rpy.copy()
    rpy[:, 2] = np.linspace(0, 40, len(rpy))
    trajectory = small_world.trajectories[0].replace(rpy=rpy)
    path = exported(small_world.replace(trajectories=(trajectory,)), tmp_path / "glb")
    text, arrays = glb_parts(path)
    turns = arrays[text["animations"][0]["samplers"][1]["output"]]
    assert (turns[1:] * turns[:-1]).sum(axis=1).min() > 0.9


def test_names_survive(small_world, tmp_path):
    name = 'Gale "crater" <7> Ωå 火星'
    world = small_world.replace(
        site=small_world.site.replace(name=name),
        field=small_world.field.replace(populations=("кiesel & co", "boulders")),
        trajectories=(small_world.trajectories[0].replace(name="zum Großen Stein"),),
    )
    text, _ = glb_parts(exported(world, tmp_path / "glb"))
    assert text["nodes"][0]["name"] == name
    assert text["nodes"][1]["name"] == "path_zum Großen Stein"
    assert any("кiesel & co" in material["name"] for material in text["materials"])


def test_a_bare_world_without_paths(small_world, tmp_path):
    text, _ = glb_parts(exported(worlds.bare(small_world, trajectories=()), tmp_path / "glb"))
    assert "animations" not in text
    assert [node["name"] for node in text["nodes"]] == [
        *("by-hand", "sun", "sun_for_blender", "ground_000")
    ]


def test_the_lamp_for_blender_lights_a_world_without_a_horizon_evenly(small_world, glb):
    assert small_world.horizon is None
    text, _ = glb_parts(glb)
    lamp = next(node for node in text["nodes"] if node["name"] == "sun_for_blender")
    west, south, east, north = small_world.ground.bounds
    corners = np.array([[e, n, 0.0] for e in (west, east) for n in (south, north)])
    away = np.array(lamp["translation"]) - corners
    off = np.linalg.norm(away, axis=1)
    sun = small_world.lighting.towards_sun
    assert np.degrees(np.arccos(away @ sun / off)).max() < 1.0
    assert (off.max() / off.min()) ** 2 < 1.06


@pytest.mark.parametrize("air", [True, False])
def test_the_sky_is_bright_through_air_and_else_black(small_world, tmp_path, air):
    colour = (0.78, 0.5, 0.4) if air else (0.0, 0.0, 0.0)
    world = worlds.with_horizon(small_world)
    world = world.replace(lighting=world.lighting.replace(sky_rgb=colour, dust=None))
    text, _ = glb_parts(exported(world, tmp_path / "glb"))
    assert "sky" in [node["name"] for node in text["nodes"]]
    look = next(material for material in text["materials"] if material["name"] == "sky")
    assert look["pbrMetallicRoughness"]["baseColorFactor"] == [0.0, 0.0, 0.0, 1.0]
    assert (max(look["emissiveFactor"]) > 0.0) == air


@pytest.mark.parametrize("module", ["writers.glb", "exporters.glb.writing"])
def test_what_a_glb_cannot_hold(small_world, tmp_path, monkeypatch, module):
    monkeypatch.setattr(import_module(f"terrain_forge.{module}"), "LARGEST_FILE", 100_000)
    with pytest.raises(ExportError, match=r"4 GiB.*choose"):
        exported(small_world, tmp_path / "glb")


def test_losses_name_what_is_merged(small_world, tmp_path):
    directory = tmp_path / "glb"
    directory.mkdir()
    report = export(small_world, directory, options=Options(instances_min_m=0.5))
    small = int((small_world.field.diameter < 0.5).sum())
    assert any(loss.startswith(f"{small} rocks below 0.5 m are merged") for loss in report.losses)


VALIDATE = """
const fs = require("fs");
require("gltf-validator").validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])))
  .then((report) => console.log(JSON.stringify(report.issues)));
"""


def gltf_issues(path):
    """What Khronos' validator says of a file; `npm install gltf-validator`."""
    return run_node("gltf-validator", VALIDATE, path)


@pytest.mark.consumer
def test_khronos_validator_finds_nothing(glb):
    issues = gltf_issues(glb)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


def test_nodes_are_json_as_python_writes_it(small_world):
    """Whatever the numbers: whole, negative, tiny, far away."""
    field = small_world.field
    random = np.random.default_rng(8)
    position = random.normal(0.0, 1.0, (len(field), 3)) * 10.0 ** random.integers(-8, 5, (40, 3))
    position[0], position[1] = (0.0, -0.0, 1.0), (-4e-8, 123456.0, -7.0)
    rocks = field.replace(
        position=position, id=(7 ** np.arange(20, dtype=np.int64)).repeat(2) % 2**31
    )
    meshes = np.arange(40) * 999
    nodes = json.loads(f"[{','.join(node_texts(rocks, meshes))}]")
    assert [node["name"] for node in nodes] == [f"rock_{rock}" for rock in rocks.id]
    assert [node["mesh"] for node in nodes] == meshes.tolist()
    assert np.abs([node["translation"] for node in nodes] - position).max() <= 0.51e-7
    turns = np.array([node["rotation"] for node in nodes])
    assert np.abs(turns - np.roll(field.quaternion, -1, axis=1)).max() <= 0.51e-7
    assert np.abs([node["scale"] for node in nodes] - field.scale[:, None]).max() <= 0.51e-7


def test_many_merged_rocks_become_several_meshes(small_world, tmp_path, monkeypatch):
    """So that memory does not grow with their number; together they are the same."""
    files = []
    for part in (1000, 7):
        monkeypatch.setattr("terrain_forge.geometry.rock_mesh.PART", part)
        (tmp_path / str(part)).mkdir()
        export(small_world, tmp_path / str(part), options=Options(instances_min_m=9.0))
        files.append(trimesh.load(tmp_path / str(part) / "world.glb", process=False))
    one, many = (
        {name: mesh for name, mesh in file.geometry.items() if name.startswith("rocks")}
        for file in files
    )
    assert len(one) == 2
    assert len(many) > 4
    assert sum(len(m.faces) for m in many.values()) == sum(len(m.faces) for m in one.values())
