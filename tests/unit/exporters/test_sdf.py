import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh
from PIL import Image
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation
from terrain_forge.exporters.sdf import Options, export
from terrain_forge.exporters.sdf.heightmap import cut_error, heightmap_error, make_heightmap

from terrain_forge.base import ExportError, quaternion_from_rpy
from terrain_forge.dtm.projection import body_crs, local_crs
from terrain_forge.geometry import bake_ground, rock_factors, rock_texture, skin
from terrain_forge.model import Heightfield, Mesh, Trajectory, rotations, simple_sensors
from terrain_forge.paths import angles_between, spline_places
from terrain_forge.paths.interpolation import turns_between
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import grain, rock_tints
from tests.helpers import rovers, worlds
from tests.helpers.gazebo import rested
from tests.helpers.ground_pictures import FINER, PIXELS, shows_its_nodes, speckled
from tests.helpers.rovers import morpheus
from tests.helpers.surfaces import random_points, resting_height, top_under


def exported(world, directory, **options):
    directory.mkdir()
    report = export(world, directory, options=Options(**options))
    found = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    assert list(report.files) == found
    return directory


@pytest.fixture(scope="module")
def sdf(small_world, tmp_path_factory):
    """The small world in four tiles, its larger rocks one by one."""
    return exported(small_world, tmp_path_factory.mktemp("gz") / "sdf", tile_cells=48)


def numbers(element):
    return np.array(element.text.split(), float)


def models(directory):
    return {
        path.parent.name: ET.parse(path).getroot().find("model")
        for path in sorted(directory.glob("models/*/model.sdf"))
    }


def file_of(directory, uri):
    return directory / "models" / uri.removeprefix("model://")


def meshes(directory, model, kind):
    """Name, vertices in the model's frame and faces of a model's visuals or collisions."""
    for part in model.iter(kind):
        mesh = part.find("geometry/mesh")
        read = trimesh.load(file_of(directory, mesh.findtext("uri")), process=False)
        vertices = read.vertices * (numbers(s) if (s := mesh.find("scale")) is not None else 1)
        if (pose := part.find("pose")) is not None:
            turn = Rotation.from_euler("xyz", numbers(pose)[3:])
            vertices = turn.apply(vertices) + numbers(pose)[:3]
        yield part.get("name"), vertices, read.faces


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_every_reference_leads_to_a_file(small_world, tmp_path, flavour):
    directory = exported(small_world, tmp_path / "sdf", flavour=flavour, tile_cells=48)
    version = {"gz": "1.9", "classic": "1.6"}[flavour]
    for name in ("world.sdf", "scene.sdf"):
        root = ET.parse(directory / name).getroot()
        assert root.get("version") == version
        uris = [uri.text for uri in root.iter("uri")]
        assert uris == ["model://by-hand_ground", "model://by-hand_rocks"]
        assert all((file_of(directory, uri) / "model.config").is_file() for uri in uris)
    for name, model in models(directory).items():
        assert model.get("name") == name
        assert model.findtext("static") == "true"
        uris = [e.text for e in model.iter() if e.tag in ("uri", "albedo_map")]
        assert len(uris) > 4
        assert all(file_of(directory, uri).exists() for uri in uris)
        for link in model.iter("link"):
            names = [part.get("name") for part in link]
            assert len(set(names)) == len(names)
    scripts = list(directory.glob("models/*/materials/scripts/*.material"))
    assert len(scripts) == (2 if flavour == "classic" else 0)
    for script in scripts:
        texts = script.read_text().split()
        images = [text for text in texts if text.endswith(".png")]
        assert images
        assert all((script.parents[1] / "textures" / image).is_file() for image in images)
        assert ("wrap" in texts) == script.stem.endswith("_rocks")


def test_gravity_and_sun(small_world, sdf):
    world = ET.parse(sdf / "world.sdf").getroot().find("world")
    assert np.allclose(numbers(world.find("gravity")), (0, 0, -small_world.site.body.gravity))
    light = world.find("light")
    assert light.get("type") == "directional"
    direction = numbers(light.find("direction"))
    assert np.allclose(direction, -small_world.lighting.towards_sun, atol=1e-8)
    assert world.findtext("physics/dart/collision_detector") == "ode"
    assert world.find("actor") is None


def test_the_ground_reads_back(small_world, sdf):
    model = models(sdf)["by-hand_ground"]
    points = random_points(small_world.ground, 2000, 6)
    heights = np.full(len(points), -np.inf)
    tiles = list(meshes(sdf, model, "collision"))
    assert len(tiles) == 4
    for _, vertices, faces in tiles:
        heights = np.maximum(heights, top_under(vertices, faces, points))
    wanted = small_world.ground.height_at(points[:, 0], points[:, 1])
    assert np.abs(heights - wanted).max() < 1e-6
    text = (sdf / "models/by-hand_ground/meshes/ground_000.obj").read_text()
    assert text.count("\nvn ") == 49 * 49


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_the_texture_lies_the_right_way(small_world, tmp_path, flavour):
    world = speckled(small_world)
    options = {"flavour": flavour, "tile_cells": 48, "texture_pixels": PIXELS}
    directory = exported(world, tmp_path / "sdf", **options)
    model = directory / "models/by-hand_ground"
    rows = [line.split() for line in (model / "meshes/ground_003.obj").read_text().splitlines()]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], float)
    u, v = np.array([row[1:] for row in rows if row[0] == "vt"], float).T
    with Image.open(model / "materials/textures/ground_003.png") as image:
        pixels = np.asarray(image)
    assert pixels.shape == (17 * FINER, 49 * FINER, 3)
    assert shows_its_nodes(pixels, u, v, world, vertices)


