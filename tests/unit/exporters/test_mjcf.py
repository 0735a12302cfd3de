import xml.etree.ElementTree as ET
from importlib import import_module

import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image
from terrain_forge.exporters import mjcf
from terrain_forge.exporters.mjcf import Options
from terrain_forge.exporters.mjcf.blocks import CELLS, split_ground, wide_rocks
from terrain_forge.exporters.mjcf.losses import list_losses
from terrain_forge.exporters.mjcf.rocks import SCALE_ERROR, shared_scale

from terrain_forge.base import (
    ExportError,
    matrix_from_quaternion,
    quaternion_from_rpy,
    srgb_from_linear,
)
from terrain_forge.driving import Vehicle
from terrain_forge.driving.controller import wheel_rates
from terrain_forge.geometry import rock_maps, rock_texture
from terrain_forge.model import Export, Heightfield, Mesh
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import rock_tints, tint_colours
from terrain_forge.validation.checks.drives import rover_mass_check
from terrain_forge.validation.suite import quick_checks
from terrain_forge.validation.surface_mesh import heights_on
from tests.helpers import rovers, worlds
from tests.helpers.ground_pictures import FINER, PIXELS, shows_its_nodes, speckled
from tests.helpers.rovers import morpheus

SKY = 1000.0


@pytest.fixture(scope="module")
def world():
    return worlds.world(rover=morpheus())


@pytest.fixture(scope="module")
def exported(world, tmp_path_factory):
    return export(world, tmp_path_factory.mktemp("mjcf"))


def export(world, folder, **options):
    mjcf.export(world, folder, options=mjcf.Options(**options))
    return folder


def load(folder, name="world.xml"):
    model = mujoco.MjModel.from_xml_path(str(folder / name))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def ray_down(model, data, x, y, group):
    geom = np.zeros(1, np.int32)
    groups = (np.arange(6) == group).astype(np.uint8)
    if group == 1:
        groups[3] = 1  # hulls of rocks that are drawn by their shapes
    distance = mujoco.mj_ray(model, data, (x, y, SKY), (0, 0, -1), groups, 1, -1, geom)
    assert distance >= 0
    return SKY - distance, model.geom(int(geom[0])).name


def largest_ground_error(world, folder, count=500):
    model, data = load(folder)
    west, south, east, north = world.ground.bounds
    points = np.random.default_rng(3).uniform((west, south), (east, north), (count, 2))
    found = [ray_down(model, data, *point, group=0)[0] for point in points]
    return np.abs(found - world.ground.height_at(*points.T)).max()


def test_a_window_away_from_the_centre_lies_where_it_should(world, tmp_path):
    tile = list(world.tiles(cells=40))[-1].world
    assert tile.ground.bounds[0] > 0
    assert largest_ground_error(tile, export(tile, tmp_path)) < 1e-5


def test_a_ground_of_several_fields_is_one_ground(world, tmp_path, monkeypatch):
    module = import_module("terrain_forge.exporters.mjcf.writing")
    monkeypatch.setattr(module, "_LARGEST_FIELD", 32)
    folder = export(world, tmp_path)
    model, _ = load(folder)
    assert model.nhfield == 6
    touched = (model.geom_contype | model.geom_conaffinity) > 0
    names = [model.geom(n).name for n in np.flatnonzero(touched)]
    assert sum(name.startswith("rock_") for name in names) == 40
    assert largest_ground_error(world, folder) < 1e-5


def flat(world, height):
    elevation = np.full(world.ground.shape, height)
    return world.replace(
        ground=world.ground.replace(elevation=elevation),
        field=world.field.select(np.array([], dtype=int)),
        trajectories=(),
    )


def test_a_ball_rests_on_a_flat_ground(world, tmp_path):
    folder = export(flat(world, 3.25), tmp_path)
    ball = """<mujoco><include file="world.xml"/><worldbody><body pos="1 2 3.5"><freejoint/>
        <geom type="sphere" size="0.2" mass="5"/></body></worldbody></mujoco>"""
    (folder / "ball.xml").write_text(ball)
    model, data = load(folder, "ball.xml")
    mujoco.mj_step(model, data, 3000)
    np.testing.assert_allclose(data.qpos[:3], (1, 2, 3.45), atol=1e-3)


