"""The USD export: its layers, ground and craters."""

import numpy as np
import pytest
from PIL import Image
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, UsdSemantics, UsdShade
from terrain_forge.exporters.usd import Options, export

from terrain_forge.base import ExportError, matrix_from_quaternion, quaternion_from_rpy
from terrain_forge.making import plan
from terrain_forge.pipeline import realise
from terrain_forge.terrain import CraterLayer
from tests.helpers import worlds
from tests.helpers.ground_pictures import (
    PIXELS,
    detailed,
    shows_its_detail,
    shows_its_nodes,
    speckled,
)
from tests.helpers.recipes import flat
from tests.helpers.usd_stages import exported, findings, labelled, world_mesh


def test_no_validator_finds_anything(usd):
    for path in sorted(usd.rglob("*.usd*")):
        assert findings(Usd.Stage.Open(str(path))) == [], path


def test_the_validators_would_find_something(tmp_path):
    broken = Usd.Stage.CreateNew(str(tmp_path / "broken.usda"))
    broken.DefinePrim("/World").GetReferences().AddReference("./missing.usdc")
    assert findings(broken)


def test_every_layer_keeps_the_conventions(usd):
    layers = sorted(usd.rglob("*.usd*"))
    assert len(layers) == 2 + 1 + 2 * 4
    for path in layers:
        stage = Usd.Stage.Open(str(path))
        assert stage.GetDefaultPrim().IsValid(), path
        assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
        assert UsdGeom.GetStageMetersPerUnit(stage) == 1
        assert UsdPhysics.GetStageKilogramsPerUnit(stage) == 1


def test_the_ground_collides_as_it_is(stage):
    tiles = list(labelled(stage, "ground"))
    assert len(tiles) == 4
    for prim in tiles:
        assert prim.HasAPI(UsdPhysics.CollisionAPI)
        approximation = UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get()
        assert approximation == UsdPhysics.Tokens.none


def test_the_texture_lies_the_right_way(small_world, tmp_path):
    world = speckled(small_world)
    directory = exported(world, tmp_path / "usd", tile_cells=48, texture_pixels=PIXELS)
    stage = Usd.Stage.Open(str(directory / "world.usda"))
    for prim in labelled(stage, "ground"):
        u, v = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").Get(), float).T
        image = source(surface(prim), "diffuseColor")
        assert value(image, "sourceColorSpace") == "sRGB"
        with Image.open(value(image, "file").resolvedPath) as picture:
            assert shows_its_nodes(np.asarray(picture), u, v, world, world_mesh(prim)[0])
        assert not surface(prim).GetInput("normal")


def test_the_soils_normals_repeat_where_they_belong(small_world, stage):
    world = detailed(small_world)
    for prim in labelled(stage, "ground"):
        st = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("st").Get(), float)
        image = source(surface(prim), "normal")
        assert (value(image, "wrapS"), value(image, "wrapT")) == ("repeat", "repeat")
        place = source(image, "st")
        assert value(source(place, "in"), "varname") == "st"
        s, t = (st * value(place, "scale") + value(place, "translation")).T
        with Image.open(value(image, "file").resolvedPath) as picture:
            pixels = np.asarray(picture)
        assert shows_its_detail(pixels, s, t, world, world_mesh(prim)[0])


def test_soil_and_rocks_have_no_gloss(stage):
    looks = [UsdShade.Material(prim) for prim in stage.Traverse() if prim.IsA(UsdShade.Material)]
    shaders = [shader for look in looks if (shader := look.ComputeSurfaceSource()[0])]
    textured = [s for s in shaders if s.GetInput("diffuseColor").HasConnectedSource()]
    assert {s.GetInput("ior").Get() for s in textured} == {1.0}


def surface(prim):
    """The shader of a prim's look."""
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    return material.ComputeSurfaceSource()[0]


def source(shader, name):
    """The shader that an input is connected to."""
    return UsdShade.Shader(shader.GetInput(name).GetConnectedSources()[0][0].source.GetPrim())


def value(shader, name):
    return shader.GetInput(name).Get()


def test_a_world_without_rocks_and_paths(small_world, tmp_path):
    directory = exported(worlds.bare(small_world, trajectories=()), tmp_path / "usd")
    assert findings(Usd.Stage.Open(str(directory / "scene.usda"))) == []


