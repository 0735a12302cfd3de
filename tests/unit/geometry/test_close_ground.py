"""The ground near paths has pictures of its own, which show what one of the whole would."""

import io

import numpy as np
import pytest
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade
from terrain_forge.exporters.glb import Options as GlbOptions
from terrain_forge.exporters.glb import export as export_glb
from terrain_forge.exporters.usd import Options as UsdOptions
from terrain_forge.exporters.usd import export as export_usd

from terrain_forge.geometry import bake_ground, close_ground, close_patches
from terrain_forge.geometry.close_ground import cells_near_paths, close_pixel
from terrain_forge.model import path_points
from tests.helpers.plain_readers import glb_chunks
from tests.helpers.usd_stages import labelled
from tests.helpers.worlds import of_materials

WITHIN = 1.5


@pytest.fixture(scope="module")
def world(small_world):
    """A world with two materials, in patches that paths cross."""
    rows, columns = small_world.ground.shape
    return of_materials(small_world, np.indices((rows, columns)).sum(axis=0) // 9 % 2, (0.7, 0.8))


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Pixels large enough that a picture of the whole can be made beside."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(close_ground, "FINEST", 0.05)
        yield


def patches_of(tile, within=WITHIN):
    near = cells_near_paths(tile, within=within)
    return near, list(close_patches(tile, within=within, largest=1))


def test_cells_near_paths_are_those_within_reach(world):
    for tile in world.tiles(cells=40):
        ground = tile.ground
        near = cells_near_paths(tile, within=WITHIN)
        assert near.shape == (ground.shape[0] - 1, ground.shape[1] - 1)
        rows, columns = np.indices(near.shape) + 0.5
        places = np.stack([columns, rows], axis=-1) * ground.spacing + ground.origin
        away = np.linalg.norm(places[:, :, None] - path_points(world.trajectories), axis=3).min(
            axis=2
        )
        assert near[away < WITHIN - 1.5 * ground.spacing].all()
        assert not near[away > WITHIN + 1.5 * ground.spacing].any()
    assert not cells_near_paths(next(world.tiles()), within=0.0).any()


def test_patches_show_what_a_picture_of_the_whole_would(world):
    for tile in world.tiles(cells=40):
        near, patches = patches_of(tile)
        cells = np.concatenate([patch.cells for patch in patches]) if patches else []
        assert sorted(cells) == np.flatnonzero(near).tolist(), "each is in one"
        rows, columns = tile.ground.shape
        for patch in patches:
            side = round(patch.texture.rgb.shape[1] * patch.scale[0] / columns)
            whole = bake_ground(tile.world, finer=side)
            row, column = np.divmod(patch.cells, columns - 1)
            # Where texture coordinates put the middles of the cells, both show the same.
            u, v = (column + 1.0) / columns, (row + 1.0) / rows
            for part, all_of_it in (
                (patch.texture.rgb, whole.rgb),
                (patch.texture.normals, whole.normals),
            ):
                i = np.rint((patch.scale[0] * u + patch.offset[0]) * part.shape[1]).astype(int)
                j = np.rint((patch.scale[1] * v + patch.offset[1]) * part.shape[0]).astype(int)
                there = np.rint(v * all_of_it.shape[0]).astype(int)
                along = np.rint(u * all_of_it.shape[1]).astype(int)
                off = np.abs(part[j, i].astype(int) - all_of_it[there, along])
                assert np.quantile(off, 0.99) <= 1
    assert len(patches_of(next(world.tiles()))[1]) > 2


def test_long_paths_have_coarser_pixels(world, monkeypatch):
    monkeypatch.setattr(close_ground, "FINEST", 0.004)
    length = sum(path.length for path in world.trajectories)
    assert close_pixel(world, 1e-6) == 0.004
    within = 100.0
    assert 2.0 * within * length / close_pixel(world, within) ** 2 == pytest.approx(2**24)


def test_a_finer_picture_of_the_whole_needs_none(world):
    tile = next(world.tiles())
    assert not list(close_patches(tile, within=WITHIN, largest=8192))


def test_usd_shows_them_on_faces_of_their_own(world, tmp_path):
    options = {"tile_cells": 40, "texture_pixels": 1}
    export_usd(world, tmp_path, options=UsdOptions(close_within_m=WITHIN, **options))
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    grounds = labelled(stage, "ground")
    seen = 0
    for tile, prim in zip(world.tiles(cells=40), grounds, strict=True):
        image = UsdGeom.Imageable(prim)
        kind = UsdShade.Tokens.materialBind
        assert UsdGeom.Subset.ValidateFamily(image, UsdGeom.Tokens.face, kind)[0]
        patches = {patch.number: patch for patch in patches_of(tile)[1]}
        drawn = np.zeros(len(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get()), int)
        for subset in UsdGeom.Subset.GetGeomSubsets(image, UsdGeom.Tokens.face, kind):
            look, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
            name = look.GetPath().name
            faces = np.array(subset.GetIndicesAttr().Get())
            if not name.startswith("close_"):
                assert name == "regolith"
                drawn[faces] -= bool(patches)
                continue
            drawn[faces] += 1
            patch = patches[int(name.removeprefix("close_"))]
            assert np.isin(faces // 2, patch.cells).all()
            shader = UsdShade.Shader(stage.GetPrimAtPath(look.GetPath().AppendChild("image_st")))
            assert np.allclose(shader.GetInput("scale").Get(), patch.scale)
            assert np.allclose(shader.GetInput("translation").Get(), patch.offset)
            picture = UsdShade.Shader(stage.GetPrimAtPath(look.GetPath().AppendChild("image")))
            file = picture.GetInput("file").Get().resolvedPath
            shown = np.asarray(Image.open(file)).astype(int)[::-1]
            assert np.abs(shown - patch.texture.rgb).mean() < 4.0
            seen += 1
        wanted = np.repeat(cells_near_paths(tile, within=WITHIN).ravel(), 2)
        # Each face has a look of its own if any has: Blender takes no mesh's beside them.
        assert np.array_equal(drawn, np.where(wanted, 1, -int(wanted.any())))
    assert seen > 4


def test_glb_shows_them_by_primitives_of_their_own(world, tmp_path):
    options = {"tile_cells": 40, "texture_pixels": 1}
    report = export_glb(world, tmp_path, options=GlbOptions(close_within_m=WITHIN, **options))
    assert any("pixels of about 50 mm" in line for line in report.losses)
    asset, binary = glb_chunks((tmp_path / "world.glb").read_bytes())

    def view(number):
        told = asset["bufferViews"][number]
        start = told.get("byteOffset", 0)
        return binary[start : start + told["byteLength"]]

    meshes = [mesh for mesh in asset["meshes"] if mesh["name"].startswith("ground")]
    for tile, mesh in zip(world.tiles(cells=40), meshes, strict=True):
        near, patches = patches_of(tile)
        counts = [asset["accessors"][part["indices"]]["count"] for part in mesh["primitives"]]
        wanted = [6 * len(patch.cells) for patch in patches]
        assert counts == [*wanted, *([6 * int((~near).sum())] if not near.all() else [])]
        for patch, part in zip(patches, mesh["primitives"], strict=False):
            look = asset["materials"][part["material"]]
            texture = look["pbrMetallicRoughness"]["baseColorTexture"]
            place = texture["extensions"]["KHR_texture_transform"]
            # v runs down in both: 1 - (scale · v + offset) for v = 1 - v'.
            top = 1.0 - patch.scale[1] - patch.offset[1]
            assert np.allclose(place["scale"], patch.scale)
            assert np.allclose(place["offset"], (patch.offset[0], top))
            image = asset["images"][asset["textures"][texture["index"]]["source"]]
            assert image["mimeType"] == "image/jpeg"
            shown = np.asarray(Image.open(io.BytesIO(view(image["bufferView"])))).astype(int)
            assert np.abs(shown[::-1] - patch.texture.rgb).mean() < 4.0
            assert "TANGENT" in part["attributes"]


def test_what_is_near_a_path_takes_no_memory_for_what_lies_around_the_ground(world):
    for tile in world.tiles(cells=40):
        assert cells_near_paths(tile, within=1e9).all()
