"""The rover's own files: four formats that agree in every mass, joint and inertia."""

from __future__ import annotations

import math
import subprocess
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path
from urllib.parse import unquote

import mujoco
import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation
from ruamel.yaml import YAML
from terrain_forge.exporters.mjcf.rover import servo_gain
from terrain_forge.exporters.rover import Options, export, opening
from terrain_forge.exporters.rover.readback import urdf_findings

from terrain_forge.base import ExportError, RecipeError, matrix_from_quaternion, quaternion_from_rpy
from terrain_forge.geometry import rover_mesh
from terrain_forge.model import Coupling, simple_sensors
from terrain_forge.rovers import built_in_rovers, find_rover
from tests.helpers import rovers, worlds
from tests.helpers.pythons import asked
from tests.helpers.rovers import morpheus, skid4
from tests.helpers.usd_stages import frictions


def exported(rover, folder, **options):
    folder.mkdir()
    report = export(worlds.world(rocks=2, rover=rover), folder, options=Options(**options))
    found = sorted(p.relative_to(folder) for p in folder.rglob("*") if p.is_file())
    assert list(report.files) == found
    return folder, report.losses


@pytest.fixture(scope="module")
def custom(tmp_path_factory):
    return rovers.read(rovers.rocker_urdf(tmp_path_factory.mktemp("urdf")))


@pytest.fixture(scope="module", params=[*built_in_rovers(), "detailed", "custom"])
def case(request, tmp_path_factory):
    """A rover and its files."""
    rover = {
        "detailed": lambda: morpheus(model="detailed", grousers={}),
        "custom": lambda: request.getfixturevalue("custom"),
    }.get(request.param, partial(find_rover, request.param))()
    folder, _ = exported(rover, tmp_path_factory.mktemp(request.param) / "rover")
    return rover, folder


def numbers(text):
    return np.array((text or "0 0 0").split(), float)


def same(one, other, *, tolerance):
    for found, wanted in zip(one, other, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=tolerance, atol=tolerance)


def in_sdf(path):
    """`rovers.total` of an SDF model in its own frame, and its joints by name."""
    model = ET.parse(path).getroot().find("model")
    parts = []
    for link in model.findall("link"):
        place = numbers(link.findtext("pose"))[:3]
        inertial = link.find("inertial")
        at = place + numbers(inertial.findtext("pose"))[:3]
        xx, xy, xz, yy, yz, zz = (
            float(inertial.findtext(f"inertia/i{name}")) for name in "xx xy xz yy yz zz".split()
        )
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        parts.append((float(inertial.findtext("mass")), at, tensor))
    return rovers.total(parts), {joint.get("name"): joint for joint in model.findall("joint")}


def in_usd(stage):
    """`rovers.total` of all rigid bodies of a stage."""
    cache, parts = UsdGeom.XformCache(), []
    for prim in stage.Traverse():
        if not prim.HasAPI(UsdPhysics.RigidBodyAPI):
            continue
        mass = UsdPhysics.MassAPI(prim)
        pose = np.array(cache.GetLocalToWorldTransform(prim))
        w = mass.GetPrincipalAxesAttr().Get()
        turn = matrix_from_quaternion(np.array([w.GetReal(), *w.GetImaginary()]))
        tensor = turn @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ turn.T
        at = np.array(mass.GetCenterOfMassAttr().Get()) + pose[3, :3]
        parts.append((mass.GetMassAttr().Get(), at, tensor))
    return rovers.total(parts)


def test_all_formats_weigh_and_turn_alike(case):
    rover, folder = case
    wanted = rovers.at_rest(rover)
    for suffix in ("urdf", "xml"):
        model = mujoco.MjModel.from_xml_path(str(folder / f"{rover.name}.{suffix}"))
        same(rovers.in_mujoco(model), wanted, tolerance=1e-8)
    found, _ = in_sdf(folder / f"{rover.name}.sdf")
    same(found, wanted, tolerance=1e-9)
    stage = Usd.Stage.Open(str(folder / f"{rover.name}.usda"))
    same(in_usd(stage), wanted, tolerance=2e-6)


