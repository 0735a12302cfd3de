from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from pxr import (
    Gf,
    Sdf,
    Usd,
    UsdGeom,
    UsdLux,
    UsdPhysics,
    UsdRender,
    UsdSemantics,
    UsdShade,
    UsdValidation,
)
from terrain_forge.exporters.usd import Options, export

from terrain_forge.base import ExportError, matrix_from_quaternion, quaternion_from_rpy
from terrain_forge.dtm import FlatDtm
from terrain_forge.geometry import rock_factors, skin
from terrain_forge.geometry.rock_mesh import outline_error
from terrain_forge.making import plan
from terrain_forge.model import MARS, Mesh, rotations, simple_sensors
from terrain_forge.pipeline import realise
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.rocks import LibrarySpec, RocksSpec, dynamic_contact
from terrain_forge.scene import rock_tints
from terrain_forge.terrain import CraterLayer
from tests.helpers import worlds
from tests.helpers.ground_pictures import (
    PIXELS,
    detailed,
    shows_its_detail,
    shows_its_nodes,
    speckled,
)
from tests.helpers.rovers import morpheus
from tests.helpers.surfaces import random_points, top_under


def exported(world, directory, **options):
    directory.mkdir()
    report = export(world, directory, options=Options(**options))
    found = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    assert list(report.files) == found
    return directory


@pytest.fixture(scope="module")
def usd(small_world, tmp_path_factory):
    """The small world with a rover, in four tiles."""
    world = detailed(small_world.replace(rover=morpheus()))
    return exported(world, tmp_path_factory.mktemp("usd") / "usd", tile_cells=48)


@pytest.fixture(scope="module")
def stage(usd):
    return Usd.Stage.Open(str(usd / "scene.usda"))


def findings(stage):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    return [(error.GetName(), error.GetMessage()) for error in errors]


def world_mesh(prim):
    """Vertices in the world frame and faces of a mesh."""
    mesh = UsdGeom.Mesh(prim)
    matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim))
    points = np.array(mesh.GetPointsAttr().Get(), float) @ matrix[:3, :3] + matrix[3, :3]
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    return points, np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)


def labelled(stage, name):
    for prim in stage.Traverse():
        if prim.HasAPI(UsdSemantics.LabelsAPI):
            labels = UsdSemantics.LabelsAPI(prim, "class").GetLabelsAttr().Get()
            if list(labels) == [name]:
                yield prim


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


def test_gravity_and_sun(small_world, stage):
    scenes = [p for p in stage.Traverse() if p.IsA(UsdPhysics.Scene)]
    assert len(scenes) == 1
    scene = UsdPhysics.Scene(scenes[0])
    assert scene.GetGravityMagnitudeAttr().Get() == pytest.approx(small_world.site.body.gravity)
    assert scene.GetGravityDirectionAttr().Get() == Gf.Vec3f(0, 0, -1)
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun"))
    matrix = UsdGeom.XformCache().GetLocalToWorldTransform(sun.GetPrim())
    shines = matrix.TransformDir(Gf.Vec3d(0, 0, -1))
    assert np.allclose(shines, -small_world.lighting.towards_sun, atol=1e-6)


def test_the_ground_reads_back_and_collides_as_it_is(small_world, stage):
    tiles = list(labelled(stage, "ground"))
    assert len(tiles) == 4
    points = random_points(small_world.ground, 2000, 10)
    heights = np.full(len(points), -np.inf)
    for prim in tiles:
        heights = np.maximum(heights, top_under(*world_mesh(prim), points))
        assert prim.HasAPI(UsdPhysics.CollisionAPI)
        approximation = UsdPhysics.MeshCollisionAPI(prim).GetApproximationAttr().Get()
        assert approximation == UsdPhysics.Tokens.none
    wanted = small_world.ground.height_at(points[:, 0], points[:, 1])
    assert np.abs(heights - wanted).max() < 1e-5


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


def surface(prim):
    """The shader of a prim's look."""
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    return material.ComputeSurfaceSource()[0]


def source(shader, name):
    """The shader that an input is connected to."""
    return UsdShade.Shader(shader.GetInput(name).GetConnectedSources()[0][0].source.GetPrim())


