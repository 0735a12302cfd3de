"""Ground of several materials has the friction of each where it lies: MJCF, SDF, Drake, USD."""

from __future__ import annotations

import importlib
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from pxr import Usd

from terrain_forge.model import exporter
from terrain_forge.validation import read_mesh
from tests.helpers import worlds
from tests.helpers.usd_stages import findings, frictions, world_mesh

_FRICTIONS = 0.66, 0.8, 0.5
_DRAKE = "{http://drake.mit.edu}"
_MU = {
    "sdf": "surface/friction/ode/mu",
    "drake": f"{_DRAKE}proximity_properties/{_DRAKE}mu_dynamic",
}


@pytest.fixture(scope="module")
def world():
    small = worlds.world(rocks=4)
    rows, columns = small.ground.shape
    east, north = np.meshgrid(np.arange(columns), np.arange(rows))
    material = (2 * ((east - 20) ** 2 + (north - 30) ** 2 < 90)).astype(np.uint8)
    material[:, columns // 2 :] = 1
    material[7, 5] = 1  # a single cell
    return worlds.of_materials(small, material, _FRICTIONS)


def collisions(kind, folder):
    """Friction and mesh of each collision of the ground."""
    files = folder.rglob("model.sdf" if kind == "sdf" else "world.sdf")
    for file in sorted(files):
        for collision in ET.parse(file).getroot().iter("collision"):
            if collision.get("name").startswith("ground"):
                uri = collision.findtext("geometry/mesh/uri")
                place = folder / "models" / uri[8:] if kind == "sdf" else folder / uri
                yield float(collision.findtext(_MU[kind])), read_mesh(place)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("sdf", {}),
        ("sdf", {"flavour": "classic"}),
        ("sdf", {"tile_cells": 24}),
        ("drake", {}),
        ("drake", {"tile_cells": 24}),
    ],
)
def test_each_cell_has_its_materials_friction(world, tmp_path, kind, options):
    made = exporter(kind)
    report = made.export(world, tmp_path, options=made.Options(**options))
    ground = world.ground
    wanted = np.array(_FRICTIONS)[world.appearance.material[:-1, :-1]]
    found = np.zeros((*wanted.shape, 2))
    seen = np.zeros(wanted.shape, int)
    for friction, mesh in collisions(kind, tmp_path):
        corners = mesh.vertices[mesh.faces]
        middle = corners.mean(axis=1)
        column, row = np.floor((middle[:, :2] - ground.origin) / ground.spacing).astype(int).T
        np.add.at(seen, (row, column), 1)
        assert len(np.unique(mesh.faces)) == len(mesh.vertices)
        assert mesh.vertices[:, 2] == pytest.approx(
            ground.height_at(mesh.vertices[:, 0], mesh.vertices[:, 1]), abs=2e-5
        )
        up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
        assert (up > 0.0).all()
        found[row, column, 0] = friction
    assert (seen == 2).all()
    soil = world.appearance.material[:-1, :-1] == 0
    assert found[~soil, 0] == pytest.approx(wanted[~soil])
    assert len(np.unique(found[soil, 0])) == 1
    assert not any("one friction" in loss for loss in report.losses)


def touched_fields(folder):
    """Friction, south-western node and heights [m] of each height field that is touched."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(folder / "world.xml"))
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD):
        if model.geom_conaffinity[geom]:
            field = model.geom_dataid[geom]
            rows, columns = model.hfield_nrow[field], model.hfield_ncol[field]
            half, place = model.hfield_size[field], model.geom_pos[geom]
            begin = model.hfield_adr[field]
            samples = model.hfield_data[begin : begin + rows * columns].reshape(rows, columns)
            yield model.geom_friction[geom, 0], place[:2] - half[:2], place[2] + half[2] * samples


def test_scattered_cells_have_their_friction_in_mujoco_and_no_other_is_touched(world, tmp_path):
    """Both triangles of a cell are as high as the ground in fields of its friction alone."""
    ground = world.ground
    material = np.random.default_rng(1).integers(0, 3, ground.shape)
    material[:, 50:] = 0
    scattered = worlds.of_materials(world, material, _FRICTIONS)
    exporter("mjcf").export(scattered, tmp_path, options=exporter("mjcf").Options())
    wanted = np.array(_FRICTIONS)[material[:-1, :-1]]
    found = np.zeros((2, *wanted.shape), bool)
    for friction, corner, heights in touched_fields(tmp_path):
        column, row = np.rint((corner - ground.origin) / ground.spacing).astype(int)
        rows, columns = heights.shape
        nodes = ground.elevation[row : row + rows, column : column + columns]
        high = np.abs(heights - nodes) < 1e-4
        assert (high | (heights < nodes - 0.0045)).all()
        both, cells = (
            high[:-1, :-1] & high[1:, 1:],
            np.s_[row : row + rows - 1, column : column + columns - 1],
        )
        for half, third in enumerate((high[:-1, 1:], high[1:, :-1])):
            assert wanted[cells][both & third] == pytest.approx(friction)
            found[half][cells] |= both & third
    assert found.all()


@pytest.mark.parametrize("kind", ["sdf", "drake"])
def test_one_friction_is_one_mesh(world, tmp_path, kind):
    made = exporter(kind)
    made.export(world, tmp_path, options=made.Options(friction=0.4))
    assert [friction for friction, _ in collisions(kind, tmp_path)] == [0.4]


def test_a_heightmap_has_one_and_says_so(world, tmp_path):
    options = importlib.import_module("terrain_forge.exporters.sdf").Options(ground="heightmap")
    report = exporter("sdf").export(world, tmp_path, options=options)
    assert any("The ground has one friction" in loss for loss in report.losses)


@pytest.mark.parametrize("options", [{}, {"tile_cells": 24}])
def test_physics_reads_one_friction_of_each_cell_in_usd(world, tmp_path, options):
    report = exporter("usd").export(world, tmp_path, options=exporter("usd").Options(**options))
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    assert findings(stage) == []
    ground, wanted = world.ground, np.array(_FRICTIONS)[world.appearance.material[:-1, :-1]]
    seen, found = np.zeros(wanted.shape, int), np.zeros(wanted.shape)
    for path, read in frictions(stage).items():
        if path.startswith("/World/Ground/"):
            vertices, faces = world_mesh(stage.GetPrimAtPath(path))
            assert ground.height_at(*vertices[:, :2].T) == pytest.approx(vertices[:, 2], abs=2e-5)
            middle = vertices[faces].mean(axis=1)[:, :2]
            column, row = np.floor((middle - ground.origin) / ground.spacing).astype(int).T
            np.add.at(seen, (row, column), 1)
            (found[row, column],) = read
    assert (seen == 2).all()
    assert found == pytest.approx(wanted)
    assert not any("one friction" in loss for loss in report.losses)