def test_each_link_has_its_inertia_in_urdf_and_mjcf(case):
    rover, folder = case
    for suffix in ("urdf", "xml"):
        model = mujoco.MjModel.from_xml_path(str(folder / f"{rover.name}.{suffix}"))
        for link in rover.links:
            body = model.body(link.name)
            assert body.mass[0] == pytest.approx(link.mass, rel=1e-9)
            turn = matrix_from_quaternion(body.iquat)
            np.testing.assert_allclose(
                turn @ np.diag(body.inertia) @ turn.T, link.inertia, rtol=1e-7, atol=1e-9
            )


def test_joints_turn_alike_in_urdf_and_mjcf(case):
    """The same angles in both put every body in the same place."""
    rover, folder = case
    angles = {n.name: 0.1 + 0.05 * k for k, n in enumerate(rover.links) if n.joint != "free"}
    places = []
    for suffix in ("urdf", "xml"):
        model = mujoco.MjModel.from_xml_path(str(folder / f"{rover.name}.{suffix}"))
        data = mujoco.MjData(model)
        for name, angle in angles.items():
            data.joint(f"{name}_joint" if suffix == "urdf" else name).qpos = angle
        mujoco.mj_kinematics(model, data)
        places.append([np.r_[data.body(n.name).xpos, data.body(n.name).xquat] for n in rover.links])
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)
    assert np.ptp([place[3] for place in places[0]]) > 0.001


def test_urdf_joints_carry_limits_damping_friction_and_torque(case):
    rover, folder = case
    robot = ET.parse(folder / f"{rover.name}.urdf").getroot()
    joints = {joint.get("name"): joint for joint in robot.findall("joint")}
    for link in rover.links[1:]:
        joint = joints[f"{link.name}_joint"]
        dynamics = joint.find("dynamics")
        assert float(dynamics.get("damping")) == pytest.approx(link.damping)
        assert float(dynamics.get("friction")) == pytest.approx(link.friction)
        limit = joint.find("limit")
        effort = rover.torque_limit if link.joint == "motor" else 0.0
        assert float(limit.get("effort")) == pytest.approx(effort)
        if link.limits:
            assert joint.get("type") == "revolute"
            assert [float(limit.get(k)) for k in ("lower", "upper")] == pytest.approx(link.limits)
        else:
            assert joint.get("type") == "continuous"


def test_ros2_control_drives_each_wheel_and_tells_of_the_rockers(case):
    rover, folder = case
    robot = ET.parse(folder / f"{rover.name}.urdf").getroot()
    joints = robot.findall("ros2_control/joint")
    driven = [j.get("name") for j in joints if j.find("command_interface") is not None]
    assert driven == [f"{n.name}_joint" for n in rover.links if n.joint == "motor"]
    assert len(joints) == sum(n.joint in ("motor", "passive") for n in rover.links)
    text = (folder / f"{rover.name}_controllers.yaml").read_text()
    drive = YAML(typ="safe").load(text)["diff_drive_controller"]["ros__parameters"]
    left = {f"{w.link}_joint" for w in rover.wheels if w.centre[1] > 0}
    assert set(drive["left_wheel_names"]) == left
    assert set(drive["right_wheel_names"]) == {f"{w.link}_joint" for w in rover.wheels} - left
    assert drive["wheel_radius"] == pytest.approx(rover.wheels[0].radius, abs=1e-6)
    spread = np.ptp(rover.wheel_centres[:, 1])
    assert drive["wheel_separation"] == pytest.approx(spread, abs=1e-6)
    plugin = robot.find("gazebo/plugin")
    assert plugin.findtext("parameters") == f"{rover.name}_controllers.yaml"


def test_sdf_joints_and_drive(case):
    rover, folder = case
    _, joints = in_sdf(folder / f"{rover.name}.sdf")
    for link in rover.links[1:]:
        axis = joints[f"{link.name}_joint"].find("axis")
        np.testing.assert_allclose(numbers(axis.findtext("xyz")), link.axis, atol=1e-9)
        assert float(axis.findtext("dynamics/damping")) == pytest.approx(link.damping)
    model = ET.parse(folder / f"{rover.name}.sdf").getroot().find("model")
    drive = next(p for p in model.findall("plugin") if "DiffDrive" in p.get("name"))
    left = {joint.text for joint in drive.findall("left_joint")}
    assert left == {f"{w.link}_joint" for w in rover.wheels if w.centre[1] > 0}
    sensors = {sensor.get("name") for sensor in model.iter("sensor")}
    assert sensors == {sensor.name for sensor in simple_sensors(rover.sensors)}
    config = ET.parse(folder / "model.config").getroot()
    assert (folder / config.findtext("sdf")).is_file()
    for uri in model.iter("uri"):
        assert (folder / uri.text).is_file()