@pytest.mark.parametrize("name", ["火星 'x\"", "a-b", "7 rounds"])
def test_any_name_will_do(small_world, tmp_path, name):
    path = small_world.trajectories[0].replace(name=name)
    world = small_world.replace(site=small_world.site.replace(name=name), trajectories=(path,))
    directory = exported(world, tmp_path / "usd")
    stage = Usd.Stage.Open(str(directory / "scene.usda"))
    assert len(stage.GetPrimAtPath("/World/Paths").GetChildren()) == 1
    assert findings(stage) == []


def test_a_file_that_is_open_is_a_clear_error(small_world, tmp_path):
    directory = tmp_path / "usd"
    directory.mkdir()
    still_open = Sdf.Layer.CreateNew(str(directory / "world.usda"))
    with pytest.raises(ExportError, match="open as a USD stage"):
        export(small_world, directory, options=Options())
    del still_open


def test_losses_are_named(small_world, tmp_path):
    (tmp_path / "usd").mkdir()
    losses = " ".join(export(small_world, tmp_path / "usd", options=Options()).losses)
    for word in (
        "fixed",
        "share colliders",
        "made for display",
        "half-precision",
        "without a normal map",
    ):
        assert word in losses


def test_a_big_world_opens_without_its_tiles(usd):
    """Each tile is a payload: what is not asked for is not read."""
    stage = Usd.Stage.Open(str(usd / "world.usda"), Usd.Stage.LoadNone)
    layers = {layer.GetDisplayName() for layer in stage.GetUsedLayers()}
    assert not any(name.startswith(("ground_", "rocks_")) for name in layers)
    tiles = [p for p in stage.TraverseAll() if p.HasAuthoredPayloads()]
    assert len(tiles) == 8
    ground = stage.Load(tiles[0].GetPath())
    assert len(list(labelled(stage, "ground"))) == 1
    assert ground.GetName() == "ground_000"


@pytest.fixture(scope="module")
def cratered(tmp_path_factory):
    """A level Moon: a fresh crater across two tiles, one at the edge, one worn away."""
    folder = tmp_path_factory.mktemp("cratered")
    rows = ["x_m,y_m,diameter_m,age_ga", "1,-2,6,0", "-11.5,3,4,0", "8,4,1.2,3.5"]
    (folder / "craters.csv").write_text("\n".join(rows) + "\n")
    layers = {"layers": (CraterLayer(file="craters.csv"),)}
    recipe = flat((24, 16), 0.25, terrain=layers, shapes=1, body="moon")
    world = realise(plan(recipe, folder=folder))
    return exported(world, folder / "usd", tile_cells=48)


def test_the_faces_within_craters_are_labelled(cratered):
    stage = Usd.Stage.Open(str(cratered / "world.usda"))
    assert findings(stage) == []
    fresh = [((1, -2), 3.0), ((-11.5, 3), 2.0)]
    total = 0
    for prim in labelled(stage, "ground"):
        vertices, faces = world_mesh(prim)
        centres = vertices[faces].mean(axis=1)[:, :2]
        wanted = np.zeros(len(faces), bool)
        for centre, radius in fresh:
            wanted |= np.linalg.norm(centres - centre, axis=1) <= radius
        subset = UsdGeom.Subset(stage.GetPrimAtPath(prim.GetPath().AppendChild("craters")))
        found = subset.GetIndicesAttr().Get() if subset else []
        assert np.array_equal(found, np.flatnonzero(wanted))
        if subset:
            labels = UsdSemantics.LabelsAPI(subset.GetPrim(), "class").GetLabelsAttr().Get()
            assert list(labels) == ["crater"]
        total += wanted.sum()
    assert total > 500


def test_turns_too_small_for_single_precision_are_made(tmp_path):
    """OpenUSD takes the angle from a quaternion's real part, which is 1 for them in floats."""
    world = worlds.world()
    (arc,) = world.trajectories
    leaning = np.tile([2e-4, -3e-4, 1e-4], (len(arc.time), 1))
    out = exported(world.replace(trajectories=(arc.replace(rpy=leaning),)), tmp_path / "usd")
    stage = Usd.Stage.Open(str(out / "scene.usda"))
    frame = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Paths/arc"))
    found = np.array(frame.ComputeLocalToWorldTransform(Usd.TimeCode(3.0)))[:3, :3].T
    wanted = matrix_from_quaternion(quaternion_from_rpy(leaning[0]))
    assert np.abs(found - wanted).max() < 1e-7