def value(shader, name):
    return shader.GetInput(name).Get()


def test_rocks_in_pictures_stand_where_they_are(small_world, stage):
    field, turns = small_world.field, rotations(small_world.field)
    seen = []
    for prim in labelled(stage, "rock"):
        instancer = UsdGeom.PointInstancer(prim)
        matrices = instancer.ComputeInstanceTransformsAtTime(0, 0)
        targets = instancer.GetPrototypesRel().GetTargets()
        for row, index, matrix in zip(
            instancer.GetIdsAttr().Get(),
            instancer.GetProtoIndicesAttr().Get(),
            matrices,
            strict=True,
        ):
            values = np.array(matrix)
            assert np.allclose(values[3, :3], field.position[row], atol=1e-5)
            assert np.allclose(values[:3, :3].T / field.scale[row], turns[row], atol=1e-3)
            mesh = UsdGeom.Mesh(stage.GetPrimAtPath(targets[index].AppendChild("shape")))
            shape = small_world.library.prototypes[field.prototype[row]].meshes[0]
            assert np.allclose(mesh.GetPointsAttr().Get(), shape.vertices, atol=1e-6)
            seen.append(row)
    assert sorted(seen) == field.id.tolist()


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


def test_small_rocks_share_a_collider(small_world, stage):
    merged = [p for p in stage.Traverse() if p.GetName() == "small"]
    vertices = np.concatenate([world_mesh(prim)[0] for prim in merged])
    for prim in merged:
        assert prim.HasAPI(UsdPhysics.CollisionAPI)
        assert UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.guide
    field, turns = small_world.field, rotations(small_world.field)
    for row in np.flatnonzero(field.diameter < 0.5):
        shape = small_world.library.prototypes[field.prototype[row]].meshes[0]
        placed = field.scale[row] * shape.vertices @ turns[row].T + field.position[row]
        top = placed[placed[:, 2].argmax()]
        assert np.linalg.norm(vertices - top, axis=1).min() < 1e-5


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
        mass = UsdPhysics.MassAPI(stage.GetPrimAtPath(path))
        assert mass.GetMassAttr().Get() == pytest.approx(field.mass[row], rel=1e-6)
        q = mass.GetPrincipalAxesAttr().Get()
        axes = matrix_from_quaternion(np.array([q.GetReal(), *q.GetImaginary()]))
        tensor = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
        solid = trimesh.Trimesh(shape.meshes[0].vertices * field.scale[row], shape.meshes[0].faces)
        solid.density = field.mass[row] / field.volume[row]
        assert np.allclose(tensor, solid.moment_inertia, atol=1e-5 * np.abs(tensor).max())
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


def test_the_rover_replays_the_trajectory(small_world, stage):
    trajectory = small_world.trajectories[0]
    rate = stage.GetTimeCodesPerSecond()
    assert rate == 12
    assert stage.GetEndTimeCode() == pytest.approx(trajectory.time[-1] * rate)
    base = stage.GetPrimAtPath("/World/Paths/arc")
    turns = matrix_from_quaternion(trajectory.quaternion)
    for sample in (0, 1, 77, 239):
        cache = UsdGeom.XformCache(trajectory.time[sample] * rate)
        matrix = np.array(cache.GetLocalToWorldTransform(base))
        assert np.allclose(matrix[3, :3], trajectory.position[sample], atol=1e-12)
        assert np.allclose(matrix[:3, :3].T, turns[sample], atol=1e-6)


def test_between_the_samples_the_replay_stays_on_the_path(small_world, stage):
    trajectory = small_world.trajectories[0]
    base = stage.GetPrimAtPath("/World/Paths/arc")
    times = np.random.default_rng(11).uniform(1, 18, 300)
    wanted = trajectory.at(times)
    turns = matrix_from_quaternion(wanted.quaternion)
    for n, time in enumerate(times.tolist()):
        cache = UsdGeom.XformCache(time * stage.GetTimeCodesPerSecond())
        matrix = np.array(cache.GetLocalToWorldTransform(base))
        assert np.linalg.norm(matrix[3, :3] - wanted.position[n]) < 0.005
        assert np.abs(matrix[:3, :3].T - turns[n]).max() < 0.005