def test_usd_is_an_articulation_without_findings(case):
    rover, folder = case
    stage = Usd.Stage.Open(str(folder / f"{rover.name}.usda"))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [(error.GetName(), error.GetMessage()) for error in errors] == []
    root = stage.GetDefaultPrim()
    assert root.HasAPI(UsdPhysics.ArticulationRootAPI)
    colliders = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(colliders) == sum(shape.collides for n in rover.links for shape in n.shapes)
    assert list(frictions(stage).values()) == [[1.0]] * len(colliders)


def test_usd_joints_meet_where_the_links_do(case):
    rover, folder = case
    stage = Usd.Stage.Open(str(folder / f"{rover.name}.usda"))
    cache, places = UsdGeom.XformCache(), rovers.origins(rover)
    wheels = {wheel.link for wheel in rover.wheels}
    for link in rover.links[1:]:
        joint = UsdPhysics.RevoluteJoint(stage.GetPrimAtPath(f"/{rover.name}/Joints/{link.name}"))
        for side in (0, 1):
            (body,) = getattr(joint, f"GetBody{side}Rel")().GetTargets()
            pose = cache.GetLocalToWorldTransform(stage.GetPrimAtPath(body))
            at = pose.Transform(getattr(joint, f"GetLocalPos{side}Attr")().Get())
            np.testing.assert_allclose(at, places[link.name], atol=1e-6)
            turn = getattr(joint, f"GetLocalRot{side}Attr")().Get()
            axis = matrix_from_quaternion(np.array([turn.GetReal(), *turn.GetImaginary()]))[:, 0]
            np.testing.assert_allclose(axis, link.axis, atol=1e-6)
        if link.limits:
            found = [joint.GetLowerLimitAttr().Get(), joint.GetUpperLimitAttr().Get()]
            np.testing.assert_allclose(np.radians(found), link.limits, rtol=1e-6)
        drive = UsdPhysics.DriveAPI(joint.GetPrim(), "angular")
        damping = drive.GetDampingAttr().Get() * 180 / math.pi
        if link.name in wheels:
            model = mujoco.MjModel.from_xml_path(str(folder / f"{rover.name}.xml"))
            limits = model.actuator(link.name).forcerange
            np.testing.assert_allclose(limits, (-rover.torque_limit, rover.torque_limit))
            assert damping == pytest.approx(servo_gain(rover), rel=1e-6)
            assert drive.GetMaxForceAttr().Get() == pytest.approx(rover.torque_limit)
        else:
            assert damping == pytest.approx(link.damping, rel=1e-6)