@pytest.mark.parametrize("kind", ["visual", "collision"])
def test_large_rocks_are_where_they_are(small_world, sdf, kind):
    field, shapes = small_world.field, small_world.library.prototypes
    large = np.flatnonzero(field.diameter >= 0.5)
    found = {
        int(name.split("_")[1]): vertices
        for name, vertices, _ in meshes(sdf, models(sdf)["by-hand_rocks"], kind)
        if name.startswith("rock_")
    }
    assert sorted(found) == field.id[large].tolist()
    turns = rotations(field)
    for row in large:
        points = shapes[field.prototype[row]].meshes[0].vertices * field.scale[row]
        wanted = points @ turns[row].T + field.position[row]
        vertices = found[field.id[row]]
        assert np.allclose(vertices.min(0), wanted.min(0), atol=2e-6)
        assert np.allclose(vertices.max(0), wanted.max(0), atol=2e-6)


def test_small_rocks_are_merged_where_they_are(small_world, sdf):
    field, shapes = small_world.field, small_world.library.prototypes
    rocks = models(sdf)["by-hand_rocks"]
    merged = [m for m in meshes(sdf, rocks, "collision") if m[0].startswith("small_")]
    turns = rotations(field)
    small = np.flatnonzero(field.diameter < 0.5)
    assert len(small) > 5
    for row in small:
        points = shapes[field.prototype[row]].meshes[0].vertices * field.scale[row]
        placed = points @ turns[row].T + field.position[row]
        top = placed[placed[:, 2].argmax()]
        off = [np.linalg.norm(vertices - top, axis=1).min() for _, vertices, _ in merged]
        assert min(off) < 1e-5


def test_all_rocks_merged_or_none(small_world, tmp_path):
    merged = exported(small_world, tmp_path / "merged", individual_min_m=100)
    single = exported(small_world, tmp_path / "single", individual_min_m=0)
    assert not list(merged.glob("models/*_rocks/meshes/shape_*"))
    assert not list(single.glob("models/*_rocks/meshes/small_*"))
    assert len(list(models(single)["by-hand_rocks"].iter("collision"))) == len(small_world.field)


def test_a_world_without_rocks_and_paths(small_world, tmp_path):
    nothing = small_world.field.select(np.zeros(len(small_world.field), bool))
    world = small_world.replace(field=nothing, trajectories=())
    directory = exported(world, tmp_path / "sdf")
    assert (directory / "scene.sdf").read_bytes() == (directory / "world.sdf").read_bytes()
    assert len(list(models(directory)["by-hand_rocks"].iter("collision"))) == 0


def waypoints(actor):
    stops = list(actor.iter("waypoint"))
    times = [stop.findtext("time") for stop in stops]
    return times, np.array([numbers(stop.find("pose")) for stop in stops])


def test_the_actor_is_the_trajectory_at_whole_milliseconds(small_world, sdf):
    actor = ET.parse(sdf / "scene.sdf").getroot().find("world/actor")
    assert actor.get("name") == "arc"
    times, poses = waypoints(actor)
    trajectory = small_world.trajectories[0]
    milliseconds = np.array(times, float) * 1000
    assert np.abs(milliseconds - np.rint(milliseconds)).max() < 1e-9
    assert (milliseconds.astype(int) == np.rint(milliseconds)).all()  # as gz-sim cuts them
    away = np.abs(np.array(times, float)[:, None] - trajectory.time).min(axis=0)
    assert away.max() < 0.001
    wanted = trajectory.at(np.array(times, float))
    assert np.abs(poses[:, :3] - wanted.position).max() < 1e-7
    assert np.abs(poses[:, 3:] - wanted.rpy).max() < 1e-7


def winding():
    """Three rounds of a circle at 0.4 m/s, sampled at 12 Hz."""
    time = np.arange(0, 190, 1 / 12)
    angle = 0.1 * time
    position = np.stack([4 * np.cos(angle), 4 * np.sin(angle), 0.1 * np.sin(3 * angle)], -1)
    rpy = np.stack([0.05 * np.sin(angle), 0.04 * np.cos(2 * angle), angle + np.pi / 2], -1)
    return Trajectory(name="rounds", time=time, position=position, rpy=rpy, closed=True)


def test_yaw_is_continuous_over_many_rounds(small_world, tmp_path):
    world = small_world.replace(trajectories=(winding(),))
    directory = exported(world, tmp_path / "sdf")
    actor = ET.parse(directory / "scene.sdf").getroot().find("world/actor")
    _, poses = waypoints(actor)
    assert np.abs(np.diff(poses[:, 5])).max() < 0.1
    assert poses[-1, 5] - poses[0, 5] > 18
    assert actor.findtext("script/loop") == "true"
    assert 0 <= float(actor.find("script/trajectory").get("tension")) <= 1


