"""What outsiders measured with readers of their own: ground, tops, places and masses of rocks.

Every export of one world, read by hand, against the world and so against one another.
"""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from terrain_forge.making import plan
from terrain_forge.model import exporter, exporter_names
from terrain_forge.pipeline import realise
from tests.helpers import plain_worlds, worlds
from tests.helpers.places import ROOT
from tests.helpers.surfaces import random_points

POINTS = 20_000
PLUGIN = Path(__file__).parents[1] / "example_exporter" / "xyz_exporter.py"
ALL_ALONE = {"individual_min_m": 0.0, "texture_pixels": 1}
GARDEN = {"release": "garden", "normal_maps": False, **ALL_ALONE}
BARE = {"rocks": "none"}
READERS = {
    "drake": ("drake", ALL_ALONE, plain_worlds.read_sdf),
    "geotiff": ("geotiff", {}, plain_worlds.read_geotiff),
    "glb": (
        "glb",
        {"instances_min_m": 0.0, "outline_error": 0.0, "texture_pixels": 1},
        plain_worlds.read_glb,
    ),
    "mjcf": ("mjcf", {"texture_pixels": 1}, plain_worlds.read_mjcf),
    "mjcf whole": ("mjcf", {"texture_pixels": 1, "split_ground": False}, plain_worlds.read_mjcf),
    "mesh ply": ("mesh", {"format": "ply", **BARE}, plain_worlds.read_ply),
    "mesh stl": ("mesh", {"format": "stl", **BARE}, plain_worlds.read_corners),
    "mesh obj": ("mesh", {"format": "obj", "texture_pixels": 1, **BARE}, plain_worlds.read_corners),
    "sdf obj": ("sdf", {"normal_maps": False, **ALL_ALONE}, plain_worlds.read_sdf),
    "sdf glb": ("sdf", GARDEN, plain_worlds.read_sdf),
    "sdf classic": ("sdf", {"flavour": "classic", **ALL_ALONE}, plain_worlds.read_sdf),
    "usd": ("usd", {"outline_error": 0.0, "texture_pixels": 1}, plain_worlds.read_usd),
    "plugin": (str(PLUGIN), {}, plain_worlds.read_points),
}
NO_PLACE = {"rover"}
"""Exporters that write no world."""
WITH_ROCKS = [name for name, (kind, *_) in READERS.items() if kind in ("glb", "usd", "mjcf")]
WITH_ROCKS += ["drake", "sdf obj", "sdf glb", "sdf classic"]
WITH_MASSES = [name for name in WITH_ROCKS if name != "glb"]


def module_of(kind):
    """An exporter that is installed, or the file of one."""
    if not kind.endswith(".py"):
        return exporter(kind)
    spec = spec_from_file_location("plain_plugin", kind)
    sys.modules[spec.name] = module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module", params=["by hand", pytest.param("hello", marks=pytest.mark.slow)])
def world(request):
    """120 rocks made by hand, or all of a recipe, every fourth of them dynamic."""
    if request.param == "hello":
        made = realise(plan(ROOT / "recipes/hello.yaml"))
    else:
        made = worlds.world(rocks=120)
    dynamic = np.arange(len(made.field)) % 4 == 0
    return made.replace(field=made.field.replace(dynamic=dynamic))


@pytest.fixture(scope="module")
def read(world, tmp_path_factory):
    """Each export as a plain reader has it."""
    found = {}

    def reading(name):
        if name not in found:
            kind, options, reader = READERS[name]
            folder, module = tmp_path_factory.mktemp("export"), module_of(kind)
            module.export(world, folder, options=module.Options(**options))
            found[name] = reader(folder)
        return found[name]

    return reading


def places(world):
    """Turn and place of each rock, shape [rocks, 4, 4]."""
    places = np.tile(np.eye(4), (len(world.field), 1, 1))
    turns = Rotation.from_quat(world.field.quaternion, scalar_first=True)
    places[:, :3, :3], places[:, :3, 3] = turns.as_matrix(), world.field.position
    return places


def test_no_exporter_is_left_out():
    assert {kind for kind, *_ in READERS.values()} - {str(PLUGIN)} | NO_PLACE == set(
        exporter_names()
    )


@pytest.mark.parametrize("name", READERS)
def test_the_ground_at_20000_points(world, read, name):
    points = random_points(world.ground, POINTS, 71)
    triangles = np.concatenate(read(name).ground).astype(np.float64)
    found = plain_worlds.heights_under(triangles, points, world.ground.spacing)
    wanted = world.ground.height_at(points[:, 0], points[:, 1])
    assert np.abs(found - wanted).max() < 3e-6


@pytest.mark.parametrize("name", WITH_ROCKS)
def test_tops_of_the_rocks(world, read, name):
    """Those of MuJoCo are hulls, whose sizes are rounded by up to 1 %, those of OpenUSD may be too.

    OpenUSD turns instances by numbers of 16 bits.
    """
    field, tops = world.field, read(name).tops
    assert set(tops) == set(field.id.tolist())
    loss = {"mjcf": 0.007, "usd": 1e-3}.get(READERS[name][0], 0.0)
    for row, place in enumerate(places(world)):
        shape = world.library.prototypes[field.prototype[row]]
        rise = float((field.scale[row] * shape.meshes[0].vertices @ place[2, :3]).max())
        error = abs(tops[int(field.id[row])] - rise - place[2, 3])
        hull = shape.hull_distance * field.scale[row] if loss else 0.0
        assert error < 3e-6 + loss * field.scale[row] + hull, field.id[row]


@pytest.mark.parametrize("name", WITH_ROCKS)
def test_rocks_lie_alike_in_every_engine(world, read, name):
    found = read(name).places
    assert set(found) == set(world.field.id.tolist())
    stacked = np.stack([found[rock] for rock in world.field.id.tolist()])
    # OpenUSD instances have turns of 16 bits.
    turn = 2e-3 if name == "usd" else 1e-6
    worst = np.abs(stacked - places(world)).max(axis=0)
    assert worst[:3, :3].max() < turn
    assert worst[:3, 3].max() < 2e-6


@pytest.mark.parametrize("name", WITH_MASSES)
def test_masses_centres_and_inertias(world, read, name):
    field, bodies = world.field.select(world.field.dynamic), read(name).bodies
    assert set(bodies) == set(field.id.tolist())
    for row, rock in enumerate(field.id.tolist()):
        mass, centre, tensor = bodies[rock]
        shape = world.library.prototypes[field.prototype[row]]
        turn = Rotation.from_quat(field.quaternion[row], scalar_first=True).as_matrix()
        own = shape.inertia * (field.mass[row] / shape.volume) * field.scale[row] ** 2
        wanted = turn @ own @ turn.T
        assert mass == pytest.approx(field.mass[row], rel=1e-6)
        assert np.abs(centre - field.position[row]).max() < 2e-6
        assert np.abs(tensor - wanted).max() < 2e-6 * np.abs(wanted).max()