def test_cameras_look_where_the_rover_says(case):
    rover, folder = case
    model = mujoco.MjModel.from_xml_path(str(folder / f"{rover.name}.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    stage = Usd.Stage.Open(str(folder / f"{rover.name}.usda"))
    robot = ET.parse(folder / f"{rover.name}.urdf").getroot()
    frames = {j.find("child").get("link"): j.find("origin") for j in robot.findall("joint")}
    for sensor in simple_sensors(rover.sensors):
        ahead = matrix_from_quaternion(quaternion_from_rpy(sensor.rpy))[:, 0]
        told = frames[sensor.name]
        np.testing.assert_allclose(numbers(told.get("xyz")), sensor.position, atol=1e-9)
        np.testing.assert_allclose(numbers(told.get("rpy")), sensor.rpy, atol=1e-9)
        if sensor.kind != "camera":
            continue
        seen = -data.camera(sensor.name).xmat.reshape(3, 3)[:, 2]
        np.testing.assert_allclose(seen, ahead, atol=1e-9)
        camera = stage.GetPrimAtPath(f"/{rover.name}/base_link/{sensor.name}/camera")
        pose = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(camera))
        np.testing.assert_allclose(-pose[2, :3], ahead, atol=1e-6)
        np.testing.assert_allclose(pose[3, :3], sensor.position, atol=1e-6)


def test_wheels_of_several_radii_are_told_where_controllers_know_one(custom, tmp_path):
    first, *others = custom.wheels
    mixed = custom.replace(wheels=(first.replace(radius=1.5 * first.radius), *others))
    one = "know one radius of all wheels: their mean, 0.169 m, of 0.15 to 0.225 m."
    _, losses = exported(mixed, tmp_path / "mixed")
    assert sum(one in loss for loss in losses) == 1
    for folder, rover, formats in (("mjcf", mixed, ("mjcf",)), ("alike", custom, ("urdf",))):
        _, losses = exported(rover, tmp_path / folder, formats=formats)
        assert not any("one radius" in loss for loss in losses)


def test_gears_are_kept_where_a_format_has_them(custom, tmp_path):
    assert custom.couplings
    folder, losses = exported(custom, tmp_path / "fortress")
    assert sum("gears are left out" in loss for loss in losses) == 2
    assert any("Held at rest" in loss for loss in losses)
    mimic = ET.parse(folder / "tub.urdf").getroot().find("joint[@name='right_rocker_joint']/mimic")
    assert (mimic.get("joint"), float(mimic.get("multiplier"))) == ("left_rocker_joint", -1.0)
    model = mujoco.MjModel.from_xml_path(str(folder / "tub.xml"))
    assert model.neq == 1
    np.testing.assert_array_equal(model.eq_data[0, :2], (0.0, -1.0))
    folder, losses = exported(custom, tmp_path / "harmonic", release="harmonic")
    assert sum("gears are left out" in loss for loss in losses) == 1
    assert (
        sum("Drake puts motors" in loss and "(right_rocker_joint)" in loss for loss in losses) == 1
    )
    _, joints = in_sdf(folder / "tub.sdf")
    told = joints["right_rocker_joint"].find("axis/mimic")
    assert (told.get("joint"), float(told.findtext("multiplier"))) == ("left_rocker_joint", -1.0)


def test_drake_finds_motors_on_wheels_alone(custom, tmp_path):
    """It makes one of each joint whose effort is not 0; a gear needs effort in Gazebo's engine."""
    for release, follows in (("fortress", 0.0), ("harmonic", -1.0)):
        folder, _ = exported(custom, tmp_path / release, formats=("sdf",), release=release)
        _, joints = in_sdf(folder / "tub.sdf")
        efforts = {name: float(j.findtext("axis/limit/effort")) for name, j in joints.items()}
        wanted = {f"{wheel.link}_joint": custom.torque_limit for wheel in custom.wheels}
        passive = {"left_rocker_joint": 0.0, "right_rocker_joint": follows}
        assert efforts == pytest.approx(wanted | passive)


def test_a_coupled_joint_follows_in_mujoco(custom, tmp_path):
    gear = Coupling(link="right_rocker", leader="left_rocker", ratio=0.5, offset=0.1)
    model = rovers.on_the_flat(custom.replace(couplings=(gear,)), tmp_path)
    model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[2] = 3.0
    data.joint("left_rocker").qpos = 0.2
    mujoco.mj_step(model, data, 2000)
    followed = 0.1 + 0.5 * data.joint("left_rocker").qpos[0]
    assert data.joint("right_rocker").qpos[0] == pytest.approx(followed, abs=0.01)


@pytest.mark.parametrize("suffix", ["urdf", "xml"])
def test_what_was_written_reads_back_as_the_same_rover(case, suffix):
    rover, folder = case
    again = rovers.read(folder / f"{rover.name}.{suffix}")
    same(rovers.at_rest(again), rovers.at_rest(rover), tolerance=1e-8)
    assert {w.link for w in again.wheels} == {w.link for w in rover.wheels}
    there = {w.link: w for w in rover.wheels}
    for wheel in again.wheels:
        np.testing.assert_allclose(wheel.centre, there[wheel.link].centre, atol=1e-8)
        assert wheel.radius == pytest.approx(there[wheel.link].radius, rel=1e-7)
        assert wheel.width == pytest.approx(there[wheel.link].width, rel=1e-7)
    joints = [{n.name: n for n in r.links} for r in (again, rover)]
    assert joints[0].keys() == joints[1].keys()
    for name, link in joints[0].items():
        wanted = joints[1][name]
        assert link.joint == wanted.joint
        assert link.limits == pytest.approx(wanted.limits)
        assert (link.damping, link.friction) == pytest.approx((wanted.damping, wanted.friction))
        if link.joint != "free":
            np.testing.assert_allclose(link.axis, wanted.axis, atol=1e-8)
        np.testing.assert_allclose(link.origin, wanted.origin, atol=1e-8)
    assert again.couplings == rover.couplings
    assert again.torque_limit == pytest.approx(rover.torque_limit)


def test_urdfdom_would_read_the_urdf(case):
    rover, folder = case
    assert list(urdf_findings(folder / f"{rover.name}.urdf")) == []


def test_colours_that_round_to_the_same_bytes_are_materials_of_their_own(tmp_path):
    rover = skid4()
    base = rover.links[0]
    near, same = (
        base.shapes[0].replace(rgb=tuple(value + more for value in base.shapes[0].rgb))
        for more in (1e-4, 1e-15)
    )
    base = base.replace(shapes=(*base.shapes, near, same))
    folder, _ = exported(rover.replace(links=(base, *rover.links[1:])), tmp_path / "two")
    assert list(urdf_findings(folder / "skid4.urdf")) == []
    robot = ET.parse(folder / "skid4.urdf").getroot()
    told = {m.get("name"): m.find("color").get("rgba") for m in robot.findall("material")}
    visuals = robot.find("link").findall("visual")
    colours = [told[visual.find("material").get("name")] for visual in visuals]
    assert colours[0] == colours[-1] != colours[-2]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<link ", '<material name="m"/><material name="m"/><link ', "material 'm' is not unique"),
        ('<link name="wheel_front_left"', '<link name="base_link"', "'base_link' is not unique"),
        ('<material name="rgb', '<material name="rgba', "is nowhere defined"),
        ('type="continuous"', 'type="hinge"', "has the type 'hinge'"),
        ('<limit effort="30"', '<limit type="continuous"', ""),
        ('<mass value="', '<mass value="-', "has a mass of -"),
        ('<parent link="base_link"/>', '<parent link="wheel_front_left"/>', "in a loop"),
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', "has no axis"),
        ('<box size="', '<box length="', "has a box without a size"),
    ],
)
def test_what_urdfdom_would_refuse_is_found(tmp_path, old, new, said):
    folder, _ = exported(skid4(), tmp_path / "skid4", formats=("urdf",))
    text = (folder / "skid4.urdf").read_text()
    assert old in text
    (folder / "skid4.urdf").write_text(text.replace(old, new, 1))
    found = list(urdf_findings(folder / "skid4.urdf"))
    assert any(said in one for one in found) if said else not found