@pytest.mark.parametrize("name", ['Gale <"Höhe"> & 7', "火星 \x01", "two  words"])
def test_any_name_will_do(small_world, tmp_path, name):
    path = small_world.trajectories[0].replace(name=name)
    world = small_world.replace(site=small_world.site.replace(name=name), trajectories=(path,))
    directory = exported(world, tmp_path / "sdf")
    files = [str(p.relative_to(directory)) for p in directory.rglob("*")]
    assert all(file.isascii() and " " not in file for file in files)
    for config in directory.glob("models/*/model.config"):
        assert ET.parse(config).getroot().findtext("name").strip()
    scene = ET.parse(directory / "scene.sdf").getroot()
    assert all(file_of(directory, uri.text).is_dir() for uri in scene.iter("uri"))


def test_single_rocks_show_their_populations_texture(small_world, sdf):
    """Through the OBJ's own texture coordinates, each corner's."""
    rocks = models(sdf)["by-hand_rocks"]
    for visual in rocks.iter("visual"):
        if visual.get("name").startswith("rock_"):
            row = int(visual.get("name").split("_")[1])
            population = small_world.field.population[row]
            image = file_of(sdf, visual.findtext("material/pbr/metal/albedo_map"))
            assert image.name == f"rock_{population}.png"
            for kind in ("normal", "roughness"):
                assert file_of(sdf, visual.findtext(f"material/pbr/metal/{kind}_map")).is_file()
            factor = [float(n) for n in visual.findtext("material/diffuse").split()][:3]
            wanted = rock_factors(small_world, population)
            tint = rock_tints(small_world.field.id[row : row + 1], small_world.site.seed)[0]
            assert np.allclose(factor, wanted[tint], atol=1e-5)
    with Image.open(image) as picture:
        pixels = np.asarray(picture)[::-1].astype(int)
    assert np.array_equal(pixels[::-1], rock_texture(small_world, population, tinted=True))
    shape = small_world.library.prototypes[0]
    lines = (sdf / "models/by-hand_rocks/meshes/shape_000.obj").read_text().splitlines()
    vt = np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)
    faces = [line.split()[1:] for line in lines if line.startswith("f ")]
    index = np.array([[corner.split("/")[1] for corner in face] for face in faces], int)
    assert np.abs(vt[index - 1] - skin(shape)[1]).max() < 1e-6


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_dynamic_rocks_are_bodies_with_their_own_mass(small_world, tmp_path, flavour):
    world = worlds.loosened(small_world)
    directory = exported(world, tmp_path / "sdf", flavour=flavour)
    field, turns = world.field, rotations(world.field)
    for file in ("world.sdf", "scene.sdf"):
        bodies = ET.parse(directory / file).getroot().findall("world/model")
        assert [b.get("name") for b in bodies] == [f"rock_{i}" for i in field.id[field.dynamic]]
    for body, row in zip(bodies, np.flatnonzero(field.dynamic), strict=True):
        assert body.find("static") is None
        pose = numbers(body.find("pose"))
        assert np.allclose(pose[:3], field.position[row], atol=1e-7)
        turn = Rotation.from_euler("xyz", pose[3:]).as_matrix()
        assert np.allclose(turn, turns[row], atol=1e-8)
        inertial = body.find("link/inertial")
        assert float(inertial.findtext("mass")) == pytest.approx(field.mass[row])
        hull = world.library.prototypes[field.prototype[row]].meshes[0]
        solid = trimesh.Trimesh(hull.vertices * field.scale[row], hull.faces)
        solid.density = field.mass[row] / field.volume[row]
        for name, (i, j) in {"ixx": (0, 0), "iyy": (1, 1), "ixy": (0, 1), "iyz": (1, 2)}.items():
            wanted = solid.moment_inertia[i, j]
            found = float(inertial.findtext(f"inertia/{name}"))
            assert found == pytest.approx(wanted, abs=1e-6 * solid.moment_inertia[0, 0])
        for kind in ("visual", "collision"):
            ((_, vertices, _),) = meshes(directory, body, kind)
            assert np.allclose(np.ptp(vertices, axis=0), np.ptp(solid.vertices, axis=0), atol=2e-6)
        friction = body.find("link/collision/surface/friction")
        patch = float(friction.findtext("torsional/patch_radius"))
        torsional = 3 * np.pi / 16 * patch * float(friction.findtext("torsional/coefficient"))
        assert torsional == pytest.approx(dynamic_contact(field.diameter[row]).torsional)


def test_every_convex_part_is_a_collision(small_world, tmp_path):
    world = worlds.loosened(small_world)
    shapes = [p.replace(hulls=(*p.hulls, *p.hulls)) for p in world.library.prototypes]
    world = world.replace(library=world.library.replace(prototypes=tuple(shapes)))
    directory = exported(world, tmp_path / "sdf", individual_min_m=0)
    model = models(directory)["by-hand_rocks"]
    field = world.field
    fixed = field.collides & ~field.dynamic
    assert len(list(model.iter("collision"))) == 2 * fixed.sum()
    for body in ET.parse(directory / "world.sdf").getroot().findall("world/model"):
        names = [part.get("name") for part in body.iter("collision")]
        assert names == ["collision_0", "collision_1"]


