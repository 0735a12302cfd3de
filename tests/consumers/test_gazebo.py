"""SDF in Gazebo's own libraries, and on its physics."""

import os
import shutil
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from terrain_forge.exporters.sdf.heightmap import cut_error, heightmap_error, make_heightmap

from terrain_forge.base import quaternion_from_rpy
from terrain_forge.model import Mesh, rotations
from terrain_forge.paths import angles_between, spline_places
from terrain_forge.paths.interpolation import turns_between
from tests.helpers import worlds
from tests.helpers.gazebo import rested
from tests.helpers.rovers import morpheus
from tests.helpers.sdf_files import exported, waypoints, winding
from tests.helpers.surfaces import resting_height


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
@pytest.mark.parametrize(("x", "y"), [(6.3, -3.4), (-9.13, 5.77), (9.02, 6.01)])
def test_a_ball_rests_on_a_heightmap_in_gazebos_physics(small_world, tmp_path, build, x, y):
    world = worlds.bare(small_world)
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
    world = worlds.on_ground(small_world, plane, field=field, library=library)
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
