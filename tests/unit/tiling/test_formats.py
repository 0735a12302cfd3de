"""USD, 3D Tiles and SDF of a site in tiles, read back with their neighbours."""

from __future__ import annotations

import csv
import json
import os
import shutil
import struct
import xml.etree.ElementTree as ET
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation
from terrain_forge.exporters.glb import Options as GlbOptions
from terrain_forge.exporters.sdf import Options as SdfOptions

import terrain_forge as tf
from terrain_forge.base import DataError
from terrain_forge.model import path_points
from terrain_forge.rocks import path_pebbles, rocks_near_paths, seen_close
from terrain_forge.truth.tables import write_rocks
from terrain_forge.truth.tiled import write_parquet
from tests.helpers.node import run_node
from tests.helpers.plain_readers import glb_parts
from tests.unit.exporters.test_glb import gltf_issues
from tests.unit.tiling.conftest import write_recipe

INSTANCING = "EXT_mesh_gpu_instancing"
LEVELS = ("full", "quarter", "sixteenth")


def usd_ground(site: Path, row: int, column: int, level: str):
    """Points of a tile's ground in the world, and its normals, as USD composes them."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(site / "usd/world.usda"))
    prim = stage.GetPrimAtPath(f"/World/Tiles/tile_{row:03}_{column:03}")
    assert prim.GetVariantSets().GetVariantSelection("lod") == "sixteenth"
    prim.GetVariantSets().SetSelection("lod", level)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"{prim.GetPath()}/ground/surface"))
    place = UsdGeom.XformCache().GetLocalToWorldTransform(mesh.GetPrim())
    points = np.array(mesh.GetPointsAttr().Get(), np.float64) + np.array(place.ExtractTranslation())
    return points, np.array(mesh.GetNormalsAttr().Get())


def test_coarse_usd_tiles_shade_smoothly_within(built):
    spread = {}
    for level in ("full", "sixteenth"):
        points, normals = usd_ground(built, 0, 0, level)
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        inside = ((points[:, :2] > low + 0.01) & (points[:, :2] < high - 0.01)).all(axis=1)
        spread[level] = normals[inside, :2].std(axis=0)
    assert np.all(spread["sixteenth"] < 0.7 * spread["full"])


@pytest.mark.parametrize(("one", "other"), list(product(LEVELS, LEVELS)))
def test_usd_tiles_meet_at_any_levels(built, one, other):
    """Points and normals along a border are the same numbers from both sides."""
    for axis, near, far, edge in ((0, (0, 0), (0, 1), -5.0), (1, (0, 0), (1, 0), 0.0)):
        sides = []
        for place, level in ((near, one), (far, other)):
            points, normals = usd_ground(built, *place, level)
            here = points[:, axis] == edge
            order = np.argsort(points[here, 1 - axis])
            sides.append((points[here][order], normals[here][order]))
        assert len(sides[0][0]) == 81
        assert np.array_equal(sides[0][0], sides[1][0])
        assert np.array_equal(sides[0][1], sides[1][1])


def test_a_small_tile_is_there_at_all_levels(tmp_path):
    """At the site's end a tile may have too few cells for a level: its coarsest stands for it.

    What lies beyond the site may be left out.
    """
    changes = {"size_m: [50, 40]": "size_m: [25.25, 5]", "k: 0.08": "k: 0.02"}
    changes |= {"seed: 7": "seed: 7\nhorizon: {reach_m: 0}"}
    recipe = write_recipe(tmp_path, exports="usd", **changes)
    tf.build(tf.load_recipe(recipe).recipe, tmp_path / "two", workers=0)
    assert not (tmp_path / "two/tiles/000/001/usd/ground_sixteenth.usdc").exists()
    assert not (tmp_path / "two/usd/assets/horizon.usdc").exists()
    assert "Horizon" not in (tmp_path / "two/usd/world.usda").read_text()
    for column, cells in ((0, 80), (1, 21)):
        finest, *_, coarsest = (
            len(usd_ground(tmp_path / "two", 0, column, level)[0]) for level in LEVELS
        )
        assert (cells + 1) * 21 == finest > coarsest


def test_usd_has_each_rock_once(built, whole):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(built / "usd/world.usda"))
    for prim in stage.GetPrimAtPath("/World/Tiles").GetChildren():
        prim.GetVariantSets().SetSelection("lod", "full")
    assert not stage.GetCompositionErrors()
    cache, found, places = UsdGeom.XformCache(), [], []
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.PointInstancer):
            rocks = UsdGeom.PointInstancer(prim)
            shift = np.array(cache.GetLocalToWorldTransform(prim).ExtractTranslation())
            found += list(rocks.GetIdsAttr().Get())
            places += (np.array(rocks.GetPositionsAttr().Get(), np.float64) + shift).tolist()
    order = np.argsort(found)
    assert np.array_equal(np.array(found)[order], whole.field.id)
    assert np.allclose(np.array(places)[order], whole.field.position, atol=2e-6)


def contents(site: Path):
    """Each content of the tileset: its address, its transform, its node and those inside it."""
    tileset = json.loads((site / "glb/tileset.json").read_text())
    assert tileset["asset"]["version"] == "1.1"

    def walk(node, shift, above, around):
        assert node["geometricError"] <= above
        if "transform" in node:
            shift = shift + np.array(node["transform"])[12:15]
        box = np.array(node["boundingVolume"]["box"])
        half = np.diag(box[3:].reshape(3, 3))
        low, high = box[:3] + shift - half, box[:3] + shift + half
        assert (low >= around[0] - 1e-9).all()
        assert (high <= around[1] + 1e-9).all()
        if "content" in node:
            yield node, shift
        for child in node.get("children", ()):
            yield from walk(child, shift, node["geometricError"], (low, high))

    far = -np.inf, np.inf
    return list(walk(tileset["root"], np.zeros(3), tileset["geometricError"], far))


def test_3d_tiles_hold_what_they_say(built, whole):
    """Boxes hold their vertices; errors are those of the heights; borders are common."""
    found, rims = contents(built), {}
    assert len(found) == 6 * 3
    for node, shift in found:
        told, arrays = glb_parts(built / "glb" / node["content"]["uri"])
        (x, y, z, w) = told["nodes"][0]["rotation"]
        assert np.allclose((x, y, z, w), (-(0.5**0.5), 0, 0, 0.5**0.5))  # z up to y up
        box = np.array(node["boundingVolume"]["box"])
        for mesh in told["meshes"]:
            vertices = arrays[mesh["primitives"][0]["attributes"]["POSITION"]]
            off = np.abs(vertices - box[:3]) - np.diag(box[3:].reshape(3, 3))
            assert off.max() <= 1e-5
        points = arrays[told["meshes"][0]["primitives"][0]["attributes"]["POSITION"]] + shift
        heights = whole.ground.height_at(points[:, 0], points[:, 1])
        assert np.abs(points[:, 2] - heights).max() < 1e-4
        edges = (points[:, 0] == -5.0) | (points[:, 0] == 15.0) | (points[:, 1] == 0.0)
        for x, y, z in points[edges].tolist():
            assert rims.setdefault((x, y), z) == z
        faces = arrays[told["meshes"][0]["primitives"][0]["indices"]].reshape(-1, 3)
        middle = points[faces].mean(axis=1)
        ground = whole.ground.height_at(middle[:, 0], middle[:, 1])
        assert np.abs(middle[:, 2] - ground).max() <= node["geometricError"]


@pytest.mark.consumer
def test_khronos_validator_finds_nothing_in_tiles(built):
    for path in sorted(built.glob("tiles/*/*/glb/*.glb")):
        issues = gltf_issues(path)
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


WALK = """
const fs = require("fs"), path = require("path");
const {BoundingVolumesContainment, ResourceResolvers, TilesetTraverser, VertexProcessing} =
  require("3d-tiles-tools");