def test_only_the_chosen_formats_are_written(tmp_path):
    folder, _ = exported(skid4(), tmp_path / "one", formats=("usd",))
    assert [path.name for path in folder.iterdir()] == ["skid4.usda"]
    folder, _ = exported(skid4(), tmp_path / "two", formats=("urdf",))
    assert {path.name for path in folder.iterdir()} == {"skid4.urdf", "skid4_controllers.yaml"}


def test_no_model_has_the_name_that_sdf_keeps_for_itself(tmp_path):
    folder, _ = exported(skid4().replace(name="world"), tmp_path / "one", formats=("sdf",))
    assert ET.parse(folder / "the_world.sdf").find("model").get("name") == "the_world"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"formats": ("urdf", "urdf")}, "urdf is named twice"),
        ({"formats": ("urdf",), "release": "harmonic"}, "sdf is none of the formats"),
        ({"formats": ("usd",), "mesh_prefix": "package://a/"}, "urdf is none of the formats"),
    ],
)
def test_formats_are_named_once_and_others_have_no_options(options, said):
    with pytest.raises(RecipeError, match=said):
        Options(**options)


def test_mesh_paths_take_the_chosen_prefix(custom, tmp_path):
    folder, _ = exported(custom, tmp_path / "ros", mesh_prefix="package://tub_description/")
    robot = ET.parse(folder / "tub.urdf").getroot()
    names = {mesh.get("filename") for mesh in robot.iter("mesh")}
    assert names
    for name in names:
        assert (folder / name.removeprefix("package://tub_description/")).is_file()


