from functools import partial
from importlib import import_module

import numpy as np
import pytest
import trimesh
from PIL import Image
from terrain_forge.exporters.mesh import Options, export

from terrain_forge.base import ExportError, RecipeError
from terrain_forge.geometry import lie_upright, skin
from terrain_forge.model import rotations
from terrain_forge.validation import read_objects, read_triangles
from terrain_forge.writers import vertex_normals
from tests.helpers import exports, worlds
from tests.helpers.ground_pictures import FINER, PIXELS, nodes, shows_its_nodes, speckled
from tests.helpers.surfaces import random_points, top_under

TILES = {"merged": {}, "tiled": {"tiles": "tiled", "tile_cells": 48}}


exported = partial(exports.exported, "mesh")


def objects(path):
    """Name, vertices and faces of each object of a mesh file."""
    if path.suffix != ".obj":
        mesh = trimesh.load(path, process=False)
        return [("all", mesh.vertices, mesh.faces)]
    return [(name, vertices, faces) for name, vertices, faces, _ in obj_objects(path)]


def obj_objects(path):
    """Name, vertices, faces and the corners' texture coordinates of an OBJ's objects, by hand."""
    rows = {b"v": [], b"vt": [], b"vn": []}
    parts = {}
    for line in path.read_bytes().splitlines():
        tag, *words = line.split()
        if tag in rows:
            rows[tag].append(words)
        elif tag == b"o":
            parts[words[0].decode()] = corners = []
        elif tag == b"f":
            corners.append([[int(n or 0) for n in word.split(b"/")] for word in words])
    vertices, coordinates = (np.array(rows[tag], float) for tag in (b"v", b"vt"))
    normals = np.linalg.norm(np.array(rows[b"vn"], float), axis=1)
    assert np.abs(normals - 1).max() < 2e-4
    assert len(normals) == len(vertices)
    for name, corners in parts.items():
        position, texture, normal = np.moveaxis(np.array(corners) - 1, -1, 0)
        assert np.array_equal(position, normal)
        used, faces = np.unique(position, return_inverse=True)
        yield name, vertices[used], faces.reshape(-1, 3), coordinates[texture]


def test_ply_has_the_dust_on_top_of_rocks(small_world, tmp_path):
    """Where a rock rises it is nearer to the ground's colour than where it stands upright."""
    colours = {}
    for rocks in ("none", "merged"):
        exported(small_world, tmp_path / rocks, format="ply", rocks=rocks)
        mesh = trimesh.load(tmp_path / rocks / "world.ply", process=False)
        colours[rocks] = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(float)
    nodes = small_world.ground.elevation.size
    stones = colours["merged"][nodes:]
    up = vertex_normals(mesh.vertices, mesh.faces)[nodes:, 2]
    ground = colours["none"].mean(axis=0)
    off = np.linalg.norm(stones - ground, axis=1)
    rising, upright = off[up > 0.9], off[np.abs(up) < 0.2]
    assert len(rising) > 20
    assert len(upright) > 20
    assert rising.mean() < 0.9 * upright.mean()


def test_rocks_as_objects(small_world, tmp_path):
    directory = exported(small_world, tmp_path / "mesh", format="obj", rocks="objects")
    parts = {name: part for name, *part in obj_objects(directory / "world.obj")}
    field, turns = small_world.field, rotations(small_world.field)
    assert set(parts) == {"ground", *(f"rock_{identity}" for identity in field.id)}
    for row in range(len(field)):
        prototype = small_world.library.prototypes[field.prototype[row]]
        shape, uvs = skin(prototype, upright=bool(lie_upright(field)[row]))
        wanted = field.scale[row] * shape.vertices @ turns[row].T + field.position[row]
        vertices, faces, coordinates = parts[f"rock_{field.id[row]}"]
        assert vertices.min(0) == pytest.approx(wanted.min(0), abs=2e-6)
        assert vertices.max(0) == pytest.approx(wanted.max(0), abs=2e-6)
        assert np.abs(vertices[faces] - wanted[shape.faces]).max() < 2e-6
        assert np.abs(coordinates - uvs).max() < 2e-6


def test_trimesh_reads_the_obj_with_its_looks(small_world, tmp_path):
    directory = exported(small_world, tmp_path / "mesh", format="obj", texture_pixels=PIXELS)
    mesh = trimesh.load(directory / "world.obj", force="mesh", process=False)
    points = random_points(small_world.ground, 200, 33)
    heights = top_under(mesh.vertices, mesh.faces, points)
    bare = small_world.ground.height_at(points[:, 0], points[:, 1])
    assert (heights > bare - 1e-5).all()
    assert np.median(heights - bare) < 1e-5
    scene = trimesh.load(directory / "world.obj", process=False)
    images = [part.visual.material.image for part in scene.geometry.values()]
    assert [image.size for image in images if image] == [(97 * FINER, 65 * FINER)]


def test_materials_lead_to_files(small_world, tmp_path):
    directory = exported(small_world, tmp_path / "mesh", format="obj", tiles="tiled", tile_cells=48)
    text = (directory / "world.mtl").read_text()
    known = {line.split()[1] for line in text.splitlines() if line.startswith("newmtl")}
    images = {line.split()[1] for line in text.splitlines() if line.startswith("map_Kd")}
    assert images == {f"ground_{n:03}.png" for n in range(4)}
    assert all((directory / image).is_file() for image in images)
    for path in directory.glob("*.obj"):
        lines = path.read_text().splitlines()
        assert {line.split()[1] for line in lines if line.startswith("usemtl")} <= known
        assert [line for line in lines if line.startswith("mtllib")] == ["mtllib world.mtl"]


