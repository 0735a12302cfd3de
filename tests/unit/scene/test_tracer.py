"""Our own ray engine beside Embree, ray by ray, and chosen by a variable."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from terrain_forge.base import TerrainForgeError
from terrain_forge.scene import embree, engine, packets, tracer

RAYS = 8 * 2500
_CALL = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)


def grid(rng):
    """Rough ground of 20 × 30 m whose rows and columns are no whole number of blocks."""
    heights = 0.05 * np.cumsum(rng.normal(size=(203, 310)), axis=1)
    east, north = np.meshgrid(np.arange(310) * 0.1 - 15, np.arange(203)[::-1] * 0.1 - 10)
    return np.stack([east, north, heights], axis=-1).astype(np.float32)


def scene(make, *, copies, seed=0):
    """Ground, and copies of a ball and a box, which come back too, to be kept."""
    rng = np.random.default_rng(seed)
    whole, shapes = make(), []
    whole.add_grid(grid(rng))
    for mesh in (trimesh.creation.icosphere(3), trimesh.creation.box()):
        shape = make()
        shape.add_triangles(mesh.vertices, mesh.faces.astype(np.int32))
        shape.commit()
        shapes.append(shape)
    if copies:
        transforms = np.empty((copies, 3, 4), np.float32)
        turns = Rotation.random(copies, random_state=seed).as_matrix()
        transforms[:, :, :3] = turns * rng.uniform(0.1, 0.8, copies)[:, None, None]
        transforms[:, :, 3] = rng.uniform((-14, -9, -1), (14, 9, 1), (copies, 3))
        which = np.arange(copies, 0, -1) % 2
        whole.add_instances(shapes, which=which.astype(np.int32), transforms=transforms)
    plate = np.array([[15.9, -10, 0], [40, -10, 1], [40, 10, 0], [15.9, 10, -1]])
    whole.add_triangles(plate, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    whole.commit()
    return whole, shapes


def traced(function, handle, origins, directions, *, far):
    """Packets after a query, shape [words, rays]."""
    memory = packets.packet_memory(RAYS // packets.LANES)
    word = memory.view(np.uint32)
    for axis in range(3):
        memory[:, packets.ORIGIN_X + axis] = origins[:, axis].reshape(-1, packets.LANES)
        memory[:, packets.DIRECTION_X + axis] = directions[:, axis].reshape(-1, packets.LANES)
    memory[:, packets.FAR] = far
    for row in (packets.MASK, packets.GEOMETRY, packets.INSTANCE, packets.COPY, packets.ACTIVE):
        word[:, row] = packets.NOTHING
    word[0, packets.ACTIVE, :3] = 0  # lanes that are to be left alone
    for packet in memory:
        address = packet.ctypes.data
        active = address + 4 * packets.ACTIVE * packets.LANES
        function(active, handle, address, embree.INCOHERENT)
    return memory.transpose(1, 0, 2).reshape(packets.ROWS, -1)


@pytest.fixture(scope="module")
def engines():
    """Both engines' calls by name: how a scene is made, first hit, anything hit."""
    library = embree.load_library()
    theirs = [
        _CALL(ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
        for name in ("rtcIntersect8", "rtcOccluded8")
    ]
    ours = [_CALL(callback.address) for callback in tracer.compiled()]
    return (embree.EmbreeScene, *theirs), (tracer.TracerScene, *ours)


@pytest.mark.slow
@pytest.mark.parametrize("copies", [0, 1, 700])
def test_rays_meet_what_they_meet_in_embree(engines, copies):
    rng = np.random.default_rng(copies)
    origins = rng.uniform((-16, -11, -1), (16, 11, 6), (RAYS, 3)).astype(np.float32)
    directions = rng.normal(size=(RAYS, 3))
    directions[:800, 0], directions[400:1200, 1] = 0.0, 0.0  # along axes too
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = []
    for make, first, _ in engines:
        whole, _shapes = scene(make, copies=copies)
        found.append(traced(first, whole.handle, origins, directions, far=np.inf))
    (theirs, ours), names = found, [f.view(np.uint32) for f in found]
    for row in (packets.GEOMETRY, packets.INSTANCE):  # their numbers are Embree's own
        assert np.array_equal(*(name[row] == packets.NOTHING for name in names))
    ground, beyond = (
        [
            (name[packets.INSTANCE] == packets.NOTHING) & test(name[packets.GEOMETRY])
            for name in names
        ]
        for test in (lambda n: n == 0, lambda n: (n != 0) & (n != packets.NOTHING))
    )
    assert np.array_equal(*beyond)
    assert np.array_equal(*ground)
    assert beyond[0].any()
    hit = names[0][packets.GEOMETRY] != packets.NOTHING
    assert 0.1 < hit.mean() < 0.9
    assert not hit[:3].any()
    for row in (packets.COPY, packets.TRIANGLE):
        assert np.mean(names[0][row, hit] != names[1][row, hit]) < 1e-3  # edges shared by two
    same = hit & (names[0][packets.TRIANGLE] == names[1][packets.TRIANGLE])
    assert np.allclose(ours[packets.FAR, same], theirs[packets.FAR, same], atol=1e-4)
    normals = [f[packets.NORMAL_X : packets.NORMAL_Z + 1, same] for f in found]
    units = [normal / np.linalg.norm(normal, axis=0) for normal in normals]
    assert np.quantile(np.linalg.norm(units[0] - units[1], axis=0), 0.999) < 1e-3
    on_copy = same & (names[0][packets.INSTANCE] != packets.NOTHING)
    for row in (packets.U, packets.V):
        assert np.allclose(ours[row, on_copy], theirs[row, on_copy], atol=5e-3)


@pytest.mark.slow
def test_what_lies_farther_does_not_shade(engines):
    rng = np.random.default_rng(3)
    origins = rng.uniform((-14, -9, 1), (14, 9, 4), (RAYS, 3)).astype(np.float32)
    directions = rng.normal(size=(RAYS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    dark = []
    for make, _, anything in engines:
        whole, _shapes = scene(make, copies=300)
        packet = traced(anything, whole.handle, origins, directions, far=2.5)
        dark.append(np.isneginf(packet[packets.FAR]))
    assert 0.05 < dark[0].mean() < 0.6
    assert np.mean(dark[0] != dark[1]) < 1e-3


@pytest.mark.parametrize("make", [embree.EmbreeScene, tracer.TracerScene])
def test_what_is_released_is_reached_no_more(make):
    (shape, *_), place = scene(make, copies=0)[1], np.eye(3, 4, dtype=np.float32)[None]
    whole = make()
    whole.add_instances([shape], which=np.zeros(1, np.int32), transforms=place)
    whole.commit()
    assert whole.handle
    for one in (shape, whole):
        one.release()
        one.release()
        with pytest.raises(TerrainForgeError, match="closed"):
            _ = one.handle
    with pytest.raises(TerrainForgeError, match="closed"):
        make().add_instances([shape], which=np.zeros(1, np.int32), transforms=place)


def test_the_engine_is_named(monkeypatch):
    monkeypatch.setenv(engine.VARIABLE, "own")
    assert engine.engine_name() == "own"
    monkeypatch.setenv(engine.VARIABLE, "optix")
    with pytest.raises(TerrainForgeError, match=r"TERRAIN_FORGE_RAYS: .*'optix', allowed: embree"):
        engine.engine_name()
    monkeypatch.delenv(engine.VARIABLE)
    for machine, name in (("x86_64", "embree"), ("AMD64", "embree"), ("aarch64", "own")):
        monkeypatch.setattr(engine.sys, "platform", "linux")
        monkeypatch.setattr(engine.platform, "machine", lambda machine=machine: machine)
        assert engine.engine_name() == name