def test_cameras_look_where_the_sensors_do(small_world, stage):
    rover = morpheus()
    cameras = [sensor for sensor in simple_sensors(rover.sensors) if sensor.view]
    assert len(cameras) == 2
    cache = UsdGeom.XformCache(0)
    base = small_world.trajectories[0]
    turn = matrix_from_quaternion(base.quaternion[0])
    for sensor in cameras:
        prim = stage.GetPrimAtPath(f"/World/Paths/arc/{sensor.name}/camera")
        matrix = cache.GetLocalToWorldTransform(prim)
        pitch = sensor.rpy[1]
        ahead = turn @ (np.cos(pitch), 0, -np.sin(pitch))
        assert np.allclose(matrix.TransformDir(Gf.Vec3d(0, 0, -1)), ahead, atol=1e-6)
        assert np.allclose(matrix.TransformDir(Gf.Vec3d(1, 0, 0)), turn @ (0, -1, 0), atol=1e-6)
        place = turn @ sensor.position + base.position[0]
        assert np.allclose(matrix.ExtractTranslation(), place, atol=1e-6)
        camera = UsdGeom.Camera(prim).GetCamera(Usd.TimeCode(0))
        view = camera.GetFieldOfView(Gf.Camera.FOVHorizontal)
        assert np.radians(view) == pytest.approx(np.radians(85))


def test_payloads_let_a_large_world_open_at_once(usd):
    stage = Usd.Stage.Open(str(usd / "world.usda"), Usd.Stage.LoadNone)
    assert not [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert len(stage.FindLoadable()) == 8


def test_a_world_without_rocks_and_paths(small_world, tmp_path):
    nothing = small_world.field.select(np.zeros(len(small_world.field), bool))
    world = small_world.replace(field=nothing, trajectories=())
    directory = exported(world, tmp_path / "usd")
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


@pytest.mark.parametrize("lights", ["display", "physical"])
def test_lights_are_for_display_or_as_in_nature(small_world, tmp_path, lights):
    """For display level white ground is less than white where a renderer takes light as it is."""
    told = export(small_world, tmp_path, options=Options(lights=lights)).losses
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun")).GetIntensityAttr().Get()
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    light = small_world.lighting
    if lights == "physical":
        assert sun == pytest.approx(light.irradiance)
        assert any("W/m²" in loss for loss in told)
    else:
        level = sun * light.towards_sun[2] / np.pi
        level += sky.GetIntensityAttr().Get() * np.mean(light.sky_rgb)
        assert 0.4 < level < 1.0


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


def test_the_rig_holds_the_sensors_figures(stage):
    """Size and pixels of the images, left and right, and what USD has no schema for."""
    rover = morpheus()
    for sensor in simple_sensors(rover.sensors):
        frame = stage.GetPrimAtPath(f"/World/Paths/arc/{sensor.name}")
        assert frame.GetCustomDataByKey("kind") == sensor.kind
        told = frame.GetCustomDataByKey("figures")
        for name, value in sensor.figures.items():
            assert (list(told[name]) if isinstance(value, list) else told[name]) == value
        place = UsdGeom.Xformable(frame).GetLocalTransformation().ExtractTranslation()
        assert np.allclose(place, sensor.position)
    for side in ("left", "right"):
        camera = UsdGeom.Camera(stage.GetPrimAtPath(f"/World/Paths/arc/camera_{side}/camera"))
        assert camera.GetStereoRoleAttr().Get() == side
        lens = camera.GetCamera(Usd.TimeCode(0))
        assert lens.GetFieldOfView(Gf.Camera.FOVHorizontal) == pytest.approx(85, abs=1e-3)
        wanted = 2 * np.degrees(np.arctan(np.tan(np.radians(42.5)) * 720 / 1280))
        assert lens.GetFieldOfView(Gf.Camera.FOVVertical) == pytest.approx(wanted, abs=1e-3)
        product = UsdRender.Product(stage.GetPrimAtPath(f"/Render/arc_camera_{side}"))
        assert product.GetResolutionAttr().Get() == Gf.Vec2i(1280, 720)
        assert product.GetCameraRel().GetTargets() == [camera.GetPath()]
    assert [prim.GetName() for prim in labelled(stage, "rover")] == ["arc"]


def test_the_sky_lights_the_world(small_world, stage):
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    assert np.allclose(sky.GetColorAttr().Get(), small_world.lighting.sky_rgb)
    assert 0 < sky.GetIntensityAttr().Get() < small_world.lighting.irradiance


def brightest(sky, rows, columns):
    """A dome's image, the sum of its colours, and the direction of its brightest pixel."""
    file = Path(sky.GetTextureFileAttr().Get().resolvedPath).read_bytes()
    header, pixels = file.split(f"-Y {rows} +X {columns}\n".encode(), 1)
    assert header.startswith(b"#?RADIANCE")
    image = np.frombuffer(pixels, np.uint8).reshape(rows, columns, 4).astype(float)
    bright = image[..., :3].sum(axis=-1) * 2.0 ** (image[..., 3] - 136.0)
    row, column = np.unravel_index(bright.argmax(), bright.shape)
    # OpenEXR's map of longitudes, which USD takes: the middle on z, to its right towards -x.
    lat, lon = np.pi * (0.5 - (row + 0.5) / rows), np.pi * (1.0 - 2.0 * (column + 0.5) / columns)
    own = Gf.Vec3d(np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon))
    return bright, UsdGeom.Xformable(sky).GetLocalTransformation().TransformDir(own)