def test_rocks_visual_only_have_no_collision(small_world, tmp_path):
    world = worlds.loosened(small_world)
    model = models(exported(world, tmp_path / "sdf", individual_min_m=0.8))["by-hand_rocks"]
    field = world.field
    large, fixed = field.diameter >= 0.8, ~field.dynamic
    for kind, wanted in (("visual", fixed & large), ("collision", fixed & large & field.collides)):
        names = [part.get("name") for part in model.iter(kind)]
        single = [int(name.split("_")[1]) for name in names if name.startswith("rock_")]
        assert single == field.id[wanted].tolist()
    merged = {
        kind: sum(len(m[2]) for m in meshes(tmp_path / "sdf", model, kind) if "rock_" not in m[0])
        for kind in ("visual", "collision")
    }
    assert (fixed & ~large & ~field.collides).any()
    assert 0 < merged["collision"] < merged["visual"]


def test_losses_are_named(small_world, tmp_path):
    world = small_world.replace(site=small_world.site.replace(crs="LOCAL_CS[]", lonlat=(0.1, 0.2)))
    (tmp_path / "sdf").mkdir()
    losses = " ".join(export(world, tmp_path / "sdf", options=Options(texture_pixels=1024)).losses)
    for word in ("fixed", "merged", "W/m²", "longitude", "without colliding", "pixels of 25 mm;"):
        assert word in losses


def test_actors_show_the_meshes_of_a_custom_rover(small_world, tmp_path):
    rover = rovers.read(rovers.rocker_urdf(tmp_path))
    directory = exported(small_world.replace(rover=rover), tmp_path / "sdf")
    link = ET.parse(directory / "scene.sdf").getroot().find("world/actor/link")
    shown = {visual.get("name"): visual for visual in link.iter("visual")}
    places, found = rovers.origins(rover), 0
    for part in rover.links:
        for number, shape in enumerate(part.shapes):
            if shape.mesh is None or not shape.visible:
                continue
            visual = shown[f"{part.name}_{number}"]
            pose = np.array(visual.findtext("pose").split(), float)
            np.testing.assert_allclose(pose[:3], places[part.name] + shape.position, atol=1e-6)
            np.testing.assert_allclose(pose[3:], shape.rpy, atol=1e-6)
            file = visual.findtext("geometry/mesh/uri").removeprefix("model://")
            mesh = trimesh.load(directory / "models" / file, process=False)
            assert len(mesh.faces) == len(shape.mesh.faces)
            np.testing.assert_allclose(mesh.bounds[1] - mesh.bounds[0], shape.size, atol=1e-5)
            found += 1
    assert found == 4


# ---- sensors


def actor_sensors(directory):
    sensors = ET.parse(directory / "scene.sdf").getroot().iter("sensor")
    return {sensor.get("name"): sensor for sensor in sensors}


@pytest.fixture(scope="module")
def roving(small_world):
    return small_world.replace(rover=morpheus())


def test_the_actor_carries_the_rovers_sensors(roving, tmp_path):
    found = actor_sensors(exported(roving, tmp_path / "sdf"))
    kinds = {"camera": "camera", "lidar": "gpu_lidar", "imu": "imu"}
    sensors = simple_sensors(roving.rover.sensors)
    assert list(found) == [sensor.name for sensor in sensors]
    for sensor in sensors:
        written = found[sensor.name]
        assert written.get("type") == kinds[sensor.kind]
        assert float(written.findtext("update_rate")) == sensor.rate_hz
        wanted = np.hstack([sensor.position, sensor.rpy])
        assert np.allclose(numbers(written.find("pose")), wanted, atol=1e-8)
    left, right = (numbers(found[f"camera_{side}"].find("pose")) for side in ("left", "right"))
    assert left[1] - right[1] == pytest.approx(0.12)
    topics = [sensor.findtext("topic") for sensor in found.values()]
    # gz-sim puts camera_info beside the image: two images in one place would share it
    assert len({topic.rsplit("/", 1)[0] for topic in topics[:2]}) == 2


def test_noise_is_per_sample_not_a_density(roving, tmp_path):
    """At 200 Hz an ADIS16448 has 0.00239964 rad/s and 0.0282843 m/s² per sample."""
    found = actor_sensors(exported(roving, tmp_path / "sdf"))
    for tag, wanted in (("angular_velocity", 0.00239964), ("linear_acceleration", 0.0282843)):
        for axis in "xyz":
            noise = found["imu"].find(f"imu/{tag}/{axis}/noise")
            assert noise.get("type") == "gaussian"
            assert float(noise.findtext("stddev")) == pytest.approx(wanted, rel=1e-5)
            assert float(noise.findtext("dynamic_bias_stddev")) > 0
    assert float(found["lidar"].findtext("lidar/noise/stddev")) == 0.015
    # Electrons are counted with noise √n: at half of a well of 10,000, read with 6 more, 0.0071.
    noise = float(found["camera_left"].findtext("camera/noise/stddev"))
    assert noise == pytest.approx(np.sqrt(5000 + 36) / 10_000, rel=1e-6)


