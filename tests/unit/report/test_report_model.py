"""The model of the page's 3-D view: the world's ground, rocks, lines and rover, but lighter."""

import numpy as np
import pytest

from terrain_forge.base import xyzw
from terrain_forge.model import Heightfield, Link, Shape
from terrain_forge.report.lines import ground_lines
from terrain_forge.report.model.ground import coarsen, overlays
from terrain_forge.report.model.rocks import MOST, shown_rocks
from terrain_forge.report.model.rover import rover_nodes, unit_solid
from terrain_forge.report.model.scene import page_model
from terrain_forge.report.recorded.measures import WorldSweep
from terrain_forge.report.section import Built
from tests.helpers import worlds
from tests.helpers.plain_readers import glb_arrays

GREY = np.full((64, 96, 3), 128, np.uint8)


class Glb:
    """A GLB read by hand."""

    def __init__(self, data):
        self.json, self.arrays = glb_arrays(data)

    def children(self, name):
        group = next(node for node in self.json["nodes"] if node.get("name") == name)
        return [self.json["nodes"][child] for child in group.get("children", [])]

    def primitive(self, node):
        (primitive,) = self.json["meshes"][node["mesh"]]["primitives"]
        return primitive


def boxy_rover():
    """A body with a visible box and an unseen one, and a wheel on an arm."""
    rest = {"rpy": np.zeros(3), "rgb": (1.0, 0.5, 0.0)}
    body = Shape(kind="box", size=(1.0, 0.6, 0.3), position=np.array([0, 0, 0.4]), collides=True,
                 **rest)  # fmt: skip
    hidden = body.replace(visible=False)
    tyre = Shape(kind="cylinder", size=(0.15, 0.1), position=np.array([0.1, 0, 0]), collides=True,
                 **rest)  # fmt: skip
    common = {"mass": 1.0, "centre_of_mass": np.zeros(3), "inertia": np.eye(3),
              "axis": np.array([0.0, 1.0, 0.0])}  # fmt: skip
    base = Link(name="base_link", parent="", joint="free", origin=np.zeros(3),
                shapes=(body, hidden), **common)  # fmt: skip
    arm = Link(name="arm", parent="base_link", joint="passive", origin=np.array([0.2, 0.3, 0.1]),
               shapes=(), **common)  # fmt: skip
    wheel = Link(name="wheel", parent="arm", joint="motor", origin=np.array([0.0, 0.1, 0.05]),
                 shapes=(tyre,), **common)  # fmt: skip
    return worlds.no_rover().replace(links=(base, arm, wheel))


def model(world, tmp_path, **changes):
    given = {"picture": GREY, "overlays": overlays(world.ground),
             "lines": ground_lines(Built(world, tmp_path)), **changes}  # fmt: skip
    return Glb(page_model(world, **given))


@pytest.fixture(scope="module")
def world():
    return worlds.world(rover=boxy_rover())


@pytest.fixture(scope="module")
def glb(world, tmp_path_factory):
    return model(world, tmp_path_factory.mktemp("nothing"))


def test_the_ground_is_the_worlds(world, glb):
    (ground,) = glb.children("ground")
    attributes = glb.primitive(ground)["attributes"]
    vertices = glb.arrays[attributes["POSITION"]].reshape(*world.ground.shape, 3)
    np.testing.assert_allclose(vertices[..., 2], world.ground.elevation, atol=1e-6)
    np.testing.assert_allclose(vertices[0, :, 0], world.ground.east, atol=1e-5)
    np.testing.assert_allclose(vertices[:, 0, 1], world.ground.north, atol=1e-5)
    corners = glb.arrays[attributes["TEXCOORD_0"]].reshape(*world.ground.shape, 2)
    # South-west, north-east: v runs down from the picture's northern edge.
    np.testing.assert_array_equal(corners[0, 0], (0, 1))
    np.testing.assert_array_equal(corners[-1, -1], (1, 0))