def test_a_dusty_sky_is_an_image_with_its_glow_where_the_sun_is(small_world, tmp_path):
    light = small_world.lighting.replace(
        dust=MARS.dust, sun_azimuth=np.radians(60.0), sun_elevation=np.radians(20.0)
    )
    export(small_world.replace(lighting=light), tmp_path, options=Options())
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    _, towards = brightest(sky, 256, 512)
    assert np.dot(towards, light.towards_sun) > np.cos(np.radians(1.5))


def test_a_black_sky_is_an_image_with_the_earth_and_stars(small_world, tmp_path):
    earth = np.array([-0.5, 0.6, 0.62]) / np.linalg.norm([-0.5, 0.6, 0.62])
    light = small_world.lighting.replace(
        sky_rgb=(0.0, 0.0, 0.0), earth=tuple(earth), earth_diameter=0.033,
        earth_sun=tuple(-earth), celestial=np.eye(3), star_gain=10.0,
    )  # fmt: skip
    export(small_world.replace(lighting=light), tmp_path, options=Options())
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    image, towards = brightest(sky, 512, 1024)
    assert np.dot(towards, earth) > np.cos(0.0165)
    # As bright as the Sun makes it, from all that is on its disc: 2/3 of its albedo over π.
    level = sky.GetIntensityAttr().Get()
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun")).GetIntensityAttr().Get()
    up = np.pi * (0.5 - (np.arange(512) + 0.5) / 512)
    received = level * (image * np.cos(up)[:, None]).sum() * (np.pi / 512) ** 2
    assert received / sun == pytest.approx(0.95 * 2.0 / 3.0 * 0.0165**2, rel=0.1)
    assert 500 < (image > 0.0).sum() < 1800
    # Sirius, in the frame that this light has: a third of that image's longitudes from the north.
    ra, dec = np.radians((101.287, -16.716))
    east, north = np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra)
    column = int(np.arctan2(east, north) % (2 * np.pi) / np.pi * 512)
    assert image[int((0.5 - dec / np.pi) * 512), column] > 0.0


@pytest.fixture(scope="module")
def cratered(tmp_path_factory):
    """A level Moon: a fresh crater across two tiles, one at the edge, one worn away."""
    folder = tmp_path_factory.mktemp("cratered")
    rows = ["x_m,y_m,diameter_m,age_ga", "1,-2,6,0", "-11.5,3,4,0", "8,4,1.2,3.5"]
    (folder / "craters.csv").write_text("\n".join(rows) + "\n")
    recipe = Recipe(
        name="cratered",
        body="moon",
        dtm=FlatDtm(size_m=(24, 16)),
        terrain=TerrainSpec(spacing_m=0.25, layers=(CraterLayer(file="craters.csv"),)),
        rocks=RocksSpec(library=LibrarySpec(shapes=1)),
    )
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
