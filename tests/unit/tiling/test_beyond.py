"""What lies beyond a site in tiles: that of the site as one world, joined to its tiles."""

from __future__ import annotations

import json
import shutil
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh

from terrain_forge.base import OutputError
from terrain_forge.tiling.beyond import site_horizon
from terrain_forge.tiling.order import load_order
from tests.unit.tiling.test_formats import usd_ground


@pytest.fixture(scope="module")
def horizon(built, whole):
    return horizon_of(built, whole)


def horizon_of(site, whole):
    heights = whole.ground.elevation
    low, high = float(heights.min()), float(heights.max())
    return site_horizon(load_order(site), whole, lowest=low, highest=high)


def usd_horizon(site):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(site / "usd/world.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Horizon/horizon/surface"))
    return np.array(mesh.GetPointsAttr().Get(), np.float64)


@pytest.mark.slow
def test_it_is_that_of_one_world(horizon, whole, built):
    """But for heights rounded as the tiles' are, and colours that go by the strips alone."""
    alone = whole.horizon
    assert np.array_equal(horizon.mesh.faces, alone.mesh.faces)
    step = load_order(built).grid.step(0.25)
    assert np.allclose(horizon.mesh.vertices, alone.mesh.vertices, rtol=0, atol=20 * step)
    border = 2 * (200 + 160)
    assert np.array_equal(horizon.rgb[:border], alone.rgb[:border])
    off = np.abs(horizon.rgb.astype(int) - alone.rgb)
    assert off.max() <= 25
    assert off.mean() < 4.0


def test_it_begins_at_the_tiles_own_nodes(built):
    ours = {tuple(point) for point in usd_horizon(built).tolist()}
    count = 0
    for row, column in np.ndindex(2, 3):
        points, _ = usd_ground(built, row, column, "full")
        edge = (np.abs(points[:, 0]) == 25.0) | (np.abs(points[:, 1]) == 20.0)
        count += np.count_nonzero(edge)
        assert all(tuple(point) in ours for point in points[edge].tolist())
    assert count > 2 * (200 + 160)


def test_the_domes_sky_goes_down_to_it(built):
    text = (built / "usd/assets/sky.hdr").read_bytes()
    rows = np.frombuffer(text[-4 * 512 * 256 :], np.uint8).reshape(256, 512, 4)
    ground = (rows == rows[-1, -1]).all(axis=(1, 2))
    assert not ground[:129].any()
    assert ground[131:].all()


def test_a_damaged_strip_is_told(built, whole, tmp_path):
    site = tmp_path / "six"
    shutil.copytree(built, site)
    strips = site / "tiles/000/001/border.npz"
    strips.write_bytes(strips.read_bytes()[:-400])
    with pytest.raises(OutputError, match=r"000/001/border.npz is damaged .*move .*000/001 away"):
        horizon_of(site, whole)


def test_all_formats_that_show_it_have_it(built, horizon):
    count = len(horizon.mesh.vertices)
    scene = trimesh.load(built / "glb/horizon.glb", process=False)
    found = scene.geometry["horizon"].vertices
    assert len(found) == count
    east, up, _ = scene.bounds[1]  # y is up in glTF
    assert (east, up) == pytest.approx(horizon.mesh.vertices.max(axis=0)[[0, 2]], abs=1e-3)
    assert "horizon" not in (built / "glb/tileset.json").read_text()
    world = ET.parse(built / "sdf/world.sdf").getroot()
    assert "model://sdf/horizon" in [node.text for node in world.iterfind(".//include/uri")]
    model = ET.parse(built / "sdf/horizon/model.sdf").getroot()
    assert model.find(".//collision") is None
    (mesh,) = [node.text for node in model.iterfind(".//mesh/uri")]
    file = built / mesh.removeprefix("model://")
    assert len(trimesh.load(file, process=False).vertices) == count
    exports = json.loads((built / "manifest.json").read_text())["exports"]
    told = {name: " ".join(one["losses"]) for name, one in exports.items()}
    assert all("visual-only" in told[name] for name in ("usd", "glb", "sdf"))
    assert "horizon.glb" in told["glb"]