def test_rocks_lie_as_in_the_field_when_sizes_are_exact(world, tmp_path):
    few = world.replace(field=world.field.select(np.arange(8)))
    model, data = load(export(few, tmp_path, exact_scale=True))
    rng = np.random.default_rng(2)
    for row in range(8):
        matrix = matrix_from_quaternion(few.field.quaternion[row]) * few.field.scale[row]
        hull = few.library.prototypes[few.field.prototype[row]].hulls[0]
        placed = Mesh(vertices=hull.vertices @ matrix.T + few.field.position[row], faces=hull.faces)
        reach = 0.25 * few.field.scale[row]
        points = few.field.position[row, :2] + rng.uniform(-reach, reach, (10, 2))
        for point, height in zip(points, heights_on(placed, points), strict=True):
            found, name = ray_down(model, data, *point, group=1)
            if name == f"rock_{few.field.id[row]}":
                assert found == pytest.approx(height, abs=1e-5)
            else:
                assert found > height  # a neighbour of this hand-made field covers it


def test_shared_sizes_are_few_and_near():
    scale = np.geomspace(0.1, 3.0, 5000)
    shared = shared_scale(scale)
    assert np.abs(shared / scale - 1).max() <= SCALE_ERROR + 1e-12
    assert len(np.unique(shared)) < 180
    np.testing.assert_array_equal(shared_scale(shared), shared)


@pytest.fixture(scope="module")
def loosened(world):
    return worlds.loosened(world)


def test_dynamic_rocks_are_bodies_of_their_own_size(loosened, tmp_path):
    model, data = load(export(loosened, tmp_path), "scene.xml")
    field, library = loosened.field, loosened.library
    assert model.nbody == 2 + len(loosened.rover.links) + field.dynamic.sum()
    for row in np.flatnonzero(field.dynamic):
        rock = f"rock_{field.id[row]}"
        body, placed = model.body(rock), data.body(rock)
        assert body.dofnum == 6
        np.testing.assert_allclose(placed.xpos, field.position[row], atol=1e-7)
        np.testing.assert_allclose(placed.xquat, field.quaternion[row], atol=1e-7)
        shape = library.prototypes[field.prototype[row]]
        hull, seen = model.geom(rock), model.geom(f"{rock}_shape")
        contact = dynamic_contact(field.diameter[row])
        assert hull.condim[0] == contact.condim
        np.testing.assert_allclose(hull.friction, contact.friction)
        np.testing.assert_allclose(hull.solref, contact.solref)
        assert seen.contype[0] == seen.conaffinity[0] == 0
        mesh = model.mesh(hull.dataid[0])
        first = mesh.vertadr[0]
        exact = np.ptp(shape.hulls[0].vertices, axis=0) * field.scale[row]
        turn = matrix_from_quaternion(model.mesh_quat[hull.dataid[0]])
        points = model.mesh_vert[first : first + mesh.vertnum[0]] @ turn.T
        np.testing.assert_allclose(np.ptp(points, axis=0), exact, atol=1e-5)


def test_what_meets_what(loosened, tmp_path):
    """Dynamic rocks meet all that is solid, the rover too; the ground and static rocks only
    those."""
    model, _ = load(export(loosened, tmp_path), "scene.xml")
    field = loosened.field
    fixed, unsolid = field.id[field.collides & ~field.dynamic][0], field.id[~field.collides][0]
    one, other = (f"rock_{n}" for n in field.id[field.dynamic][:2])
    wheel = next(n for n in range(model.ngeom) if model.geom_priority[n] == 1)

    def meet(a, b):
        a, b = model.geom(a), model.geom(b)
        return bool((a.contype & b.conaffinity) | (b.contype & a.conaffinity))

    for partner in ("block_0", f"rock_{fixed}", other, wheel):
        assert meet(one, partner)
    assert not meet("block_0", f"rock_{fixed}")
    names = {model.geom(n).name for n in range(model.ngeom)}
    for name in (f"rock_{unsolid}", f"rock_{unsolid}_shape"):
        if name in names:
            assert not meet(one, name)
            assert not meet(wheel, name)


def test_every_convex_part_is_a_geom(loosened, tmp_path):
    shapes = [p.replace(hulls=(*p.hulls, *p.hulls)) for p in loosened.library.prototypes]
    world = loosened.replace(library=loosened.library.replace(prototypes=tuple(shapes)))
    model, _ = load(export(world, tmp_path))
    names = {model.geom(n).name for n in range(model.ngeom)}
    for rock in world.field.id[world.field.collides]:
        assert {f"rock_{rock}", f"rock_{rock}_1"} <= names
    bodies = model.geom_bodyid[[model.geom(f"rock_0{part}").id for part in ("", "_1", "_shape")]]
    assert (bodies == model.body("rock_0").id).all()


