import json
import operator
import xml.etree.ElementTree as ET
from functools import partial

import numpy as np
import pytest
import trimesh
from PIL import Image

from terrain_forge.model import rotations
from tests.helpers import exports, sdf_files, worlds
from tests.helpers.ground_pictures import PIXELS, shows_its_nodes, speckled
from tests.helpers.pythons import asked

DRAKE = "{http://drake.mit.edu}"


exported = partial(exports.exported, "drake")


def mixed(world):
    """The world with two dynamic rocks and three that cannot be touched, one of these a large
    one."""
    field = world.field
    order = np.argsort(field.diameter)
    dynamic, solid = np.zeros(len(field), bool), np.ones(len(field), bool)
    dynamic[order[[5, -5]]] = True
    solid[order[[0, 1, -1]]] = False
    return world.replace(field=field.replace(dynamic=dynamic, collides=solid))


@pytest.fixture(scope="module")
def drake(small_world, tmp_path_factory):
    """The small world in four tiles, with rocks of all kinds."""
    return exported(mixed(small_world), tmp_path_factory.mktemp("drake") / "drake", tile_cells=48)


def models(directory):
    root = ET.parse(directory / "world.sdf").getroot()
    return {model.get("name"): model for model in root.find("world").iter("model")}


meshes = partial(sdf_files.meshes, file_of=operator.truediv)


def test_the_texture_lies_the_right_way(small_world, tmp_path):
    world = speckled(small_world)
    directory = exported(world, tmp_path / "drake", tile_cells=48, texture_pixels=PIXELS)
    assets = directory / "assets"
    found = sorted(assets.glob("ground_*.obj"))
    assert len(found) == 4
    for path in found:
        rows = [line.split() for line in path.read_text().splitlines()]
        vertices = np.array([row[1:] for row in rows if row[0] == "v"], float)
        u, v = np.array([row[1:] for row in rows if row[0] == "vt"], float).T
        with Image.open(path.with_suffix(".png")) as image:
            assert shows_its_nodes(np.asarray(image), u, v, world, vertices)
    text = (assets / "world.mtl").read_text()
    assert "newmtl ground_003" in text
    assert "map_Kd ground_003.png" in text


def test_every_reference_leads_to_a_file(drake):
    for uri in ET.parse(drake / "world.sdf").getroot().iter("uri"):
        assert (drake / uri.text).is_file()
    known = {}
    for line in (drake / "assets/world.mtl").read_text().splitlines():
        if line.startswith("newmtl"):
            name = line.split()[1]
        if line.startswith("map_Kd"):
            assert (drake / "assets" / line.split()[1]).is_file()
        known[name] = True
    for path in drake.glob("assets/*.obj"):
        lines = path.read_text().splitlines()
        used = [line.split()[1] for line in lines if line.startswith("usemtl")]
        assert set(used) <= set(known)
        assert bool(used) != ("hull" in path.name)
    assert ET.parse(drake / "package.xml").getroot().findtext("name") == "by-hand"


def test_the_ground_is_rigid(drake):
    ground = models(drake)["ground"]
    assert ground.findtext("static") == "true"
    contacts = [c.find(f"{DRAKE}proximity_properties") for c in ground.iter("collision")]
    assert len(contacts) == 4
    for contact in contacts:
        assert contact.find(f"{DRAKE}rigid_hydroelastic") is not None


def test_each_rock_is_fixed_or_dynamic_touched_or_seen(small_world, drake):
    field, found = mixed(small_world).field, models(drake)
    dynamic = {f"rock_{identity}" for identity in field.id[field.dynamic]}
    assert {name for name in found if name.startswith("rock_")} == dynamic
    fixed = [model for name, model in found.items() if name.startswith("rocks_")]
    single = (field.diameter >= 0.5) & ~field.dynamic
    for kind, wanted in (("visual", single), ("collision", single & field.collides)):
        names = {part.get("name") for model in fixed for part in model.iter(kind)}
        rocks = {name for name in names if name.startswith("rock_")}
        assert rocks == {f"rock_{identity}_{kind}" for identity in field.id[wanted]}
    assert (single & ~field.collides).any()
    merged = [
        [part for model in fixed for part in model.iter(kind) if "_seen" in part.get("name")]
        for kind in ("visual", "collision")
    ]
    assert merged[0]
    assert not merged[1]


@pytest.mark.parametrize("kind", ["visual", "collision"])
def test_fixed_rocks_are_where_they_are(small_world, drake, kind):
    field, turns = mixed(small_world).field, rotations(small_world.field)
    everything = np.concatenate(
        [
            vertices
            for name, model in models(drake).items()
            if name.startswith("rocks_")
            for _, vertices, _ in meshes(drake, model, kind)
        ]
    )
    wanted = ~field.dynamic & (field.collides | (kind == "visual"))
    assert wanted.sum() > 30
    for row in np.flatnonzero(wanted):
        shape = small_world.library.prototypes[field.prototype[row]].meshes[0]
        points = field.scale[row] * shape.vertices @ turns[row].T + field.position[row]
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1)):
            above = points[points[:, 2] > field.position[row, 2]]
            far = above[(sign * above[:, axis]).argmax()]
            apart = np.linalg.norm(everything - far, axis=1).min()
            assert apart < 1e-4 * field.diameter[row]


def test_a_bare_world(small_world, tmp_path):
    directory = exported(worlds.bare(small_world), tmp_path / "drake")
    assert list(models(directory)) == ["ground"]


def ask(directory, **order):
    """What Drake finds, in the Python that TERRAIN_FORGE_DRAKE_PYTHON names or else in ours."""
    text = json.dumps({"world": str(directory / "world.sdf"), "gravity": 3.711, **order})
    return asked("TERRAIN_FORGE_DRAKE_PYTHON", "pydrake", "drake_world.py", text=text)


@pytest.mark.consumer
def test_drake_gives_each_material_its_friction(small_world, tmp_path):
    halves = np.zeros(small_world.ground.shape)
    halves[:, halves.shape[1] // 2 :] = 1
    world = worlds.of_materials(small_world, halves, (0.66, 0.8))
    answer = ask(exported(world, tmp_path / "drake"))
    assert answer["complaints"] == []
    felt = {n: mu for n, mu in answer["frictions"].items() if n.startswith("ground::")}
    assert felt == {"ground::ground_000_0_collision": 0.66, "ground::ground_000_1_collision": 0.8}


@pytest.mark.consumer
@pytest.mark.parametrize("merged", [False, True])
def test_a_ball_rests_on_a_rock_in_drake(small_world, tmp_path, merged):
    field = small_world.field.select(np.array([small_world.field.diameter.argmax()]))
    world = small_world.replace(field=field)
    directory = exported(world, tmp_path / "drake", individual_min_m=10 if merged else 0)
    shape = world.library.prototypes[field.prototype[0]].meshes[0]
    placed = field.scale[0] * shape.vertices @ rotations(field)[0].T + field.position[0]
    x, y, _ = placed[placed[:, 2].argmax()]
    dense = trimesh.Trimesh(placed, shape.faces, process=False).subdivide_to_size(0.005)
    offset = ((dense.vertices[:, :2] - (x, y)) ** 2).sum(1)
    near = offset < 0.2**2
    wanted = float((dense.vertices[near, 2] + np.sqrt(0.2**2 - offset[near])).max())
    found = ask(directory, balls=[(x, y, wanted + 0.3)], seconds=4)["balls"]
    assert found == pytest.approx([wanted], abs=0.002)