@pytest.mark.parametrize("tiles", ["merged", "tiled"])
def test_the_texture_lies_the_right_way(small_world, tmp_path, tiles):
    world = speckled(small_world)
    options = TILES[tiles] | {"format": "obj", "texture_pixels": PIXELS, "rocks": "none"}
    directory = exported(world, tmp_path / "mesh", **options)
    found = sorted(directory.glob("*.obj"))
    assert len(found) == (1 if tiles == "merged" else 4)
    for path in found:
        rows = [line.split() for line in path.read_text().splitlines()]
        vertices = np.array([row[1:] for row in rows if row[0] == "v"], float)
        u, v = np.array([row[1:] for row in rows if row[0] == "vt"], float).T
        look = next(row[1] for row in rows if row[0] == "usemtl")
        with Image.open(directory / f"{look}.png") as image:
            assert shows_its_nodes(np.asarray(image), u, v, world, vertices)


def test_ply_has_the_nodes_colours(small_world, tmp_path):
    world = speckled(small_world)
    exported(world, tmp_path / "ply", format="ply", rocks="none")
    mesh = trimesh.load(tmp_path / "ply" / "world.ply", process=False)
    i, j = nodes(world, mesh.vertices)
    assert np.array_equal(mesh.visual.vertex_colors[:, :3], world.appearance.ground_rgb[j, i])


@pytest.mark.parametrize("form", ["obj", "stl", "ply"])
def test_bands_do_not_show(small_world, tmp_path, monkeypatch, form):
    whole = exported(small_world, tmp_path / "whole", format=form)
    monkeypatch.setattr(import_module("terrain_forge.geometry.ground_mesh"), "BAND_NODES", 300)
    banded = exported(small_world, tmp_path / "banded", format=form)
    name = f"world.{form}"
    assert (banded / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.parametrize("form", ["obj", "stl", "ply"])
def test_a_bare_world(small_world, tmp_path, form):
    directory = exported(worlds.bare(small_world), tmp_path / "mesh", format=form)
    assert sum(len(faces) for _, _, faces in objects(directory / f"world.{form}")) == 2 * 96 * 64


WRONG = {
    "rocks": [({"format": "stl", "rocks": "objects"}, "stl has no objects; choose format: obj")],
    "texture_pixels": [({"format": "ply", "texture_pixels": 64}, "ply has no textures")],
    "finest_min_m": [
        ({"rocks": "none", "finest_min_m": 1.0}, "for rocks: merged, here none"),
        (
            {"format": "obj", "rocks": "objects", "finest_min_m": 1.0},
            "for rocks: merged, here objects",
        ),
    ],
    "outline_error": [({"rocks": "none", "outline_error": 0.1}, "for rocks: merged, here none")],
    "tile_cells": [({"rocks": "none", "tile_cells": 64}, "choose tiles: tiled, or rocks: merged")],
}


@pytest.mark.parametrize("option", WRONG)
def test_options_without_effect_are_refused(option):
    for options, words in WRONG[option]:
        with pytest.raises(RecipeError, match=words) as caught:
            Options(**options)
        assert caught.value.key == (option,)


def test_losses_speak_of_what_is_in_the_file(small_world, tmp_path):
    field = small_world.field
    row = np.arange(len(field))
    solid = row % 3 > 0
    world = small_world.replace(field=field.replace(collides=solid, dynamic=solid & (row % 4 == 1)))
    said = {}
    for rocks in ("merged", "objects", "none"):
        (tmp_path / rocks).mkdir()
        options = Options(format="obj", rocks=rocks)
        said[rocks] = " ".join(export(world, tmp_path / rocks, options=options).losses)
    for words in ("visual-only", "dynamic rocks stand still"):
        assert words in said["merged"]
        assert words in said["objects"]
        assert words not in said["none"]
    assert "The 40 rocks are left out." in said["none"]
    assert "40 rocks are merged" in said["merged"]
    assert "merged" not in said["objects"] + said["none"]
    (tmp_path / "bare").mkdir()
    assert "rock" not in " ".join(
        export(worlds.bare(world), tmp_path / "bare", options=Options()).losses
    )


def test_a_ground_too_large_for_one_mesh(small_world, tmp_path, monkeypatch):
    monkeypatch.setattr(import_module("terrain_forge.exporters.mesh.writing"), "MOST_NODES", 6000)
    with pytest.raises(ExportError, match=r"6305 nodes.*choose tiles: tiled"):
        exported(small_world, tmp_path / "merged")
    exported(small_world, tmp_path / "tiled", tiles="tiled", tile_cells=48)


def test_validation_reads_large_files_piece_by_piece(small_world, tmp_path, monkeypatch):
    """The same as by hand, wherever a piece ends; a file that is cut short is refused."""
    module = import_module("terrain_forge.validation.surface_mesh")
    monkeypatch.setattr(module, "BYTES", 1000)
    monkeypatch.setattr(module, "TRIANGLES", 100)
    path = exported(small_world, tmp_path / "obj", format="obj", rocks="objects") / "world.obj"
    found, wanted = list(read_objects(path)), objects(path)
    assert [name for name, _ in found] == [name for name, *_ in wanted]
    for (_, mesh), (_, vertices, faces) in zip(found, wanted, strict=True):
        assert np.array_equal(mesh.vertices[mesh.faces], vertices[faces])
    path.write_text("o a\n\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no b\nv 0 0 1\nf 1 2 4\n")
    with pytest.raises(ValueError, match="object b names vertices of others"):
        list(read_objects(path))
    path = exported(small_world, tmp_path / "stl", format="stl") / "world.stl"
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in read_triangles(path)])
    _, vertices, faces = objects(path)[0]
    assert np.array_equal(corners, vertices[faces])
    path.write_bytes(path.read_bytes()[:-170])
    with pytest.raises(ValueError, match="ends 4 triangles too early"):
        list(read_triangles(path))