def with_slabs(world, *places, scale=0.3):
    """A flat ground with dynamic slabs on it, of 0.36 × 0.36 × 0.18 m unless scaled otherwise."""
    box = trimesh.creation.box((1.2, 1.2, 0.6))
    mesh = Mesh(vertices=box.vertices, faces=box.faces)
    slab = world.library.prototypes[0].replace(
        meshes=(mesh,),
        hulls=(mesh,),
        uvs=(np.zeros((12, 3, 2)),),
        volume=box.volume,
        inertia=box.moment_inertia,
    )
    count = len(places)
    volume = np.full(count, box.volume * scale**3)
    field = world.field.select(np.arange(count)).replace(
        dynamic=np.ones(count),
        prototype=np.zeros(count),
        scale=np.full(count, scale),
        diameter=np.full(count, 1.2 * scale),
        position=[(x, y, 0.3 * scale) for x, y in places],
        quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        volume=volume,
        mass=500 * volume,
    )
    library = world.library.replace(prototypes=(slab,))
    return flat(world, 0.0).replace(field=field, library=library)


def test_a_slab_that_lies_flat_stays_and_can_be_pushed(world, tmp_path):
    level = with_slabs(world, (0.0, 0.0))
    model, data = load(export(level, tmp_path))
    mujoco.mj_step(model, data, 2500)
    np.testing.assert_allclose(data.qpos[:3], (0, 0, 0.09), atol=1e-3)
    data.xfrc_applied[1, 0] = 1.3 * 0.7 * level.field.mass[0] * world.site.body.gravity
    mujoco.mj_step(model, data, 500)
    assert data.qpos[0] > 0.1


