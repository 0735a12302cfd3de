"""Rocks whose centre of mass lies outside them, as simulators find them."""

import numpy as np
import pytest
import trimesh

from terrain_forge.model import Export, Mesh, exporter
from terrain_forge.rocks.embedding.footprint import bounds
from terrain_forge.rocks.shapes.solid import mass_properties
from terrain_forge.validation.suite import quick_checks
from tests.helpers import worlds

BOXES = {
    "U": [((3, 1, 1), (0, 0, 0)), ((1, 1, 2), (-1, 0, 1.4)), ((1, 1, 2), (1, 0, 1.4))],
    "L": [((4, 1, 0.5), (0, 0, 0)), ((0.5, 1, 4), (-1.75, 0, 1.9))],
    "ring": [
        *(((4, 1, 1), (0, side, 0)) for side in (-1.5, 1.5)),
        *(((1, 3, 1), (side, 0, 0)) for side in (-1.5, 1.5)),
    ],
}


def bent(name):
    """A rock of boxes that overlap, each of them a collision part."""
    boxes = [trimesh.creation.box(e).apply_translation(m) for e, m in BOXES[name]]
    body = trimesh.boolean.union(boxes)
    centre, size = body.center_mass, body.extents.mean()
    assert not body.contains([centre])[0]
    hulls = tuple(Mesh(vertices=(b.vertices - centre) / size, faces=b.faces) for b in boxes)
    mesh = Mesh(vertices=(body.vertices - centre) / size, faces=body.faces)
    solid, (reach, rise) = mass_properties(mesh), bounds(mesh)
    return (
        worlds.library()
        .prototypes[0]
        .replace(
            meshes=(mesh,),
            hulls=hulls,
            uvs=(np.zeros((len(mesh.faces), 3, 2)),),
            volume=solid.volume,
            inertia=solid.inertia,
            reach=reach,
            rise=rise,
        )
    )


def checked(world, folder, moved=0.0):
    folder.mkdir()
    mjcf = exporter("mjcf")
    mjcf.export(world, folder, options=mjcf.Options(exact_scale=True))
    field = world.field.replace(position=world.field.position + np.array([0.0, 0.0, moved]))
    exports = [Export(folder="mjcf", kind="mjcf", options={"exact_scale": True})]
    checks = quick_checks(world.replace(field=field), folder.parent, exports, points=1)
    (check,) = [check for check in checks if check.name == "mjcf: rocks"]
    return check


@pytest.fixture(params=list(BOXES))
def world(request):
    plain = worlds.world()
    field = plain.field.select(np.arange(12)).replace(
        prototype=np.zeros(12), scale=np.full(12, 0.5)
    )
    return plain.replace(
        library=plain.library.replace(prototypes=(bent(request.param),)), field=field
    )


def test_rocks_with_their_centre_outside_are_where_they_should_be(world, tmp_path):
    check = checked(world, tmp_path / "mjcf")
    assert check.passed, check
    assert check.figure < 1e-3


def test_rocks_that_are_somewhere_else_are_noticed(world, tmp_path):
    """A twentieth of a rock too high: their tops are off by more than the limit."""
    check = checked(world, tmp_path / "mjcf", moved=-0.05)
    assert not check.passed