def test_the_lidar_turns_once_and_looks_up_and_down(roving, tmp_path):
    scan = actor_sensors(exported(roving, tmp_path / "sdf"))["lidar"].find("lidar/scan")
    low, high, count = (
        float(scan.findtext(f"horizontal/{tag}")) for tag in ("min_angle", "max_angle", "samples")
    )
    assert (high - low) * count / (count - 1) == pytest.approx(2 * np.pi)
    low, high = (float(scan.findtext(f"vertical/{tag}")) for tag in ("min_angle", "max_angle"))
    assert np.degrees([low, high]) == pytest.approx([-15, 15])


def test_classic_has_a_multicamera_and_rays(roving, tmp_path):
    found = actor_sensors(exported(roving, tmp_path / "sdf", flavour="classic"))
    types = {name: sensor.get("type") for name, sensor in found.items()}
    assert types == {"cameras": "multicamera", "lidar": "ray", "imu": "imu"}
    places = [numbers(camera.find("pose")) for camera in found["cameras"].iter("camera")]
    cameras = simple_sensors(roving.rover.sensors)[:2]
    assert np.allclose(places, [np.hstack([c.position, c.rpy]) for c in cameras], atol=1e-8)


def test_only_a_scene_with_sensors_names_plugins(roving, tmp_path):
    with_sensors = exported(roving, tmp_path / "with")
    without = exported(roving, tmp_path / "without", sensors=False)
    plugins = [p.get("name") for p in ET.parse(with_sensors / "scene.sdf").getroot().iter("plugin")]
    assert "gz::sim::systems::Sensors" in plugins
    assert "gz::sim::systems::Physics" in plugins  # naming any drops gz-sim's own choice
    for file in (with_sensors / "world.sdf", without / "scene.sdf", without / "world.sdf"):
        assert ET.parse(file).getroot().find("world/plugin") is None
    assert not actor_sensors(without)


# ---- ground as a heightmap, normal maps, place on the body, ROS package


def read_heightmap(directory):
    """The collision as `height(x, y)`, its samples, and the number of grey levels."""
    collision = models(directory)["by-hand_ground"].find("link/collision")
    shape = collision.find("geometry/heightmap")
    with Image.open(file_of(directory, shape.findtext("uri"))) as image:
        pixels = np.asarray(image)[::-1].astype(float)
    place = "geometry/heightmap/pos" if collision.find("pose") is None else "pose"
    return numbers(shape.find("size")), numbers(collision.find(place))[:3], pixels


@pytest.mark.parametrize(
    ("bits", "flavour", "release"),
    [(8, "gz", None), (16, "gz", "garden"), (8, "classic", None)],
)
def test_a_heightmap_is_the_ground_up_to_its_steps(small_world, tmp_path, bits, flavour, release):
    options = {"ground": "heightmap", "flavour": flavour, "release": release}
    directory = exported(small_world, tmp_path / "sdf", **options)
    size, pos, pixels = read_heightmap(directory)
    assert pixels.shape == (129, 129)
    assert (pixels.min(), pixels.max()) == (0, 2**bits - 1)
    spread = size[:2] * (128 / 129 if flavour == "gz" else 1)
    assert np.allclose(spread, (24, 16))
    heights = pos[2] + size[2] * pixels / (2**bits - 1)
    east = pos[0] + np.linspace(-0.5, 0.5, 129) * spread[0]
    north = pos[1] + np.linspace(-0.5, 0.5, 129) * spread[1]
    wanted = small_world.ground.height_at(*np.meshgrid(east, north))
    assert np.abs(heights - wanted).max() <= 0.5001 * size[2] / (2**bits - 1)
    model = models(directory)["by-hand_ground"]
    assert [c.get("name") for c in model.iter("collision")] == ["ground_heightmap"]
    assert len(list(model.iter("visual"))) == 1


def test_a_square_grid_of_the_right_size_is_kept_node_for_node(small_world, tmp_path):
    square = small_world.ground.cut(column=20, row=0, columns=64, rows=64)
    heightmap = make_heightmap(square, bits=16)
    assert not heightmap.resampled
    assert heightmap_error(heightmap, square) <= 0.5 * heightmap.quantum + 1e-6
    (tmp_path / "sdf").mkdir()
    options = Options(ground="heightmap", release="garden")
    losses = " ".join(export(small_world, tmp_path / "sdf", options=options).losses)
    assert "resampled to 129² samples" in losses
    found = make_heightmap(small_world.ground, bits=16)
    assert f"{1000 * heightmap_error(found, small_world.ground):.3g} mm" in losses


def test_a_ground_too_large_for_a_heightmap_is_refused(small_world, tmp_path):
    strip = Heightfield(elevation=np.zeros((2, 4098)), spacing=0.25, origin=(0.0, 0.0))
    world = small_world.replace(ground=strip)
    with pytest.raises(ExportError, match=r"4097 × 1 cells.*at most 4096.*ground: mesh"):
        export(world, tmp_path, options=Options(ground="heightmap"))
    assert not list(tmp_path.iterdir())