def test_the_rover_stands_among_dynamic_rocks_and_pushes_what_is_in_its_way(world, tmp_path):
    front = max((wheel.centre for wheel in world.rover.wheels), key=lambda centre: centre[0])
    level = with_slabs(world, (0.0, 4.0), (front[0] + 0.5, front[1]))
    model, _ = load(export(level, tmp_path), "scene.xml")
    assert rover_mass_check(level, model, "mjcf").passed
    vehicle = Vehicle(model, level.rover)
    vehicle.set_down(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    assert vehicle.rock_forces() == {}  # the slabs touch the ground, not the rover
    touched = {}
    for _ in range(100):
        vehicle.step(wheel_rates(level.rover, 0.2, 0.0), 25)
        touched |= vehicle.rock_forces()
        assert not vehicle.fault()
    assert list(touched) == ["rock_1"]
    moved = vehicle.data.body("rock_1").xpos - level.field.position[1]
    assert np.linalg.norm(moved) > 0.02
    np.testing.assert_allclose(vehicle.data.body("rock_0").xpos, level.field.position[0], atol=1e-3)


@pytest.mark.parametrize(("split", "stays"), [(True, True), (False, False)])
def test_a_wide_slab_keeps_its_contacts_only_on_a_split_ground(world, tmp_path, split, stays):
    """A slab of 4 m on cells of 0.25 m: 16 cells each way."""
    level = with_slabs(world, (0.3, 0.2), scale=4 / 1.2)
    model, data = load(export(level, tmp_path, split_ground=split))
    mujoco.mj_step(model, data, 400)
    pairs, counts = np.unique(data.contact.geom, axis=0, return_counts=True)
    tilt = 2 * np.arccos(min(1.0, abs(data.qpos[3])))
    moved = np.linalg.norm(data.qpos[:3] - level.field.position[0])
    assert (moved < 1e-3 and tilt < 1e-3) == stays
    if split:
        assert len(pairs) >= 16
        assert counts.max() <= 32  # two per cell: MuJoCo drops from 50 on
        assert not data.warning[mujoco.mjtWarning.mjWARN_CONTACTFULL].number


def test_blocks_are_the_ground(loosened, tmp_path):
    """They cover each cell once and have its heights; what is seen is not touched."""
    wide = wide_rocks(loosened.field, loosened.ground.spacing)
    assert len(wide) >= 1
    blocks = split_ground(loosened.ground, wide)
    cover = np.zeros([nodes - 1 for nodes in loosened.ground.shape], int)
    for block in blocks:
        rows = slice(block.row, block.row + block.rows)
        cover[rows, block.column : block.column + block.columns] += 1
    assert (cover == 1).all()
    assert max(max(b.rows, b.columns) for b in blocks) > CELLS
    for x, y in wide.position[:, :2] - loosened.ground.origin:
        j, i = int(y / 0.25), int(x / 0.25)
        under = [b for b in blocks if 0 <= j - b.row < b.rows and 0 <= i - b.column < b.columns]
        assert max(under[0].rows, under[0].columns) <= CELLS
    folder = export(loosened, tmp_path)
    model, data = load(folder)
    touched = (model.geom_contype | model.geom_conaffinity) > 0
    fields = model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD
    assert (touched & fields).sum() == len(blocks)
    assert not touched[model.geom("ground").id]
    west, south, east, north = loosened.ground.bounds
    groups = (np.arange(6) == 4).astype(np.uint8)
    geom = np.zeros(1, np.int32)
    for x, y in np.random.default_rng(3).uniform((west, south), (east, north), (300, 2)):
        distance = mujoco.mj_ray(model, data, (x, y, SKY), (0, 0, -1), groups, 1, -1, geom)
        wanted = float(loosened.ground.height_at(x, y))
        assert SKY - distance == pytest.approx(wanted, abs=1e-5)


def test_too_many_wide_rocks_or_geoms_are_refused_with_a_way_out(loosened, tmp_path, monkeypatch):
    monkeypatch.setattr(import_module("terrain_forge.exporters.mjcf.blocks"), "MOST", 5)
    with pytest.raises(ExportError, match=r"height fields, at most 5.*split_ground: false"):
        export(loosened, tmp_path)
    export(loosened, tmp_path, split_ground=False)
    room = import_module("terrain_forge.exporters.mjcf.losses")
    monkeypatch.setattr(room, "MOST_GEOMS", 30)
    with pytest.raises(ExportError, match=r"40 rocks make \d+ geoms to touch.*at most.*diameter_m"):
        export(loosened, tmp_path)


def test_larger_visual_min_m_makes_fewer_geoms(loosened, tmp_path, monkeypatch):
    room = import_module("terrain_forge.exporters.mjcf.losses")
    field = loosened.field
    least = room.count_geoms(loosened, Options(visual_min_m=99.0))
    assert least == (40, field.dynamic.sum())
    most = room.count_geoms(loosened, Options(visual_min_m=0.0))
    assert most == (field.collides.sum(), 40)
    monkeypatch.setattr(room, "MOST_GEOMS", sum(least))
    with pytest.raises(ExportError, match=r"larger visual_min_m, here 0, or.*the format usd"):
        export(loosened, tmp_path, visual_min_m=0.0)
    export(loosened, tmp_path, visual_min_m=99.0)


def test_exact_scales_are_refused_and_told_by_what_they_cost(world, tmp_path, monkeypatch):
    losses = import_module("terrain_forge.exporters.mjcf.losses")
    monkeypatch.setattr(losses, "MANY_MESHES", 10)
    options = Options(exact_scale=True)
    told = " ".join(losses.list_losses(world, options))
    assert f"{sum(losses.count_geoms(world, options))} meshes: MuJoCo takes about 0 s" in told
    assert "to load" not in " ".join(losses.list_losses(world, Options()))
    monkeypatch.setattr("terrain_forge.exporters.mjcf.capacity.MOST_MESHES", 20)
    with pytest.raises(ExportError, match=r"exact_scale: true makes some .* leave it out"):
        export(world, tmp_path, exact_scale=True)
    export(world, tmp_path)


def test_the_track_moves_the_mocap_body_along_the_path(world, exported):
    """Equal at every sample, as the model itself places it."""
    trajectory = world.trajectories[0]
    model, data = load(exported, "scene.xml")
    track = np.loadtxt(exported / "paths/arc.csv", delimiter=",", skiprows=1)
    assert len(track) == len(trajectory.time)
    mocap = model.body("path").mocapid[0]
    for row, sample in enumerate(track):
        assert sample[0] == pytest.approx(trajectory.time[row], abs=1e-9)
        data.mocap_pos[mocap], data.mocap_quat[mocap] = sample[1:4], sample[4:]
        mujoco.mj_kinematics(model, data)
        place = data.body("path")
        np.testing.assert_allclose(place.xpos, trajectory.position[row], atol=1e-8)
        np.testing.assert_allclose(place.xquat, trajectory.quaternion[row], atol=1e-8)


def test_what_other_readers_of_mjcf_need_is_there(loosened, tmp_path):
    """MuJoCo Warp and Newton: rows and columns of each field, no option that they lack."""
    folder = export(loosened, tmp_path)
    root = ET.parse(folder / "world.xml").getroot()
    fields = list(root.iter("hfield"))
    assert len(fields) > 1
    assert all({"nrow", "ncol", "size"} <= set(field.attrib) for field in fields)
    option = root.find("option")
    assert option.get("solver") == "Newton"
    assert option.get("integrator") == "implicitfast"
    assert option.find("flag") is None


def test_large_rocks_show_their_texture(world, tmp_path):
    model, _ = load(export(world, tmp_path, visual_min_m=0.6))
    field = world.field
    for row in np.flatnonzero(field.diameter >= 0.6):
        seen = model.geom(f"rock_{field.id[row]}_shape")
        material = model.material(seen.matid[0])
        texture = model.texture(material.texid[mujoco.mjtTextureRole.mjTEXROLE_RGB])
        wanted = rock_texture(world, int(field.population[row]), tinted=True)
        colours = srgb_from_linear(tint_colours(world)[field.population[row]])
        own = colours[rock_tints(field.id[[row]], world.site.seed)[0]]
        assert np.allclose(material.rgba[:3] * colours.max(axis=0), own, atol=1e-6)
        assert (texture.height[0], texture.width[0]) == wanted.shape[:2]
        assert model.mesh_texcoordnum[seen.dataid[0]] > 0
        for role, image in zip(("NORMAL", "ROUGHNESS"), rock_maps(world), strict=True):
            number = material.texid[getattr(mujoco.mjtTextureRole, f"mjTEXROLE_{role}")]
            assert number >= 0
            assert (model.tex_height[number], model.tex_width[number]) == image.shape[:2]
        assert model.geom(f"rock_{field.id[row]}").group[0] == 3
    names = [model.geom(n).name for n in range(model.ngeom)]
    looks = {int(model.geom(name).matid[0]) for name in names if name.endswith("_shape")}
    assert len(looks) > 2, "rocks differ in colour"
    assert not any("of one colour" in line for line in list_losses(world, mjcf.Options()))
    assert sum(name.endswith("_shape") for name in names) == (field.diameter >= 0.6).sum()


def test_agreement_holds_with_dynamic_rocks_and_sees_a_wrong_mass(loosened, tmp_path):
    folder = tmp_path / "mjcf"
    folder.mkdir()
    export(loosened, folder)
    exports = [Export(folder="mjcf", kind="mjcf", options={})]
    found = quick_checks(loosened, tmp_path, exports, points=2000)
    checks = {check.name: check for check in found}
    assert "mjcf: dynamic rocks" in checks
    assert all(check.passed for check in checks.values())
    heavier = loosened.replace(field=loosened.field.replace(mass=loosened.field.mass * 1.001))
    found = quick_checks(heavier, tmp_path, exports, points=2000)
    checks = {check.name: check for check in found}
    assert not checks["mjcf: dynamic rocks"].passed


def test_losses_name_what_is_rounded(world, tmp_path):
    rounded = mjcf.export(world, tmp_path, options=mjcf.Options()).losses
    exact = mjcf.export(world, tmp_path, options=mjcf.Options(exact_scale=True)).losses
    assert set(rounded) - set(exact) == {rounded[0]}
    assert "1%" in rounded[0]
    by_shape = mjcf.export(world, tmp_path, options=mjcf.Options(visual_min_m=0)).losses
    assert any("drawn by their convex" in loss for loss in rounded)
    assert not any("drawn by their convex" in loss for loss in by_shape)


def test_the_scene_holds_the_rover_and_the_world_does_not(world, exported):
    bare, _ = load(exported)
    scene, data = load(exported, "scene.xml")
    assert bare.nbody == 1
    assert scene.nu == 6
    assert scene.body_mass.sum() == pytest.approx(world.rover.mass, abs=1e-9)
    for link in world.rover.links:
        body = scene.body(link.name)
        assert body.mass[0] == pytest.approx(link.mass)
        turn = matrix_from_quaternion(body.iquat)
        np.testing.assert_allclose(turn @ np.diag(body.inertia) @ turn.T, link.inertia, atol=1e-8)
    for wheel in world.rover.wheels:
        turn = data.body("base_link").xmat.reshape(3, 3)
        centre = data.body("base_link").xpos + turn @ wheel.centre
        np.testing.assert_allclose(data.body(wheel.link).xpos, centre, atol=1e-8)


def test_gravity_is_the_bodys(world, exported):
    model, _ = load(exported, "scene.xml")
    np.testing.assert_array_equal(model.opt.gravity, (0, 0, -world.site.body.gravity))


def test_the_rover_stands_on_its_start_and_settles_there(world, exported):
    model, data = load(exported, "scene.xml")
    start = world.trajectories[0].position[0]
    assert data.contact.dist.min(initial=0.0) > -1e-6
    mujoco.mj_step(model, data, 1500)
    position = data.body("base_link").xpos
    assert np.hypot(*(position - start)[:2]) < 0.05
    assert abs(position[2] - world.ground.height_at(*position[:2])) < 0.06
    assert np.abs(data.qvel).max() < 0.01


def test_a_keyframe_stands_at_each_paths_start(loosened, tmp_path):
    """The rover at a start that is not the scene's own, every dynamic rock where it lies."""
    first = loosened.trajectories[0]
    back = first.replace(name="back", position=first.position[::-1], rpy=first.rpy[::-1])
    starts = (first, back)
    export(loosened.replace(trajectories=starts), tmp_path)
    model, data = load(tmp_path, "scene.xml")
    assert loosened.field.dynamic.any()
    assert [model.key(n).name for n in range(model.nkey)] == [first.name, "back"]
    for number, start in enumerate(starts):
        mujoco.mj_resetDataKeyframe(model, data, number)
        mujoco.mj_forward(model, data)
        pose = data.joint("base_link_free").qpos
        np.testing.assert_allclose(pose[:2], start.position[0, :2], atol=1e-6)
        assert -1e-6 <= pose[2] - start.position[0, 2] < 0.2
        turn = quaternion_from_rpy(start.rpy[0])
        assert abs(pose[3:] @ turn) == pytest.approx(1, abs=1e-6)
        np.testing.assert_allclose(data.body("path").xpos, pose[:3], atol=1e-6)
        pose[:] = model.qpos0[model.joint("base_link_free").qposadr[0] :][:7]
        np.testing.assert_allclose(data.qpos, model.qpos0, atol=1e-6)


def cambered(folder):
    """A rover of two leaning wheels, with a ball behind them."""
    file = rovers.caster_urdf(folder, caster_m=0.0, chassis_m=0.15)
    for lean, y in ((0.2, 0.3), (-0.2, -0.3)):
        leaning = file.read_text().replace(f'xyz="0.3 {y}', f'rpy="{lean} 0 0" xyz="0.3 {y}')
        file.write_text(leaning)
    return rovers.read(file)


@pytest.mark.parametrize("other", [None, cambered])
@pytest.mark.parametrize("heading", [0.0, 1.1, 2.5])
def test_no_wheel_reaches_into_steep_and_bumpy_ground(world, tmp_path, heading, other):
    """Tall bumps touch a wheel before and behind its lowest point."""
    world = world.replace(rover=other(tmp_path)) if other else world
    ground = world.ground
    bumps = 0.02 * np.sin(ground.east / 0.05)[None, :] * np.cos(ground.north / 0.07)[:, None]
    z = (0.6 * ground.east[None, :] + bumps).astype(np.float32)
    path = world.trajectories[0]
    rise, across = 0.6 * np.cos(heading), -0.6 * np.sin(heading)
    roll = np.arctan(across / np.hypot(1.0, rise))
    rpy = np.tile((roll, -np.arctan(rise), heading), (len(path.time), 1))
    place = np.column_stack([np.zeros((len(path.time), 2)), np.zeros(len(path.time))])
    steep = world.replace(
        ground=ground.replace(elevation=z),
        field=world.field.select(np.zeros(len(world.field), bool)),
        neighbours=world.neighbours.select(np.zeros(len(world.neighbours), bool)),
        trajectories=(path.replace(position=place, rpy=rpy),),
        horizon=None,
    )
    export(steep, tmp_path)
    model, data = load(tmp_path, "scene.xml")
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    assert data.contact.dist.min(initial=0.0) > -1e-3
    assert data.joint("base_link_free").qpos[2] < 0.3


def test_cameras_look_along_their_sensors_x(world, exported):
    _, data = load(exported, "scene.xml")
    body = data.body("base_link")
    for sensor in world.rover.sensors:
        if sensor.kind == "camera":
            axes = data.cam(sensor.name).xmat.reshape(3, 3)
            local = matrix_from_quaternion(quaternion_from_rpy(sensor.rpy))
            wanted = body.xmat.reshape(3, 3) @ local
            np.testing.assert_allclose(-axes[:, 2], wanted[:, 0], atol=1e-7)
            np.testing.assert_allclose(axes[:, 1], wanted[:, 2], atol=1e-7)


def test_the_texture_lies_the_right_way(world, tmp_path):
    """MuJoCo's renderer lays a texture over a height field from its middle, `texrepeat` times."""
    marked = speckled(world)
    directory = export(marked, tmp_path, texture_pixels=PIXELS)
    model, _ = load(directory)
    material = model.material("ground")
    texture = model.texture(material.texid[mujoco.mjtTextureRole.mjTEXROLE_RGB])
    assert (texture.width[0], texture.height[0]) == (97 * FINER, 65 * FINER)
    east, north = np.meshgrid(marked.ground.east, marked.ground.north)
    places = np.stack([east.ravel(), north.ravel()], axis=-1)
    size = model.hfield("ground").size[:2]
    u, v = (0.5 + 0.5 * (places - model.geom("ground").pos[:2]) / size * material.texrepeat).T
    with Image.open(directory / "assets/ground.png") as image:
        pixels = np.asarray(image)
    assert shows_its_nodes(pixels, u, v, marked, places)
    first = u * texture.width[0]
    assert first[0] == pytest.approx(0.5 * FINER)
    assert first[96] == pytest.approx(96.5 * FINER)


def test_the_sun_shines_from_where_it_stands(world, exported):
    model, _ = load(exported)
    np.testing.assert_allclose(model.light("sun").dir, -world.lighting.towards_sun, atol=1e-7)


@pytest.mark.parametrize("name", ['Gale\'s "crater" <1> & Töne', "bell\x07 and \ufffe end"])
def test_any_name_makes_readable_xml(world, tmp_path, name):
    named = world.replace(site=world.site.replace(name=name))
    model, _ = load(export(named, tmp_path), "scene.xml")
    assert model.nu == 6


def test_a_world_without_paths_puts_the_rover_in_the_middle(world, tmp_path):
    level = flat(world, -2.0)
    _, data = load(export(level, tmp_path), "scene.xml")
    np.testing.assert_allclose(data.body("base_link").xpos, (0, 0, -1.998), atol=1e-6)


def test_a_world_without_a_rover_has_a_scene_too(world, tmp_path):
    model, _ = load(export(world.replace(rover=worlds.no_rover()), tmp_path), "scene.xml")
    assert model.nu == 0


@pytest.mark.skipif(
    not hasattr(mujoco.mjtEnableBit, "mjENBL_SLEEP"), reason="this MuJoCo knows no sleep"
)
def test_sleep_is_set_only_on_demand(world, exported, tmp_path):
    asleep, _ = load(export(world, tmp_path, sleep=True))
    awake, _ = load(exported)
    flag = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    assert asleep.opt.enableflags & flag
    assert not awake.opt.enableflags & flag


def test_a_steep_ground_keeps_its_heights(world, tmp_path):
    random = np.random.default_rng(4)
    rough = Heightfield(
        elevation=random.uniform(-300, 900, world.ground.shape), spacing=0.25, origin=(-12.0, -8.0)
    )
    cliffs = flat(world, 0.0).replace(ground=rough)
    assert largest_ground_error(cliffs, export(cliffs, tmp_path)) < 1e-6 * 1200


def test_dynamic_rocks_that_are_slower_than_real_time_are_told(world):
    """81 of them take 2.03 ms of a step of 2 ms."""
    losses = import_module("terrain_forge.exporters.mjcf.losses")
    field = world.field.select(np.zeros(81, np.int64))
    for count, step, sleep, told in ((81, 2, False, True), (81, 2, True, False),
                                     (80, 2, False, False), (41, 1, False, True)):  # fmt: skip
        dynamic = field.replace(id=np.arange(81), dynamic=np.arange(81) < count)
        options = Options(timestep_s=0.001 * step, sleep=sleep)
        found = " ".join(losses.list_losses(world.replace(field=dynamic), options))
        assert ("slower than real time" in found) == told
