"""What lies beyond a world's edge as the formats have it: seen, stitched, touched by nothing."""

from __future__ import annotations

from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade

from terrain_forge.geometry import detail_placement, grid_texture_coordinates
from terrain_forge.model import exporter
from tests.helpers import worlds
from tests.helpers.ground_pictures import detailed
from tests.helpers.plain_readers import glb_parts

Z_UP = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)])


@pytest.fixture(scope="module")
def world():
    return worlds.with_horizon(worlds.world())


def written(world, kind, folder, **options):
    module = exporter(kind)
    return module.export(world, folder, options=module.Options(**options))


def of_glb(world, folder):
    written(world, "glb", folder)
    scene = trimesh.load(folder / "world.glb", force="scene", process=False)
    matrix, name = scene.graph["horizon"]
    return scene.geometry[name].vertices @ (Z_UP @ matrix[:3, :3]).T


def of_usd(world, folder):
    written(world, "usd", folder)
    stage = Usd.Stage.Open(str(folder / "world.usda"))
    (prim,) = [
        p for p in stage.Traverse() if "/Horizon/" in str(p.GetPath()) and p.IsA(UsdGeom.Mesh)
    ]
    assert not prim.HasAPI(UsdPhysics.CollisionAPI)
    return np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())


def of_mjcf(world, folder):
    written(world, "mjcf", folder)
    model = mujoco.MjModel.from_xml_path(str(folder / "world.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geom = model.geom("horizon").id
    assert not model.geom_contype[geom]
    assert not model.geom_conaffinity[geom]
    mesh = int(model.geom_dataid[geom])
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    turn = data.geom_xmat[geom].reshape(3, 3)
    return model.mesh_vert[first : first + count] @ turn.T + data.geom_xpos[geom]


def of_sdf(world, folder):
    written(world, "sdf", folder)
    included = {e.text for e in ElementTree.parse(folder / "world.sdf").iter("uri")}
    assert "model://by-hand_horizon" in included
    model = folder / "models/by-hand_horizon"
    root = ElementTree.parse(model / "model.sdf").getroot()
    assert root.find(".//visual") is not None
    assert root.find(".//collision") is None
    return trimesh.load(model / "meshes/horizon.obj", process=False).vertices


@pytest.mark.parametrize("read", [of_glb, of_usd, of_mjcf, of_sdf])
def test_it_begins_at_the_borders_own_nodes(world, read, tmp_path):
    ground = world.ground
    vertices = np.asarray(read(world, tmp_path), np.float64)
    west, south, east, north = ground.bounds
    eps = 1e-4
    inside = (vertices[:, 0] > west - eps) & (vertices[:, 0] < east + eps)
    inside &= (vertices[:, 1] > south - eps) & (vertices[:, 1] < north + eps)
    edge = vertices[inside]
    columns = np.rint((edge[:, 0] - west) / ground.spacing).astype(int)
    rows = np.rint((edge[:, 1] - south) / ground.spacing).astype(int)
    assert len(set(zip(rows, columns, strict=True))) == 2 * sum(ground.shape) - 4
    limit = 1e-3 if read is of_mjcf else 2e-6  # MuJoCo turns meshes into frames of their own
    assert np.abs(edge[:, 2] - ground.elevation[rows, columns]).max() < limit
    assert len(vertices) > len(edge)


@pytest.mark.parametrize("kind", ["glb", "usd", "mjcf", "sdf"])
def test_it_is_left_out_on_demand_and_said(world, kind, tmp_path):
    report = written(world, kind, tmp_path, horizon=False)
    assert any("beyond the border is left out" in loss for loss in report.losses)
    assert not [path for path in report.files if "horizon" in str(path)]
    (tmp_path / "with").mkdir()
    told = written(world, kind, tmp_path / "with")
    assert any("visual-only" in loss for loss in told.losses)


def soil_of_usd(world, folder):
    """Texture coordinates of the land's soil at all vertices, and the file that shows it."""
    written(world, "usd", folder)
    stage = Usd.Stage.Open(str(folder / "assets/horizon.usdc"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/horizon/surface"))
    normals = UsdShade.Shader.Get(stage, "/horizon/Looks/horizon/normals")
    reader = UsdShade.Shader(normals.GetInput("st").GetConnectedSources()[0][0].source)
    name = reader.GetInput("varname").Get()
    assert (folder / "assets" / normals.GetInput("file").Get().path).is_file()
    return np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar(name).Get())


def soil_of_glb(world, folder):
    written(world, "glb", folder)
    said, arrays = glb_parts(folder / "world.glb")
    looks = {
        look["name"]: look["normalTexture"]
        for look in said["materials"]
        if "horizon" in look["name"] or "ground" in look["name"]
    }
    assert looks["horizon"]["texCoord"] == 1
    assert len({look["index"] for look in looks.values()}) == 1
    (mesh,) = [mesh for mesh in said["meshes"] if mesh["name"] == "horizon"]
    down = arrays[mesh["primitives"][0]["attributes"]["TEXCOORD_1"]]
    return down * (1, -1) + (0, 1)


@pytest.mark.parametrize("read", [soil_of_usd, soil_of_glb])
def test_soil_goes_on_over_the_border(world, read, tmp_path):
    world = detailed(world)
    detail = world.appearance.detail
    ground = world.ground
    (along, across), offset = detail_placement(ground, detail)
    rows, columns = ground.shape
    places = grid_texture_coordinates(rows, columns).reshape(rows, columns, 2)
    within = (places * (along, across) + offset)[0]  # the southern border, the first vertices
    beyond = read(world, tmp_path)
    apart = (beyond[:columns] - within + 0.5) % 1.0 - 0.5
    assert np.abs(apart).max() < 1e-4
    assert len(beyond) == len(world.horizon.mesh.vertices)