const [, file] = process.argv, folder = path.dirname(file);
const resolver = ResourceResolvers.createFileResourceResolver(folder);
const still = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], issues = new Set(), contents = [];
const moved = (m, p) => [0, 1, 2].map(
  (axis) => m[axis] * p[0] + m[4 + axis] * p[1] + m[8 + axis] * p[2] + m[12 + axis]);
async function visit(one) {
  const chain = [];  // the tile and all around it
  for (let at = one; at; at = at.getParent()) chain.push(at.asFinalTile());
  const [tile, parent] = chain;
  if (parent && tile.geometricError > parent.geometricError) issues.add(`${one.path}: error`);
  for (const {uri} of one.getFinalContents()) {
    const data = await resolver.resolveData(uri);
    if (!data) issues.add(`${uri}: missing`);
    if (!data || uri.endsWith(".json")) continue;
    let vertices = 0;
    await VertexProcessing.fromContent(uri, data, async () => undefined, true, (vertex) => {
      vertices++;
      let point = [...vertex];
      for (const tile of chain) {
        if (!BoundingVolumesContainment.contains(tile.boundingVolume, point, 1e-5))
          issues.add(`${uri}: outside of its tile, or of one around that`);
        point = moved(tile.transform || still, point);
      }
    });
    contents.push({uri, vertices});
  }
  return true;
}
const traverser = new TilesetTraverser(folder, resolver, {traverseExternalTilesets: true});
traverser.traverse(JSON.parse(fs.readFileSync(file)), visit)
  .then(() => console.log(JSON.stringify({contents, issues: [...issues]})));