def test_rviz_is_given_whole_addresses_of_meshes(custom, tmp_path):
    """It finds no relative ones, and none with blanks in them."""
    (tmp_path / "my world").mkdir()
    folder, _ = exported(custom, tmp_path / "my world" / "a rover", formats=("urdf",))
    copied, _, launched = opening(folder, Options()).commands.partition(" && ")
    subprocess.run(["bash", "-c", copied.replace("/tmp/", "../")], cwd=folder.parent, check=True)
    assert launched.endswith("model:=/tmp/tub.urdf")
    named = [mesh.get("filename") for mesh in ET.parse(tmp_path / "tub.urdf").iter("mesh")]
    assert named
    assert not [name for name in named if " " in name]
    assert all(Path(unquote(name.removeprefix("file://"))).is_file() for name in named)


@pytest.mark.parametrize("rover", ["skid4", "custom"])
def test_a_urdf_that_rviz_reads_as_it_is_is_shown_as_it_is(rover, custom, tmp_path):
    rover = skid4() if rover == "skid4" else custom
    chosen = {"formats": ("urdf",), "mesh_prefix": "package://mine/" if rover is custom else ""}
    folder, _ = exported(rover, tmp_path / "rover", **chosen)
    launch = "ros2 launch urdf_tutorial display.launch.py"
    words = opening(folder, Options(**chosen)).commands
    assert words == f'{launch} model:="$PWD"/rover/{rover.name}.urdf'


def test_meshes_bring_the_colours_of_their_shapes(custom, tmp_path):
    """RViz shows them in no other."""
    folder, _ = exported(custom, tmp_path / "rover", formats=("urdf",))
    for number, link in enumerate(custom.links):
        for part, shape in enumerate(link.shapes):
            if shape.mesh is not None:
                mesh = trimesh.load(folder / "meshes" / rover_mesh(number, part))
                wanted = np.round(255 * np.array(shape.rgb))
                np.testing.assert_array_equal(mesh.visual.material.diffuse[:3], wanted)


def test_a_world_without_a_rover_has_none_to_export(tmp_path):
    with pytest.raises(ExportError, match="no rover"):
        export(worlds.world(rocks=2), tmp_path, options=Options())


# ---- the real consumers


@pytest.mark.consumer
@pytest.mark.parametrize("suffix", ["urdf", "sdf"])
def test_drake_reads_the_rover(case, suffix):
    rover, folder = case
    file = folder / f"{rover.name}.{suffix}"
    found = asked("TERRAIN_FORGE_DRAKE_PYTHON", "pydrake", "urdf_in_drake.py", file)
    sums = (found["mass"], found["centre"], found["inertia"])
    same(sums, rovers.at_rest(rover), tolerance=1e-8)
    assert found["actuators"] == len(rover.wheels)


@pytest.mark.consumer
def test_pybullet_reads_the_urdf(case):
    rover, folder = case
    urdf = folder / f"{rover.name}.urdf"
    found = asked("TERRAIN_FORGE_PYBULLET_PYTHON", "pybullet", "urdf_in_pybullet.py", urdf)
    mass, centre, _ = rovers.at_rest(rover)
    same((found["mass"], found["centre"]), (mass, centre), tolerance=1e-6)
    assert found["turning"] == sum(n.joint in ("motor", "passive") for n in rover.links)


@pytest.mark.consumer
def test_libsdformat_has_no_finding(case, build):
    program = build("sdf_check", "sdformat12")
    rover, folder = case
    text = (folder / f"{rover.name}.sdf").read_text()
    text = text.replace("<model ", '<world name="w"><model ', 1)
    world = folder / "world.sdf"
    world.write_text(text.replace("</sdf>", "</world></sdf>"))
    run = subprocess.run([program, world, folder], capture_output=True, text=True, check=False)
    world.unlink()
    assert run.returncode == 0, run.stdout + run.stderr
    assert "models 1" in run.stdout