def test_materials_stand_in_the_order_that_the_page_names_them(glb):
    names = [material.get("name") for material in glb.json["materials"]]
    assert names[:3] == ["Picture", "Slope", "Height"]
    (ground,) = glb.children("ground")
    assert glb.primitive(ground)["material"] == 0
    assert all(image["mimeType"] == "image/jpeg" for image in glb.json["images"])


def test_rocks_stand_where_they_are(world, glb):
    rows = []
    for node in glb.children("rocks"):
        places = node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
        names = ("TRANSLATION", "ROTATION", "SCALE")
        rows.append(np.hstack([glb.arrays[places[name]] for name in names]))
    found = np.concatenate(rows)
    field = world.field
    size = np.repeat(field.scale[:, None], 3, axis=1)
    wanted = np.hstack([field.position, xyzw(field.quaternion), size])
    order = [np.lexsort(table[:, :2].T) for table in (found, wanted)]
    np.testing.assert_allclose(found[order[0]], wanted[order[1]], atol=1e-5)


def test_lines_lie_on_the_ground(world, glb):
    (line,) = glb.children("lines")
    primitive = glb.primitive(line)
    points = glb.arrays[primitive["attributes"]["POSITION"]].astype(np.float64)
    assert (line["name"], line["extras"], primitive["mode"]) == ("path arc", {"driven": False}, 3)
    np.testing.assert_allclose(points[:, :2], world.trajectories[0].position[:, :2], atol=1e-5)
    above = points[:, 2] - world.ground.height_at(points[:, 0], points[:, 1])
    np.testing.assert_allclose(above, 0.12, atol=1e-5)


def test_the_rover_stands_at_its_start(world, glb):
    group = next(node for node in glb.json["nodes"] if node.get("name") == "rover")
    np.testing.assert_allclose(group["translation"], world.trajectories[0].position[0], atol=1e-6)
    body, wheel = glb.children("rover")
    np.testing.assert_allclose((body["translation"], body["scale"]), ((0, 0, 0.4), (1, 0.6, 0.3)))
    np.testing.assert_allclose(wheel["translation"], (0.3, 0.4, 0.15))
    np.testing.assert_allclose(wheel["scale"], (0.3, 0.3, 0.1))


def first_look(glb):
    """Where the view's camera begins and where it looks [m]."""
    group = next(node for node in glb.json["nodes"] if node.get("name") == "rover")
    return np.array(group["extras"]["eye"]), np.array(group["extras"]["target"])


def test_the_view_begins_behind_the_start_and_above_what_is_there(world, glb, tmp_path):
    start, yaw = world.trajectories[0].position[0], world.trajectories[0].rpy[0, 2]
    eye, target = first_look(glb)
    behind = np.linalg.norm(eye[:2] - start[:2])
    assert 4.0 <= behind < 10.0
    np.testing.assert_allclose((eye - start)[:2], -behind * np.array([np.cos(yaw), np.sin(yaw)]))
    np.testing.assert_allclose((target + eye)[:2], 2.0 * start[:2])
    assert 0.4 * behind <= eye[2] - start[2] < behind
    # A rock in between lifts the camera over its top.
    rock = world.field.select(np.array([0]))
    between = [*(0.5 * (eye + start)[:2]), start[2] + 5.0]
    rock = rock.replace(position=np.array([between]))
    over, _ = first_look(model(world.replace(field=rock), tmp_path))
    assert over[2] == pytest.approx(between[2] + rock.diameter[0] + 0.4 * behind)


def test_a_mesh_of_a_rover_is_shown_as_it_is(world, tmp_path):
    shape = worlds.library().prototypes[0].meshes[0]
    rover = boxy_rover()
    part = rover.links[0].shapes[0].replace(kind="mesh", mesh=shape)
    links = (rover.links[0].replace(shapes=(part,)), *rover.links[1:])
    glb = model(world.replace(rover=rover.replace(links=links)), tmp_path)
    body, _ = glb.children("rover")
    vertices = glb.arrays[glb.primitive(body)["attributes"]["POSITION"]]
    np.testing.assert_allclose(vertices, shape.vertices, atol=1e-6)
    assert "scale" not in body