"""


@pytest.mark.consumer
def test_cesium_finds_each_vertex_in_its_boxes(built):
    """Cesium's reader of tilesets; `npm install --ignore-scripts 3d-tiles-tools`."""
    told = run_node("3d-tiles-tools", WALK, built / "glb/tileset.json")
    assert told["issues"] == []
    assert len({content["uri"] for content in told["contents"]}) == 6 * 3
    assert min(content["vertices"] for content in told["contents"]) > 50


def test_sdf_world_has_a_level_for_each_tile(built):
    world = ET.parse(built / "sdf/world.sdf").getroot().find("world")
    included = {one.find("name").text: one for one in world.iter("include")}
    levels = {one.find("ref").text: one for one in world.iter("level")}
    beyond = included.pop("six_horizon")  # always there
    assert beyond.find("pose").text.split() == ["0"] * 6
    assert sorted(included) == sorted(levels)
    assert len(included) == 6
    for name, one in included.items():
        folder = built / one.find("uri").text.removeprefix("model://")
        model = ET.parse(folder / "model.sdf").getroot().find("model")
        assert model.get("name") == name
        assert one.find("pose").text == levels[name].find("pose").text
        for uri in model.iter("uri"):
            assert (built / uri.text.removeprefix("model://")).is_file()


def test_sdf_grounds_meet(built):
    """Heights along a border are the same from both sides to what the text is rounded to."""
    sides = []
    world = ET.parse(built / "sdf/world.sdf").getroot().find("world")
    poses = {
        one.find("uri").text: np.array(one.find("pose").text.split()[:3], float)
        for one in world.iter("include")
    }
    for column in (0, 1):
        address = f"model://tiles/000/{column:03}/sdf"
        path = built / address.removeprefix("model://") / "meshes/ground.obj"
        lines = [line.split()[1:] for line in path.read_text().splitlines() if line[:2] == "v "]
        points = np.array(lines, float) + poses[address]
        border = points[np.abs(points[:, 0] + 5.0) < 1e-5]
        sides.append(border[np.argsort(border[:, 1])])
    assert sides[0].shape == (81, 3)
    assert np.allclose(*sides, rtol=0, atol=2e-6)


def test_rocks_as_geoparquet(whole, tmp_path):
    arrow = pytest.importorskip("pyarrow.parquet")
    write_parquet(whole, tmp_path / "rocks.parquet")
    table = arrow.read_table(tmp_path / "rocks.parquet")
    assert table["id"].to_pylist() == whole.field.id.tolist()
    geo = json.loads(table.schema.metadata[b"geo"])
    assert geo["columns"]["geometry"]["encoding"] == "WKB"
    east, north, _ = whole.field.position.T
    corners = [east.min(), north.min(), east.max(), north.max()]
    assert geo["columns"]["geometry"]["bbox"] == corners
    order, kind, x, y = struct.unpack("<BIdd", table["geometry"][7].as_py())
    assert (order, kind) == (1, 1)
    assert [x, y] == whole.field.position[7, :2].tolist()


