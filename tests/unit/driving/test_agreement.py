"""What a build checks of exports and rocks before the rover drives."""

import numpy as np
import pytest

from terrain_forge.model import Export, Mesh, exporter
from terrain_forge.validation.sample import random_points
from terrain_forge.validation.suite import quick_checks
from terrain_forge.validation.surface_mesh import heights_on, read_mesh
from terrain_forge.writers import write_obj, write_stl
from tests.helpers import worlds


def test_heights_on_a_mesh_are_those_of_the_triangulated_ground():
    ground = worlds.ground()
    rows, columns = ground.shape
    east, north = np.meshgrid(ground.east, ground.north)
    vertices = np.column_stack([east.ravel(), north.ravel(), ground.elevation.ravel()])
    sw = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.vstack(
        [
            np.column_stack([sw, sw + 1, sw + columns + 1]),
            np.column_stack([sw, sw + columns + 1, sw + columns]),
        ]
    )
    points = np.random.default_rng(1).uniform((-12, -8), (12, 8), (300, 2))
    found = heights_on(Mesh(vertices=vertices, faces=faces), points)
    np.testing.assert_allclose(found, ground.height_at(*points.T), atol=1e-12)
    assert np.isnan(heights_on(Mesh(vertices=vertices, faces=faces), np.array([[13.0, 0.0]])))


def test_meshes_are_read_as_they_were_written(tmp_path):
    mesh = worlds.library().prototypes[0].hulls[0]
    obj, stl = tmp_path / "a.obj", tmp_path / "a.stl"
    write_obj(obj, vertices=mesh.vertices, faces=mesh.faces, normals=mesh.vertices)
    write_stl(stl, vertices=mesh.vertices, faces=mesh.faces)
    read = read_mesh(obj)
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    triangles = read_mesh(stl)
    np.testing.assert_allclose(
        triangles.vertices[triangles.faces], mesh.vertices[mesh.faces], atol=1e-6
    )


@pytest.mark.parametrize("kind", ["mjcf", "sdf"])
def test_agreement_finds_a_ground_that_is_off(hill, tmp_path, kind):
    module = exporter(kind)
    (tmp_path / kind).mkdir()
    module.export(hill, tmp_path / kind, options=module.Options())

    def checks(world):
        exports = [Export(folder=kind, kind=kind, options={})]
        return {check.name: check for check in quick_checks(world, tmp_path, exports, points=2000)}

    assert all(check.passed for check in checks(hill).values())
    lifted = hill.ground.replace(elevation=hill.ground.elevation + np.float32(0.002))
    off = checks(hill.replace(ground=lifted))[f"{kind}: ground"]
    assert not off.passed
    assert off.figure == pytest.approx(0.002, abs=1e-5)
    if kind == "mjcf":
        moved = hill.field.replace(position=hill.field.position + np.array([0, 0, 0.05]))
        assert not checks(hill.replace(field=moved))["mjcf: rocks"].passed


def test_random_points_cover_the_ground_evenly(hill):
    points = random_points(hill, 4000)
    west, south, east, north = hill.ground.bounds
    assert hill.ground.covers(*points.T).all()
    counts, *_ = np.histogram2d(*points.T, bins=4, range=[(west, east), (south, north)])
    chi_squared = ((counts - 250) ** 2 / 250).sum()
    assert chi_squared < 37.7  # 15 degrees of freedom, α = 0.001