def test_too_fine_meshes_of_a_rover_are_shown_as_boxes(world, tmp_path, monkeypatch):
    """Of three meshes, the two that together stay within the limit are shown as they are."""
    rover = boxy_rover()
    meshes = sorted((p.meshes[0] for p in worlds.library().prototypes), key=lambda m: len(m.faces))
    box = rover.links[0].shapes[0].replace(kind="mesh")
    parts = tuple(box.replace(mesh=mesh) for mesh in meshes)
    links = (rover.links[0].replace(shapes=parts), *rover.links[1:])
    most = len(meshes[0].faces) + len(meshes[1].faces)
    monkeypatch.setattr("terrain_forge.report.model.rover.MOST_FACES", most)
    glb = model(world.replace(rover=rover.replace(links=links)), tmp_path)
    boxes = [node.get("scale") == [1.0, 0.6, 0.3] for node in glb.children("rover")[:3]]
    assert boxes == [False, False, True]


def test_solids_are_closed_and_of_the_right_size():
    sides, rings = 24, 12
    polygon = 0.5 * sides * 0.25 * np.sin(2 * np.pi / sides)
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings + 1)
    radius, z = 0.5 * np.cos(angle), 0.5 * np.sin(angle)
    frusta = np.diff(z) * (radius[1:] ** 2 + radius[1:] * radius[:-1] + radius[:-1] ** 2) / 3
    wanted = {"box": 1.0, "cylinder": polygon, "sphere": polygon / 0.25 * frusta.sum()}
    for kind, volume in wanted.items():
        vertices, normals, faces = unit_solid(kind)
        corners = vertices[faces]
        found = np.linalg.det(corners).sum() / 6  # by the divergence theorem, if outward
        assert found == pytest.approx(volume, rel=1e-12), kind
        assert np.ptp(vertices, axis=0) == pytest.approx((1.0, 1.0, 1.0))
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-12)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.all(np.einsum("fi,fi->f", across, normals[faces[:, 0]]) > -1e-12), kind


def plane(rows, columns, spacing):
    field = Heightfield(elevation=np.zeros((rows, columns)), spacing=spacing, origin=(-7.0, 3.0))
    tilted = 0.25 * field.east[None, :] - 0.5 * field.north[:, None]
    return field.replace(elevation=tilted)


@pytest.mark.parametrize(("rows", "columns"), [(700, 1000), (1281, 33), (3, 2)])
def test_a_coarser_ground_covers_the_same_area(rows, columns):
    ground = plane(rows, columns, 0.125)
    relief = coarsen(ground)
    assert max(relief.unit.shape) == min(257, max(rows, columns))
    west, south, east, north = ground.bounds
    nodes = relief.vertices()
    np.testing.assert_allclose(nodes.min(0)[:2], (west, south), atol=1e-5)
    np.testing.assert_allclose(nodes.max(0)[:2], (east, north), atol=1e-5)
    points = np.array([(west, south), (0.3 * west + 0.7 * east, 0.4 * south + 0.6 * north)])
    tilted = 0.25 * points[:, 0] - 0.5 * points[:, 1]
    np.testing.assert_allclose(relief.height_at(points), tilted, atol=1e-4)
    beyond = np.array([(west - 5.0, south - 5.0)])
    np.testing.assert_allclose(relief.height_at(beyond), tilted[:1], atol=1e-4)