def test_rocks_as_geoparquet_have_the_columns_and_values_of_the_table(whole, tmp_path):
    arrow = pytest.importorskip("pyarrow.parquet")
    named = whole.field.replace(populations=('large, "flat"',))
    world = whole.replace(field=named)
    write_parquet(world, tmp_path / "rocks.parquet")
    write_rocks(world, tmp_path / "rocks.csv")
    table = arrow.read_table(tmp_path / "rocks.parquet")
    with (tmp_path / "rocks.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert table.column_names == [*head, "geometry"]
    assert {"a_m", "lon_deg", "collision_parts"} <= {*head}
    for name, values in zip(head, zip(*rows, strict=True), strict=True):
        found = table[name].to_pylist()
        if name == "population":
            assert found == [*values]
        else:
            assert found == pytest.approx([float(value) for value in values], rel=1e-6, abs=1e-7)


def test_levels_of_both_formats_are_as_much_off_as_their_rocks_are(built):
    """Those from afar show the same ground and the same rocks, by the same meshes."""
    for path in sorted(built.glob("tiles/*/*/tile.json")):
        figures = json.loads(path.read_text())["figures"]
        usd, glb = (figures[kind]["errors"] for kind in ("usd", "glb"))
        assert usd["quarter"] == glb["quarter"]
        assert usd["full"] > 0.0


def test_losses_of_tiles_tell_what_they_leave_out(built):
    exports = json.loads((built / "manifest.json").read_text())["exports"]
    assert any("no map of fine normals" in line for line in exports["glb"]["losses"])
    assert not any("of paths" in line for kind in exports.values() for line in kind["losses"])


def test_a_pipe_in_place_of_a_tiles_picture_is_refused(recipe, built, tmp_path):
    """It was waited for without an end."""
    out = shutil.copytree(built, tmp_path / "six")
    picture = out / "tiles/000/001/map.png"
    picture.unlink()
    os.mkfifo(picture)
    with pytest.raises(DataError, match=r"is no regular file: .*map\.png"):
        tf.build(tf.load_recipe(recipe).recipe, out, workers=0)


NEAR = 0.6


@pytest.fixture(scope="module")
def near(tmp_path_factory):
    """A site with a path, pebbles and close views near it, and its world made as one."""
    folder = tmp_path_factory.mktemp("near")
    options = f"{{pebbles_min_m: 0.06, close_within_m: {NEAR}}}"
    exports = f"exports: {{usd: {options}, glb: {options}, sdf: {{close_within_m: {NEAR}}}}}"
    path = (
        "{name: p, speed_m_s: 0.5, route: {kind: spline, points_m: [[-20, -10], [0, 5], [20, 12]]}}"
    )
    text = {
        "exports: []": f"{exports}\npaths: [{path}]",
        "diameter_m: [0.25, 0.8]": "diameter_m: [0.18, 0.8]",
    }
    recipe = tf.load_recipe(write_recipe(folder, exports="", **text)).recipe
    tf.build(recipe, folder / "site", workers=0)
    return folder / "site", tf.realise(tf.plan(recipe))


@pytest.mark.slow
def test_ground_of_tiles_is_fine_near_paths(near):
    """Each face shows one look; those near the path, no others, one of 4 mm or somewhat coarser."""
    from pxr import Usd, UsdShade

    site, whole = near
    stage = Usd.Stage.Open(str(site / "usd/world.usda"))
    assert not stage.GetCompositionErrors()
    line, fine = KDTree(path_points(whole.trajectories)), 0
    for tile in stage.GetPrimAtPath("/World/Tiles").GetChildren():
        row, column = map(int, tile.GetName().split("_")[1:])
        tile.GetVariantSets().SetSelection("lod", "full")
        mesh = stage.GetPrimAtPath(f"{tile.GetPath()}/ground/surface")
        corners = np.array(mesh.GetAttribute("faceVertexIndices").Get()).reshape(-1, 3)
        points = np.array(mesh.GetAttribute("points").Get(), float)
        shift = np.array(tile.GetAttribute("xformOp:translate").Get())
        middles = (points[corners].mean(axis=1) + shift)[:, :2]
        close = np.zeros(len(corners), bool)
        shown = np.zeros(len(corners), int)
        for subset in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets():
            faces = np.array(subset.GetIndicesAttr().Get(), int)
            shown[faces] += 1
            look = UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()[0]
            if "close" in subset.GetPrim().GetName():
                close[faces] = True
                files = [
                    UsdShade.Shader(shader).GetInput("file").Get()
                    for shader in Usd.PrimRange(look.GetPrim())
                    if UsdShade.Shader(shader).GetInput("file")
                ]
                assert len(files) == 2
                assert all(Path(one.resolvedPath).is_file() for one in files)
        # Blender shows any look where a face has none of its own.
        assert np.isin(shown, [1] if close.any() else [0, 1]).all()
        away = line.query(middles)[0]
        assert close[away < NEAR - 0.4].all()
        assert not close[away > NEAR + 0.4].any()
        assert (site / f"usd/assets/close_{row:03}_{column:03}.usda").is_file() == close.any()
        fine += close.any()
        tile.GetVariantSets().SetSelection("lod", "sixteenth")
        far = stage.GetPrimAtPath(f"{tile.GetPath()}/ground/surface")
        assert not UsdShade.MaterialBindingAPI(far).GetMaterialBindSubsets()
    assert 2 < fine < 6
    losses = json.loads((site / "manifest.json").read_text())["exports"]["usd"]["losses"]
    assert any(f"Within {NEAR:g} m of paths" in line for line in losses)


@pytest.mark.slow
def test_rocks_of_tiles_near_paths_have_their_close_meshes(near):
    """The same as in the world of one piece, in USD and SDF; all others as before."""
    from pxr import Usd, UsdGeom

    site, whole = near
    wanted = set(seen_close(whole, within=NEAR).tolist())
    assert len(wanted) > 3
    stage = Usd.Stage.Open(str(site / "usd/world.usda"))
    for tile in stage.GetPrimAtPath("/World/Tiles").GetChildren():
        tile.GetVariantSets().SetSelection("lod", "full")
    found = {}
    for prim in Usd.PrimRange(stage.GetPrimAtPath("/World/Tiles")):
        if prim.IsA(UsdGeom.PointInstancer):
            rocks = UsdGeom.PointInstancer(prim)
            names = [target.name for target in rocks.GetPrototypesRel().GetTargets()]
            for rock, shape in zip(
                rocks.GetIdsAttr().Get(), rocks.GetProtoIndicesAttr().Get(), strict=True
            ):
                assert rock not in found
                found[rock] = "_close" in names[shape]
    assert sorted(found) == whole.field.id.tolist()
    assert {rock for rock, close in found.items() if close} == wanted
    single = whole.field.select(whole.field.diameter >= SdfOptions().individual_min_m)
    drawn = set()
    for include in ET.parse(site / "sdf/world.sdf").getroot().iter("include"):
        model = site / include.find("uri").text.removeprefix("model://") / "model.sdf"
        for visual in ET.parse(model).getroot().iter("visual"):
            file = visual.findtext("geometry/mesh/uri", "")
            if file:
                assert (site / file.removeprefix("model://")).is_file()
            if "close" in Path(file).name:
                drawn.add(int(visual.get("name").split("_")[1]))
    assert drawn == wanted & set(single.id.tolist())
    assert drawn


@pytest.mark.slow
def test_3d_tiles_show_the_ground_near_paths_in_their_finest_level(near):
    """In place of that made before the paths; each face in one piece, within the stated box."""
    site, _ = near
    boxes = {node["content"]["uri"]: node["boundingVolume"]["box"] for node, _ in contents(site)}
    near_paths = sorted(uri for uri in boxes if "close_" in uri)
    assert near_paths == sorted(path.name for path in site.glob("glb/close_*.glb"))
    assert len(near_paths) > 2
    for name in near_paths:
        path = site / "glb" / name
        told, arrays = glb_parts(path)
        ground = next(mesh for mesh in told["meshes"] if mesh["name"] == "ground")
        faces = np.concatenate(
            [arrays[piece["indices"]].reshape(-1, 3) for piece in ground["primitives"]]
        )
        _, row, column = path.stem.split("_")
        before, plain = glb_parts(site / f"tiles/{row}/{column}/glb/full.glb")
        old = next(mesh for mesh in before["meshes"] if mesh["name"] == "ground")["primitives"][0]
        assert np.array_equal(
            np.unique(faces, axis=0), np.unique(plain[old["indices"]].reshape(-1, 3), axis=0)
        )
        assert len(faces) == len(plain[old["indices"]].reshape(-1, 3))
        looks = [told["materials"][piece["material"]] for piece in ground["primitives"]]
        assert all("normalTexture" in look for look in looks[:-1])
        assert "normalTexture" not in looks[-1]
        box = np.array(boxes[name])
        half = np.diag(box[3:].reshape(3, 3))
        for node in told["nodes"][1:]:
            turn = Rotation.from_quat(node.get("rotation", [0.0, 0.0, 0.0, 1.0]))
            for piece in told["meshes"][node["mesh"]]["primitives"]:
                points = arrays[piece["attributes"]["POSITION"]] * node.get("scale", [1.0] * 3)
                points = turn.apply(points) + node.get("translation", [0.0] * 3)
                assert (np.abs(points - box[:3]) <= half + 1e-5).all()
        used = {piece["indices"] for mesh in told["meshes"] for piece in mesh["primitives"]}
        used |= {n for mesh in told["meshes"] for p in mesh["primitives"]
                 for n in p["attributes"].values()}  # fmt: skip
        assert used == set(range(len(told["accessors"])))


@pytest.mark.slow
def test_rocks_of_3d_tiles_near_paths_have_maps(near):
    """Each is there once, large ones by their close mesh, where it lies; the others are merged."""
    site, whole = near
    ids = rocks_near_paths(whole, smallest=GlbOptions().instances_min_m, within=NEAR)
    wanted = whole.field.select(np.isin(whole.field.id, ids))
    close = np.isin(wanted.id, seen_close(whole, within=NEAR))
    assert 3 < close.sum() < len(ids)
    shift = {node["content"]["uri"]: place for node, place in contents(site)}
    found = {}
    for path in sorted(site.glob("glb/close_*.glb")):
        told, arrays = glb_parts(path)
        for node in told["nodes"]:
            if not node.get("name", "").startswith("rock_"):
                continue
            piece = told["meshes"][node["mesh"]]["primitives"][0]
            look = told["materials"][piece["material"]]
            assert "normalTexture" in look
            assert "metallicRoughnessTexture" in look["pbrMetallicRoughness"]
            number, faces = int(node["name"].removeprefix("rock_")), len(arrays[piece["indices"]])
            assert number not in found
            found[number] = faces // 3, *(np.array(node["translation"]) + shift[path.name])
    shapes = [
        whole.library.prototypes[n].drawn(-int(c))
        for n, c in zip(wanted.prototype, close, strict=True)
    ]
    rows = np.column_stack([[len(mesh.faces) for mesh, _ in shapes], wanted.position])
    assert sorted(found) == wanted.id.tolist()
    assert np.allclose([found[one] for one in wanted.id.tolist()], rows, rtol=0.0, atol=1e-5)


@pytest.mark.consumer
def test_khronos_validator_finds_nothing_in_tiles_near_paths(near):
    for path in sorted(near[0].glob("glb/close_*.glb")):
        issues = gltf_issues(path)
        assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


@pytest.mark.slow
def test_pebbles_of_tiles_are_those_of_the_whole(near):
    """Each once, in the tile that it lies in; in GLB as in USD."""
    from pxr import Usd, UsdGeom

    site, whole = near
    wanted = path_pebbles(whole, smallest=0.06, within=2.0)
    wanted = wanted.position[np.lexsort(wanted.position.T)]
    stage = Usd.Stage.Open(str(site / "usd/world.usda"))
    tiles = stage.GetPrimAtPath("/World/Pebbles").GetChildren()
    assert len(tiles) > 1
    found = np.concatenate(
        [
            np.array(UsdGeom.PointInstancer(prim).GetPositionsAttr().Get(), np.float64)
            for prim in Usd.PrimRange(stage.GetPrimAtPath("/World/Pebbles"))
            if prim.IsA(UsdGeom.PointInstancer)
        ]
    )
    assert not stage.GetCompositionErrors()
    assert len(found) == len(wanted) > 20
    assert np.allclose(found[np.lexsort(found.T)], wanted, rtol=0, atol=1e-5)
    files = sorted(path.stem for path in site.glob("glb/pebbles_*.glb"))
    assert files == sorted(prim.GetName() for prim in tiles)
    full = {
        prim.GetName().removeprefix("tile_")
        for prim in stage.GetPrimAtPath("/World/Tiles").GetChildren()
        if prim.GetVariantSets().GetVariantSelection("lod") == "full"
    }
    fine = {path.stem.removeprefix("close_") for path in site.glob("usd/assets/close_*.usda")}
    assert full == fine | {name.removeprefix("pebbles_") for name in files}
    assert sum(_instances(glb_parts(site / f"glb/{name}.glb")[0]) for name in files) == len(wanted)
    manifest = json.loads((site / "manifest.json").read_text())
    for kind in ("usd", "glb"):
        assert any(f"{len(wanted)} pebbles" in one for one in manifest["exports"][kind]["losses"])


def _instances(told: dict) -> int:
    """How many things a GLB draws by EXT_mesh_gpu_instancing."""
    parts = [node.get("extensions", {}).get(INSTANCING) for node in told["nodes"]]
    places = [part["attributes"]["TRANSLATION"] for part in parts if part]
    return sum(told["accessors"][place]["count"] for place in places)