def soil_slope(spacing, finer):
    """RMS slope along an axis of waves of soil that a texture of so many pixels a node shows.

    Unit noise interpolates gradients from -1 to 1 by a quintic: 0.51, integrated over its cell. The
    waves are half as long and steeper by the next, down to two pixels.
    """
    place = (np.arange(400) + 0.5) / 400
    fade = place**3 * (place * (place * 6 - 15) + 10)
    steep = 30 * place**2 * (place - 1) ** 2
    weights = [(1 - fade, -steep, place), (fade, steep, place - 1)]
    variance = sum(
        (((w + rise * away)[:, None] * v) ** 2 + (rise[:, None] * v * other) ** 2).mean() / 3
        for w, rise, away in weights
        for v, _, other in weights
    )
    total, wave = 0.0, min(grain.SOIL_COARSEST, 1.5 * spacing)
    weight = (wave / grain.SOIL_COARSEST) ** (grain.SOIL_HURST - 1.0)
    least, whole = grain.SOIL_SHOWN
    while (shown := min(1.0, (wave * finer / spacing - least) / (whole - least))) > 0.0:
        total += (grain.SOIL_STEEP * shown * weight) ** 2 * variance
        wave *= grain.SOIL_STEP
        weight *= grain.SOIL_STEP ** (grain.SOIL_HURST - 1.0)
    return np.sqrt(total)


def test_normal_maps_show_the_soil_where_it_lies(small_world, tmp_path):
    options = {"tile_cells": 48, "texture_pixels": PIXELS}
    directory = exported(small_world, tmp_path / "sdf", **options)
    folder = directory / "models/by-hand_ground/materials/textures"
    whole = bake_ground(small_world, finer=FINER).normals
    shown = (whole - 127.75) / 127.5
    slopes = shown[..., :2] / shown[..., 2:]
    # Stones add a little to the soil.
    assert slopes.std() == pytest.approx(soil_slope(small_world.ground.spacing, FINER), rel=0.1)
    for number, (row, column) in enumerate([(0, 0), (0, 48), (48, 0), (48, 48)]):
        with Image.open(folder / f"ground_{number:03}_normals.png") as image:
            normals = np.asarray(image)[::-1].astype(int)
        assert normals.shape == ((49 if row == 0 else 17) * FINER, 49 * FINER, 3)
        part = whole[row * FINER :, column * FINER :][: len(normals), : normals.shape[1]]
        assert np.abs(normals - part).max() <= 1
    classic = exported(small_world, tmp_path / "classic", flavour="classic")
    plain = exported(small_world, tmp_path / "plain", normal_maps=False)
    for directory in (classic, plain):
        assert not list(directory.rglob("*_normals.png"))
        assert models(directory)["by-hand_ground"].find(".//normal_map") is None


def test_the_site_is_placed_where_sdf_knows_its_body(small_world, tmp_path):
    lonlat = (np.radians(137.4), np.radians(-4.6))
    crs = local_crs(body_crs(3396190.0), 137.4, -4.6)
    site = small_world.site.replace(crs=crs, lonlat=lonlat, datum_height=-4500.0)
    world = small_world.replace(site=site)
    known = exported(world, tmp_path / "known", release="garden")
    root = ET.parse(known / "world.sdf").getroot()
    assert root.get("version") == "1.10"
    place = root.find("world/spherical_coordinates")
    figures = {e.tag: e.text for e in place}
    assert figures["surface_model"] == "CUSTOM_SURFACE"
    assert float(figures["latitude_deg"]) == pytest.approx(-4.6, abs=1e-8)
    assert float(figures["longitude_deg"]) == pytest.approx(137.4, abs=1e-8)
    assert float(figures["surface_axis_equatorial"]) == 3396190
    assert float(figures["elevation"]) == -4500
    for options in ({}, {"flavour": "classic"}):
        unknown = exported(world, tmp_path / f"{len(options)}", **options)
        assert ET.parse(unknown / "world.sdf").getroot().find(".//spherical_coordinates") is None


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_the_ros_package_installs_what_it_starts(roving, tmp_path, flavour):
    world = roving.replace(site=roving.site.replace(name="Gale <2> & Söhne"))
    directory = exported(world, tmp_path / "sdf", flavour=flavour, ros_package=True)
    manifest = ET.parse(directory / "package.xml").getroot()
    package = manifest.findtext("name")
    assert re.fullmatch("[a-z][a-z0-9_]*", package)
    exports = manifest.find("export/gazebo_ros").get("gazebo_model_path")
    assert (directory / exports.replace("${prefix}/", "")).is_dir()
    cmake = (directory / "CMakeLists.txt").read_text()
    assert f"project({package} NONE)" in cmake
    for name in re.search(r"DIRECTORY ([\w ]+) DEST", cmake)[1].split():
        assert (directory / name).is_dir()
    for name in re.search(r"FILES ([\w. ]+) DEST", cmake)[1].split():
        assert (directory / name).is_file()
    launch = (directory / "launch/scene.launch.py").read_text()
    compile(launch, "scene.launch.py", "exec")
    assert f'"{package}"' in launch
    assert "Söhne" in (directory / "README.md").read_text(encoding="utf-8")


