"""The USD export: rocks, seen and touched, fixed and dynamic."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade
from terrain_forge.exporters.usd import Options, export

from terrain_forge.geometry import rock_factors, skin
from terrain_forge.geometry.rock_mesh import outline_error
from terrain_forge.model import Mesh, rotations
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import rock_tints
from tests.helpers import worlds
from tests.helpers.usd_stages import exported, findings, frictions, labelled, world_mesh


def test_large_rocks_collide_as_instances_of_their_hulls(small_world, stage):
    field, turns = small_world.field, rotations(small_world.field)
    found = {}
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
        if prim.GetName().startswith("part_") and prim.HasAPI(UsdPhysics.CollisionAPI):
            rock = prim.GetParent()
            assert rock.IsInstance()
            approximation = UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get()
            assert approximation == UsdPhysics.Tokens.convexHull
            assert UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.guide
            found[int(rock.GetName().removeprefix("rock_"))] = world_mesh(prim)[0]
    large = np.flatnonzero(field.diameter >= 0.5)
    assert sorted(found) == large.tolist()
    for row in large:
        hull = small_world.library.prototypes[field.prototype[row]].hulls[0]
        wanted = field.scale[row] * hull.vertices @ turns[row].T + field.position[row]
        assert np.allclose(found[row], wanted, atol=1e-5)


def test_small_rocks_share_a_collider(stage):
    merged = [p for p in stage.Traverse() if p.GetName() == "small"]
    assert merged
    for prim in merged:
        assert prim.HasAPI(UsdPhysics.CollisionAPI)
        assert UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.guide


@pytest.fixture(scope="module")
def loosened(small_world):
    return worlds.loosened(small_world)


@pytest.fixture(scope="module")
def dynamic_usd(loosened, tmp_path_factory):
    return exported(loosened, tmp_path_factory.mktemp("dynamic") / "usd", tile_cells=48)


def test_no_validator_finds_anything_about_dynamic_rocks(dynamic_usd):
    for path in sorted(dynamic_usd.rglob("*.usd*")):
        assert findings(Usd.Stage.Open(str(path))) == [], path


# The successor that usd-core 26.11 names cannot be called from Python.
@pytest.mark.filterwarnings("ignore:LoadUsdPhysicsFromRange:DeprecationWarning")
def test_dynamic_rocks_are_bodies_as_physics_reads_them(loosened, dynamic_usd):
    stage = Usd.Stage.Open(str(dynamic_usd / "world.usda"))
    field, turns = loosened.field, rotations(loosened.field)
    read = UsdPhysics.LoadUsdPhysicsFromRange(stage, [stage.GetPseudoRoot().GetPath()])
    paths, bodies = read[UsdPhysics.ObjectType.RigidBody]
    pairs = zip(paths, bodies, strict=True)
    found = {int(str(path).rsplit("_", 1)[1]): (path, body) for path, body in pairs}
    assert sorted(found) == field.id[field.dynamic].tolist()
    for row in np.flatnonzero(field.dynamic):
        path, body = found[field.id[row]]
        assert np.allclose(body.position, field.position[row], atol=1e-5)
        assert np.allclose(np.array(body.scale), 1)
        parts = [str(collision) for collision in body.collisions]
        shape = loosened.library.prototypes[field.prototype[row]]
        assert len(parts) == len(shape.hulls)
        vertices, _ = world_mesh(stage.GetPrimAtPath(parts[0]))
        wanted = field.scale[row] * shape.hulls[0].vertices @ turns[row].T + field.position[row]
        assert np.allclose(vertices, wanted, atol=1e-5)
        visual = stage.GetPrimAtPath(f"{path}/visual")
        assert visual.IsInstance()
        shown = visual.GetPrototype().GetChildren()[0]  # what is instanced has its material itself
        look = UsdShade.MaterialBindingAPI(shown).GetDirectBinding().GetMaterial()
        population, tint = field.population[row], rock_tints(field.id, loosened.site.seed)[row]
        assert look.GetPath().name == f"rock_{population}_{tint}"
        prim = stage.GetPrimAtPath(parts[0])
        bound = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0]
        friction = UsdPhysics.MaterialAPI(bound.GetPrim()).GetDynamicFrictionAttr().Get()
        assert friction == pytest.approx(dynamic_contact(field.diameter[row]).sliding)


def test_physics_reads_one_friction_of_each_collider(loosened, dynamic_usd):
    stage = Usd.Stage.Open(str(dynamic_usd / "world.usda"))
    read, body = frictions(stage), loosened.site.body.friction
    assert {path.split("/")[2] for path in read} == {"Ground", "Rocks"}
    for path, found in read.items():
        wanted = body.regolith if "/Ground/" in path else body.rock
        assert found == [pytest.approx(wanted.coefficient)], path


def test_rocks_visual_only_are_seen_and_not_touched(loosened, dynamic_usd):
    stage = Usd.Stage.Open(str(dynamic_usd / "world.usda"))
    field = loosened.field
    fixed = field.id[~field.dynamic].tolist()
    instancers = [p for p in labelled(stage, "rock") if p.IsA(UsdGeom.PointInstancer)]
    ids = [n for prim in instancers for n in UsdGeom.PointInstancer(prim).GetIdsAttr().Get()]
    assert sorted(ids) == fixed
    large = field.collides & ~field.dynamic & (field.diameter >= 0.5)
    hulls = [p.GetName() for p in stage.Traverse() if p.GetParent().GetName() == "colliders"]
    names = sorted(name for name in hulls if name.startswith("rock_"))
    assert names == sorted(f"rock_{n}" for n in field.id[large])


def test_every_convex_part_is_a_collider(loosened, tmp_path):
    shapes = [p.replace(hulls=(*p.hulls, *p.hulls)) for p in loosened.library.prototypes]
    world = loosened.replace(library=loosened.library.replace(prototypes=tuple(shapes)))
    directory = exported(world, tmp_path / "usd", collider_min_m=0)
    stage = Usd.Stage.Open(str(directory / "world.usda"))
    parts = [
        prim.GetName()
        for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())
        if prim.GetName().startswith("part_") and prim.HasAPI(UsdPhysics.CollisionAPI)
    ]
    assert parts == ["part_0", "part_1"] * world.field.collides.sum()


def test_rocks_show_their_populations_texture(small_world, stage, usd):
    for prim in labelled(stage, "rock"):
        population, tint = map(int, prim.GetName().removeprefix("visual_").split("_"))
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        image = UsdShade.Shader(stage.GetPrimAtPath(material.GetPath().AppendChild("image")))
        file = image.GetInput("file").Get()
        assert file.resolvedPath == str(usd / "assets" / f"rock_{population}.png")
        factor = rock_factors(small_world, population)[tint]
        if (scale := image.GetInput("scale")) or not np.allclose(factor, 1.0):
            assert np.allclose(np.array(scale.Get())[:3], factor, atol=1e-6)
        assert material.ComputeSurfaceSource()[0].GetInput("normal").HasConnectedSource()
        assert material.ComputeSurfaceSource()[0].GetInput("roughness").HasConnectedSource()
        ids = UsdGeom.PointInstancer(prim).GetIdsAttr().Get()
        assert set(rock_tints(np.array(ids, np.int32), small_world.site.seed)) == {tint}
        assert image.GetInput("wrapS").Get() == image.GetInput("wrapT").Get() == "repeat"
        target = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetTargets()[0]
        mesh = stage.GetPrimAtPath(target.AppendChild("shape"))
        st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
        assert st.GetInterpolation() == UsdGeom.Tokens.faceVarying
        shape = small_world.library.prototypes[int(target.name.split("_")[1])]
        upright = not target.name.endswith("_turned")
        wanted = skin(shape, upright=upright)[1].reshape(-1, 2)
        assert np.allclose(np.array(st.Get()), wanted, atol=1e-6)


def test_the_outlines_of_small_rocks_are_within_the_option_and_said(small_world, tmp_path):
    """Drawn and touched: the level is the coarsest that is allowed, its error is in the losses."""
    shapes = tuple(coarser(shape) for shape in small_world.library.prototypes)
    world = small_world.replace(library=small_world.library.replace(prototypes=shapes))
    worst = 100 * max(shape.outline_errors[1] for shape in shapes)
    for allowed, level in ((0.5, 1), (0.001, 0)):
        (tmp_path / str(level)).mkdir()
        options = Options(outline_error=allowed, close_within_m=0)
        losses = " ".join(export(world, tmp_path / str(level), options=options).losses)
        assert losses.count(f"outlines off by up to {worst:.2g} %") == 2 * level
        assert losses.count("outlines") == 2 * level
        stage = Usd.Stage.Open(str(tmp_path / str(level) / "world.usda"))
        targets = [
            target.name
            for prim in labelled(stage, "rock")
            for target in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetTargets()
        ]
        small = world.field.diameter < 0.5
        assert {name[-1] for name in targets} == {"0", str(level)}
        assert small.any()


def coarser(shape):
    """The shape with a second level of detail whose outline is off by some percent."""
    finest = shape.meshes[0]
    mesh = Mesh(vertices=finest.vertices * 1.05, faces=finest.faces)
    error = outline_error(mesh, finest)
    hulls = (finest, finest)
    return shape.replace(
        meshes=(finest, mesh), uvs=shape.uvs * 2, outline_errors=(0.0, error), hulls=hulls
    )