def test_rocks_follow_the_coarser_ground(world, tmp_path, monkeypatch):
    """On 4 × 3 cells the bump is cut off; each rock keeps its height above what is shown."""
    relief = coarsen(world.ground, cells=4)
    monkeypatch.setattr("terrain_forge.report.model.scene.coarsen", lambda _: relief)
    glb = model(world, tmp_path)
    found = np.concatenate([
        glb.arrays[node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"]]
        for node in glb.children("rocks")
    ]).astype(np.float64)  # fmt: skip
    shown = found[:, 2] - relief.height_at(found[:, :2])
    own = world.field.position
    above = own[:, 2] - world.ground.height_at(own[:, 0], own[:, 1])
    np.testing.assert_allclose(np.sort(shown), np.sort(above), atol=1e-4)
    assert np.abs(np.sort(found[:, 2]) - np.sort(own[:, 2])).max() > 0.1


def test_the_largest_rocks_are_shown():
    field = worlds.field(MOST + 300)
    shown = shown_rocks(field)
    assert len(shown) == MOST
    assert shown.diameter.min() >= np.sort(field.diameter)[300]
    assert np.all(np.diff(shown.diameter) <= 0)


def test_overlays_of_a_plane():
    slope = np.tan(np.radians(30.0))
    ground = plane(40, 60, 0.5)
    tilted = ground.replace(elevation=np.broadcast_to(slope * ground.east, ground.shape))
    steep, height = overlays(tilted)
    assert (steep.name, steep.ends) == ("Slope", ("0°", "30° +"))
    # Steep everywhere alike; the heights' scale runs from west to east.
    assert np.ptp(steep.pixels.reshape(-1, 3).astype(int), axis=0).max() <= 1
    hue = steep.pixels[0, 0] / steep.pixels[0, 0].max()
    np.testing.assert_allclose(hue, np.array(steep.colours[-1]) / max(steep.colours[-1]), atol=0.02)
    low, high = (height.pixels[:, column].mean(0) for column in (0, -1))
    for found, wanted in ((low, height.colours[0]), (high, height.colours[-1])):
        np.testing.assert_allclose(found / found.max(), np.array(wanted) / max(wanted), atol=0.02)


def test_a_bare_world_has_a_model(tmp_path):
    bare = worlds.world(rocks=0).replace(trajectories=())
    glb = model(bare, tmp_path)
    assert [glb.children(name) for name in ("rocks", "lines", "rover")] == [[], [], []]
    assert "EXT_mesh_gpu_instancing" not in glb.json["extensionsUsed"]


def test_equal_worlds_make_equal_bytes(world, tmp_path):
    given = {"picture": GREY, "overlays": overlays(world.ground), "lines": []}
    assert page_model(world, **given) == page_model(worlds.world(rover=boxy_rover()), **given)


def test_rover_nodes_of_nobody():
    assert rover_nodes(worlds.no_rover(), None) == []


def test_a_sweep_lies_on_the_ground_that_is_shown(world, tmp_path):
    """On the world's own ground it would sink into the coarser one, or float."""
    west, south, east, north = world.ground.bounds
    spread = np.random.default_rng(3).uniform(0.0, 1.0, (50_000, 2))
    places = np.array([west, south]) + spread * [east - west, north - south]
    heights = world.ground.height_at(places[:, 0], places[:, 1]) + 0.5
    points, ring = np.column_stack([places, heights]), np.arange(len(places)) % 4
    sweep = WorldSweep(points=points, ring=ring, lidar=np.zeros(3), rings=4)
    glb = model(world, tmp_path, sweep=sweep)
    (node,) = glb.children("sweep")
    primitive = glb.primitive(node)
    assert primitive["mode"] == 0
    shown = glb.arrays[primitive["attributes"]["POSITION"]]
    assert len(shown) == 40_000
    above = shown[:, 2] - coarsen(world.ground).height_at(shown[:, :2].astype(float))
    np.testing.assert_allclose(above, 0.52, atol=1e-4)
    colours = glb.arrays[primitive["attributes"]["COLOR_0"]]
    assert len(np.unique(colours.round(4), axis=0)) == 4
    assert model(world, tmp_path).children("sweep") == []