def test_the_bridge_knows_every_topic_of_the_scene(roving, tmp_path):
    directory = exported(roving, tmp_path / "sdf", ros_package=True)
    entries = YAML(typ="safe").load(directory / "config/bridge.yaml")
    bridged = {entry["gz_topic_name"] for entry in entries}
    for name, sensor in actor_sensors(directory).items():
        topic = "/" + sensor.findtext("topic")
        assert (topic if name != "lidar" else f"{topic}/points") in bridged
        if sensor.get("type") == "camera":
            assert f"{topic.rsplit('/', 1)[0]}/camera_info" in bridged
    assert {entry["direction"] for entry in entries} == {"GZ_TO_ROS"}
    plain = exported(roving, tmp_path / "plain")
    assert {path.name for path in plain.iterdir()} == {"world.sdf", "scene.sdf", "models"}


# ---- the real consumers


@pytest.mark.consumer
@pytest.mark.parametrize("flavour", ["gz", "classic"])
@pytest.mark.parametrize(
    ("name", "options"),
    [("by-hand", {}), ('Gale <"Höhe"> & 7', {"ground": "heightmap", "ros_package": True})],
)
def test_libsdformat_has_no_finding(small_world, tmp_path, build, flavour, name, options):
    program = build("sdf_check", "sdformat12")
    site = small_world.site.replace(name=name)
    world = worlds.loosened(small_world).replace(site=site, rover=morpheus())
    directory = exported(world, tmp_path / "sdf", flavour=flavour, tile_cells=48, **options)
    for file in ("world.sdf", "scene.sdf"):
        run = subprocess.run(
            [program, directory / file, directory / "models"], capture_output=True, text=True
        )
        assert run.returncode == 0, run.stdout + run.stderr
        assert "models 16" in run.stdout
        assert ("actor arc waypoints" in run.stdout) == (file == "scene.sdf")
        assert "Error" not in run.stderr


@pytest.mark.consumer
@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_ign_sdf_accepts_it(small_world, tmp_path, flavour):
    if not shutil.which("ign"):
        pytest.skip("ign (ignition-tools) is not installed")
    directory = exported(small_world, tmp_path / "sdf", flavour=flavour)
    for file in ("world.sdf", "scene.sdf"):
        run = subprocess.run(
            ["ign", "sdf", "-k", directory / file],
            capture_output=True,
            text=True,
            env=os.environ | {"SDF_PATH": str(directory / "models")},
        )
        assert "Valid." in run.stdout
        assert "Error" not in run.stderr
        assert "Warning" not in run.stderr


BALL = """<model name="ball"><pose>{} {} {} 0 0 0</pose>
<link name="ball">
<inertial><mass>1</mass><inertia><ixx>.016</ixx><iyy>.016</iyy><izz>.016</izz></inertia></inertial>
<collision name="ball"><geometry><sphere><radius>{}</radius></sphere></geometry></collision>
</link>
<joint name="slider" type="prismatic"><parent>world</parent><child>ball</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></world>"""


def rest(build, directory, x, y, height):
    """Where a ball ends in Gazebo's physics that is let go at a height."""
    text = (directory / "world.sdf").read_text()
    test = directory / "ball.sdf"
    test.write_text(text.replace("</world>", BALL.format(x, y, height, 0.2)))
    return float(rested(build, directory, test, 4)["ball"][2])


@pytest.mark.consumer
@pytest.mark.parametrize(("x", "y"), [(6.3, -3.4), (-9.13, 5.77), (0.02, 0.01)])
def test_a_ball_rests_on_the_ground_in_gazebos_physics(small_world, tmp_path, build, x, y):
    nothing = small_world.field.select(np.zeros(len(small_world.field), bool))
    directory = exported(small_world.replace(field=nothing), tmp_path / "sdf", tile_cells=48)
    wanted = resting_height(small_world.ground, x, y, 0.2)
    assert rest(build, directory, x, y, wanted + 0.3) == pytest.approx(wanted, abs=0.002)


@pytest.mark.consumer
@pytest.mark.parametrize(("x", "y"), [(6.3, -3.4), (-9.13, 5.77), (9.02, 6.01)])
def test_a_ball_rests_on_a_heightmap_in_gazebos_physics(small_world, tmp_path, build, x, y):
    nothing = small_world.field.select(np.zeros(len(small_world.field), bool))
    world = small_world.replace(field=nothing)
    directory = exported(world, tmp_path / "sdf", ground="heightmap", heightmap_bits=8)
    wanted = resting_height(world.ground, x, y, 0.2)
    heightmap = make_heightmap(world.ground, bits=8)
    limit = heightmap_error(heightmap, world.ground) + cut_error(world.ground) + 0.002
    assert rest(build, directory, x, y, wanted + 0.3) == pytest.approx(wanted, abs=limit)


