"""Large rocks near paths are drawn by their close meshes; nothing that is touched changes."""

from functools import cache, partial
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from pxr import Usd, UsdGeom
from terrain_forge.exporters.glb import Options as GlbOptions
from terrain_forge.exporters.glb import export as export_glb
from terrain_forge.exporters.sdf import Options as SdfOptions
from terrain_forge.exporters.sdf import export as export_sdf
from terrain_forge.exporters.usd import Options as UsdOptions
from terrain_forge.exporters.usd import export as export_usd

from terrain_forge.base import DataError
from terrain_forge.geometry import skin
from terrain_forge.model import CLOSE, Mesh
from terrain_forge.rocks import seen_close
from terrain_forge.scene import open_scene
from terrain_forge.scene.subject import subject_of
from tests.helpers.plain_readers import glb_parts


def subdivided(mesh):
    """Four faces for each, their new corners a little outwards."""
    ends = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    sides, index = np.unique(ends, axis=0, return_inverse=True)
    middles = 1.02 * mesh.vertices[sides].mean(axis=1)
    ab, bc, ca = (index.reshape(-1, 3) + len(mesh.vertices)).T
    a, b, c = mesh.faces.T
    faces = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    faces = np.concatenate([np.stack(corners, axis=-1) for corners in faces])
    return Mesh(vertices=np.concatenate([mesh.vertices, middles]), faces=faces.astype(np.int32))


@pytest.fixture(scope="module")
def world(small_world):
    """A world whose shapes, but the last, have close meshes."""
    *some, last = small_world.library.prototypes
    shapes = (*(shape.replace(close=subdivided(shape.meshes[0])) for shape in some), last)
    return small_world.replace(library=small_world.library.replace(prototypes=shapes))


def near(world, within):
    """Ids, by brute force over the samples of the paths, which are close together."""
    plan = np.concatenate([t.position[:, :2] for t in world.trajectories])
    away = np.linalg.norm(world.field.position[:, None, :2] - plan, axis=2).min(axis=1)
    has_one = world.field.prototype < len(world.library.prototypes) - 1
    wanted = has_one & (world.field.diameter >= 0.25)
    return set(world.field.id[wanted & (away - world.field.diameter / 2 <= within)].tolist())


def test_rocks_are_near_by_their_edge(world):
    found = seen_close(world, within=1.5)
    assert set(found.tolist()) == near(world, 1.5)
    assert 2 < len(found) < len(world.field)
    assert not len(seen_close(world, within=0.0))
    assert not len(seen_close(world.replace(trajectories=()), within=1.5))


def in_usd(folder):
    found, stage = set(), Usd.Stage.Open(str(folder / "world.usda"))
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.PointInstancer):
            some = UsdGeom.PointInstancer(prim)
            names = [target.name for target in some.GetPrototypesRel().GetTargets()]
            index = np.array(some.GetProtoIndicesAttr().Get())
            ids = np.array(some.GetIdsAttr().Get())
            found |= set(ids[[names[n].endswith("close") for n in index]].tolist())
    return found


def in_sdf(folder):
    (file,) = folder.glob("models/*_rocks/model.sdf")
    visuals = ET.parse(file).getroot().iter("visual")
    uris = {v.get("name"): v.findtext("geometry/mesh/uri") for v in visuals}
    close = {name: uri for name, uri in uris.items() if uri.endswith("_close.obj")}
    for uri in close.values():
        assert (file.parent.parent / uri.removeprefix("model://")).is_file()
    return {int(name.split("_")[1]) for name in close}


def in_glb(folder):
    text, _ = glb_parts(folder / "world.glb")
    return {
        int(node["name"].split("_")[1])
        for node in text["nodes"]
        if "mesh" in node and "_close_" in text["meshes"][node["mesh"]]["name"]
    }


FORMATS = {
    "usd": (export_usd, partial(UsdOptions, texture_pixels=32), in_usd, 0.0),
    "sdf": (export_sdf, SdfOptions, in_sdf, 0.5),
    "glb": (export_glb, partial(GlbOptions, texture_pixels=32), in_glb, 0.0),
}


@pytest.fixture(scope="module")
def exported(world, tmp_path_factory):
    """Folders of exports, each made once."""

    @cache
    def make(name, within):
        export, options, _, _ = FORMATS[name]
        folder = tmp_path_factory.mktemp(name)
        export(world, folder, options=options(close_within_m=within))
        return folder

    return make


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.slow
def test_exports_draw_them_close(world, exported, name):
    *_, found_in, least = FORMATS[name]
    single = set(world.field.id[world.field.diameter >= least].tolist())
    for within in (1.5, 0.0):
        folder = exported(name, within)
        assert found_in(folder) == near(world, within) & single if within else not found_in(folder)


@pytest.mark.slow
def test_the_library_holds_the_close_mesh(world, exported):
    stage = Usd.Stage.Open(str(exported("usd", 1.5) / "assets/rock_library.usdc"))
    for number in {*world.field.prototype[np.isin(world.field.id, [*near(world, 1.5)])].tolist()}:
        mesh, uvs = skin(world.library.prototypes[number], CLOSE)
        path = f"/rock_library/shape_{number:03}_close/shape"
        drawn = UsdGeom.Mesh(stage.GetPrimAtPath(path))
        np.testing.assert_allclose(drawn.GetPointsAttr().Get(), mesh.vertices, atol=1e-6)
        st = UsdGeom.PrimvarsAPI(drawn).GetPrimvar("st").Get()
        np.testing.assert_allclose(st, uvs.reshape(-1, 2), atol=1e-6)
    with pytest.raises(DataError, match="no close mesh"):
        world.library.prototypes[-1].drawn(CLOSE)


def test_what_is_touched_stays(world, small_world, tmp_path):
    files = []
    for number, one in enumerate((world, small_world)):
        (tmp_path / str(number)).mkdir()
        export_sdf(one, tmp_path / str(number), options=SdfOptions(close_within_m=1.5))
        (file,) = (tmp_path / str(number)).glob("models/*_rocks/model.sdf")
        root = ET.parse(file).getroot()
        files.append([ET.tostring(collision) for collision in root.iter("collision")])
    assert files[0] == files[1]


def test_rays_meet_the_close_mesh_only_where_asked(world):
    """From straight above, at a corner of it that no face of the shape has."""
    rocks = world.field
    high = (rocks.diameter >= 0.5) & (rocks.prototype < len(world.library.prototypes) - 1)
    row = int(np.flatnonzero(high)[0])
    assert len(subject_of(world, close=True).instances.meshes) > len(world.library.prototypes)
    towards = np.array([0.0, 0.0, -1.0])
    start = rocks.position[row] + [0.02, 0.01, 5.0]
    tops = []
    for close in (False, True):
        with open_scene(world, close=close) as scene:
            hits = scene.cast(start, towards)
            assert hits.rock.tolist() == [row]
            tops.append(float(hits.distance[0]))
    assert 0.0 < tops[0] - tops[1] < 0.03 * rocks.diameter[row]