@pytest.mark.consumer
@pytest.mark.parametrize("merged", [False, True])
def test_a_ball_rests_on_a_rock_in_gazebos_physics(small_world, tmp_path, build, merged):
    field = small_world.field.select(np.array([small_world.field.diameter.argmax()]))
    world = small_world.replace(field=field)
    directory = exported(world, tmp_path / "sdf", individual_min_m=10 if merged else 0)
    hull = world.library.prototypes[field.prototype[0]].hulls[0]
    placed = field.scale[0] * hull.vertices @ rotations(field)[0].T + field.position[0]
    x, y, _ = placed[placed[:, 2].argmax()]
    dense = trimesh.Trimesh(placed, hull.faces, process=False).subdivide_to_size(0.005)
    offset = ((dense.vertices[:, :2] - (x, y)) ** 2).sum(1)
    near = offset < 0.2**2
    wanted = float((dense.vertices[near, 2] + np.sqrt(0.2**2 - offset[near])).max())
    assert rest(build, directory, x, y, wanted + 0.3) == pytest.approx(wanted, abs=0.002)


@pytest.mark.consumer
def test_dynamic_rocks_stay_on_the_ground_in_gazebos_physics(small_world, tmp_path, build):
    """Slabs that lie flat on the tilted ground: they neither fall through it nor slide."""
    ground, field = small_world.ground, small_world.field.select(np.arange(6))
    xy = np.array([(-9, -5), (-9, 0), (-9, 5), (0, -5), (0, 1), (0, 6)], float)
    slab = trimesh.creation.box((1.2, 1.2, 0.6))
    mesh = Mesh(vertices=slab.vertices, faces=slab.faces)
    shape = small_world.library.prototypes[0].replace(
        meshes=(mesh,),
        hulls=(mesh,),
        uvs=(np.zeros((len(mesh.faces), 3, 2)),),
        volume=slab.volume,
        inertia=slab.moment_inertia,
    )
    plane = ground.replace(elevation=0.1 * ground.east + 0.05 * ground.north[:, None])
    normal = np.array([-0.1, -0.05, 1.0]) / np.linalg.norm([-0.1, -0.05, 1.0])
    turn, _ = Rotation.align_vectors([normal], [[0, 0, 1]])
    scale = np.geomspace(0.1, 1.0, 6)
    foot = np.column_stack([xy, plane.height_at(xy[:, 0], xy[:, 1])])
    field = field.replace(
        dynamic=np.ones(6, bool),
        prototype=np.zeros(6),
        scale=scale,
        diameter=1.2 * scale,
        volume=slab.volume * scale**3,
        mass=2900 * slab.volume * scale**3,
        position=foot + 0.3 * scale[:, None] * normal,
        quaternion=np.tile(np.roll(turn.as_quat(), 1), (6, 1)),
    )
    library = small_world.library.replace(prototypes=(shape,))
    world = small_world.replace(ground=plane, field=field, library=library)
    directory = exported(world, tmp_path / "sdf")
    found = rested(build, directory, directory / "world.sdf", 3)
    for row, rock in enumerate(field.id):
        pose = found[f"rock_{rock}"]
        moved = np.linalg.norm(pose[:3] - field.position[row])
        assert moved < 0.02 * field.diameter[row]
        cosine = min(1.0, abs(pose[3:] @ field.quaternion[row]))
        assert 2 * np.arccos(cosine) < np.radians(3)


@pytest.mark.consumer
def test_gazebos_spline_stays_on_the_path(small_world, tmp_path, build):
    program = build("actor_spline", "ignition-common4-graphics", "ignition-math6")
    trajectory = winding()
    world = small_world.replace(trajectories=(trajectory,))
    directory = exported(world, tmp_path / "sdf")
    actor = ET.parse(directory / "scene.sdf").getroot().find("world/actor")
    times, poses = waypoints(actor)
    table = np.column_stack([np.array(times, float), poses])
    asked = np.random.default_rng(9).uniform(1, float(times[-1]) - 1, 2000)
    text = " ".join(map(repr, [len(table), *table.ravel().tolist(), *np.sort(asked).tolist()]))
    tension = actor.find("script/trajectory").get("tension")
    run = subprocess.run([program, tension], input=text, capture_output=True, text=True, check=True)
    found = np.array([line.split() for line in run.stdout.splitlines()], float)
    wanted = trajectory.at(np.sort(asked))
    assert np.linalg.norm(found[:, :3] - wanted.position, axis=1).max() < 0.005
    # What validation takes for Gazebo's spline is Gazebo's spline.
    stops = table[:, 0]
    ours = spline_places(stops, poses[:, :3], np.sort(asked))
    assert np.abs(found[:, :3] - ours).max() < 1e-9
    turned = turns_between(stops, quaternion_from_rpy(poses[:, 3:]), np.sort(asked))
    # Between near poses it blends quaternions instead of turning them at a constant rate.
    assert angles_between(found[:, 3:], turned).max() < 1e-5
    cosine = np.abs((found[:, 3:] * wanted.quaternion).sum(1)).clip(max=1)
    assert 2 * np.arccos(cosine).max() < 0.001
