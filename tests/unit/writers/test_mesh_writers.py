import io

import numpy as np
import pytest
import trimesh
from PIL import Image

from terrain_forge.base import image_rows, linear_from_srgb, srgb_from_linear
from terrain_forge.geometry import (
    coarse_shape,
    grid_faces,
    grid_normals,
    grid_texture_coordinates,
    grid_vertices,
    mean_rock_srgb,
    merge_in_parts,
    merge_rocks,
    rock_factors,
    rock_texture,
)
from terrain_forge.geometry.rock_mesh import outline_error
from terrain_forge.model import Heightfield, Mesh
from terrain_forge.scene import tint_colours
from terrain_forge.writers import (
    encode_png,
    encode_texture,
    file_name,
    identifier,
    index_corners,
    vertex_normals,
    write_obj,
    write_obj_rows,
    write_png,
    write_stl,
)
from terrain_forge.writers.mesh import vertex_tangents
from tests.helpers import worlds
from tests.helpers.surfaces import random_points, top_under


def read_obj(path):
    rows = {"v": [], "vn": [], "vt": [], "f": []}
    for line in path.read_text().splitlines():
        tag, *rest = line.split()
        rows[tag].append([part.split("/") for part in rest] if tag == "f" else rest)
    corners = np.array(rows.pop("f"))
    return {tag: np.array(values, float) for tag, values in rows.items() if values}, corners


def test_numbers_in_obj_are_rounded_to_the_micrometre_and_short():
    random = np.random.default_rng(1)
    values = random.uniform(-1, 1, (20000, 3)) * 10.0 ** random.integers(-8, 6, (20000, 3))
    edges = [[0, -0.0, -4e-7], [0.1, -2.5, 1e5], [999999.9999996, 0.000001, -10.000010]]
    values = np.concatenate([values, edges])
    file = io.BytesIO()
    write_obj_rows(file, b"v", values)
    lines = file.getvalue().decode().splitlines()
    texts = [line.split()[1:] for line in lines]
    read = np.array(texts, float)
    assert np.abs(read - values).max() <= 0.5e-6 * (1 + 1e-6)
    assert lines[-3:] == ["v 0 0 0", "v 0.1 -2.5 100000", "v 1000000 0.000001 -10.00001"]
    assert not any("." in t and t.endswith(("0", ".")) for row in texts for t in row)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e13])
def test_obj_refuses_what_is_no_coordinate(bad):
    with pytest.raises(ValueError, match="not finite or not below"):
        write_obj_rows(io.BytesIO(), b"v", np.array([[0.0, bad, 0.0]]))


def test_obj_reads_back(tmp_path, small_world):
    shape = small_world.library.prototypes[0].meshes[0]
    normals = vertex_normals(shape.vertices, shape.faces)
    uv = np.random.default_rng(2).uniform(size=(len(shape.vertices), 2))
    path = tmp_path / "rock.obj"
    write_obj(
        path, vertices=shape.vertices, faces=shape.faces, normals=normals, texture_coordinates=uv
    )
    values, corners = read_obj(path)
    assert np.abs(values["v"] - shape.vertices).max() <= 0.51e-6
    assert np.abs(values["vn"] - normals).max() <= 0.51e-4
    assert np.abs(values["vt"] - uv).max() <= 0.51e-6
    for index in range(3):  # position, texture coordinate, normal
        assert np.array_equal(corners[..., index].astype(int) - 1, shape.faces)


def test_obj_holds_texture_coordinates_of_corners(tmp_path, small_world):
    shape = small_world.library.prototypes[0].meshes[0]
    uvs = np.random.default_rng(3).integers(0, 9, (len(shape.faces), 3, 2)) / 4 - 1
    coordinates, index = index_corners(uvs)
    assert len(coordinates) <= 81
    path = tmp_path / "rock.obj"
    write_obj(
        path,
        vertices=shape.vertices,
        faces=shape.faces,
        normals=vertex_normals(shape.vertices, shape.faces),
        texture_coordinates=coordinates,
        texture_faces=index,
    )
    values, corners = read_obj(path)
    assert np.array_equal(values["vt"][corners[..., 1].astype(int) - 1], uvs)
    for kind in (0, 2):
        assert np.array_equal(corners[..., kind].astype(int) - 1, shape.faces)


def test_obj_texture_indices_may_be_longer_than_the_vertices(tmp_path):
    coordinates = np.random.default_rng(4).uniform(size=(12345, 2))
    path = tmp_path / "triangle.obj"
    write_obj(
        path,
        vertices=np.eye(3),
        faces=np.int32([[0, 1, 2]]),
        normals=np.eye(3),
        texture_coordinates=coordinates,
        texture_faces=np.int32([[12344, 0, 9999]]),
    )
    assert path.read_text().splitlines()[-1] == "f 1/12345/1 2/1/2 3/10000/3"


def test_a_rocks_texture_is_its_colour_in_linear_light(small_world):
    library = small_world.library.replace(
        texture=np.array([[0, 255], [64, 128]]), normals=None, roughness=None
    )
    world = small_world.replace(library=library)
    image = rock_texture(world, 1, tinted=True)[:, 1:3]  # the bare tile, which goes on around it
    colours = tint_colours(world)[1]
    colour, mean = colours.max(axis=0), 447 / 4
    for brightness, pixel in ((0, image[1, 0]), (255, image[1, 1]), (64, image[0, 0])):
        shown = linear_from_srgb(pixel / 255.0)
        assert np.allclose(shown, np.minimum(brightness / mean * colour, 1.0), atol=0.003)
    assert np.allclose(rock_factors(world, 1) * colour, colours)
    assert np.allclose(linear_from_srgb(np.array(mean_rock_srgb(world, 1))), colours.mean(axis=0))


def test_colours_go_to_linear_light_and_back():
    srgb = np.linspace(0, 1, 1001)
    assert np.allclose(srgb_from_linear(linear_from_srgb(srgb)), srgb, atol=1e-9)
    assert linear_from_srgb(0.5) == pytest.approx(0.21404, abs=1e-5)  # IEC 61966-2-1


def test_obj_without_texture_has_normals(tmp_path):
    path = tmp_path / "triangle.obj"
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    write_obj(
        path, vertices=vertices, faces=np.int32([[0, 1, 2]]), normals=vertices * 0 + [0, 0, 1]
    )
    assert path.read_text().splitlines()[-1] == "f 1//1 2//2 3//3"


def test_stl_reads_back(tmp_path, small_world):
    shape = small_world.library.prototypes[1].meshes[0]
    path = tmp_path / "rock.stl"
    write_stl(path, vertices=shape.vertices, faces=shape.faces)
    assert path.stat().st_size == 84 + 50 * len(shape.faces)
    read = trimesh.load(path, process=False)
    assert np.array_equal(read.triangles, shape.vertices.astype(np.float32)[shape.faces])
    stored = np.frombuffer(path.read_bytes()[84:], np.uint8).reshape(-1, 50)[:, :12].copy()
    assert np.allclose(stored.view(np.float32), read.face_normals, atol=1e-5)


def test_meshes_longer_than_a_chunk_read_back(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=5)
    faces = ball.faces.astype(np.int32)
    assert len(faces) > 2 * 8192
    write_obj(tmp_path / "b.obj", vertices=ball.vertices, faces=faces, normals=ball.vertices)
    write_stl(tmp_path / "b.stl", vertices=ball.vertices, faces=faces)
    for name in ("b.obj", "b.stl"):
        read = trimesh.load(tmp_path / name, process=False)
        assert np.allclose(read.triangles, ball.triangles, atol=1e-6)


def test_vertex_normals_of_a_ball_point_outwards():
    ball = trimesh.creation.icosphere(subdivisions=3)
    normals = vertex_normals(ball.vertices, ball.faces.astype(np.int32))
    assert (normals * ball.vertices).sum(1).min() > 0.999


@pytest.mark.parametrize("shape", [(7, 5), (7, 5, 3), (6, 9, 4), (1, 1, 3)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_reads_back(shape, dtype):
    image = np.random.default_rng(3).integers(0, np.iinfo(dtype).max + 1, shape).astype(dtype)
    with Image.open(io.BytesIO(encode_png(np.asfortranarray(image)))) as read:
        read.load()
        assert read.size == (shape[1], shape[0])
        found = np.asarray(read)
    if dtype == np.uint16 and len(shape) == 3:  # Pillow keeps the high bytes only
        image = (image >> 8).astype(np.uint8)
    assert np.array_equal(found, image)


def test_textures_are_the_files_of_their_pictures_however_many_there_are():
    pictures = [np.full((4, 6, 3), n, np.uint8) for n in range(40)]
    pictures += [pictures[3].reshape(6, 4, 3), pictures[3].reshape(12, 6), pictures[3]]
    for picture in (*pictures, *pictures):
        assert encode_texture(picture) == encode_png(picture)
    one = encode_texture(pictures[5])
    assert encode_texture(pictures[5].copy()) is one


def test_png_refuses_what_is_no_image(tmp_path):
    with pytest.raises(ValueError, match=r"shape \(4, 4\) and type float64"):
        write_png(tmp_path / "x.png", np.zeros((4, 4)))
    with pytest.raises(ValueError, match=r"shape \(4, 4, 2\)"):
        write_png(tmp_path / "x.png", np.zeros((4, 4, 2), np.uint8))


def test_the_ground_mesh_is_the_surface(small_world):
    ground = small_world.ground
    vertices, faces = grid_vertices(ground), grid_faces(*ground.shape)
    points = random_points(ground, 500, 4)
    wanted = ground.height_at(points[:, 0], points[:, 1])
    assert np.abs(top_under(vertices, faces, points) - wanted).max() < 1e-9
    a, b, c = (vertices[faces[:, n]] for n in range(3))
    assert np.cross(b - a, c - a)[:, 2].min() > 0


def test_ground_normals_of_a_plane_and_across_tiles(small_world):
    east, north = np.meshgrid(np.arange(9) * 0.5, np.arange(6) * 0.5)
    plane = Heightfield(elevation=0.3 * east - 0.2 * north, spacing=0.5, origin=(0, 0))
    wanted = np.array([-0.3, 0.2, 1]) / np.linalg.norm([-0.3, 0.2, 1])
    assert np.allclose(grid_normals(plane, plane), wanted, atol=1e-6)
    whole = small_world.ground
    normals = grid_normals(whole, whole).reshape(*whole.shape, 3)
    part = whole.cut(column=20, row=8, columns=30, rows=16)
    cut = grid_normals(part, whole).reshape(*part.shape, 3)
    assert np.array_equal(cut, normals[8:25, 20:51])


def test_texture_coordinates_find_the_nodes_pixel():
    rows, columns = 4, 7
    colours = np.random.default_rng(5).integers(0, 256, (rows, columns, 3)).astype(np.uint8)
    image = image_rows(colours)
    u, v = grid_texture_coordinates(rows, columns).T
    column = (u * columns - 0.5).round().astype(int)
    row_from_top = ((1 - v) * rows - 0.5).round().astype(int)
    assert np.array_equal(image[row_from_top, column], colours.reshape(-1, 3))


def sunk(ground, depth):
    return Heightfield(elevation=ground.elevation - depth, spacing=0.25, origin=ground.origin)


def test_merged_rocks_keep_every_rock_where_nothing_is_buried(small_world):
    shapes = [shape.meshes[0] for shape in small_world.library.prototypes]
    field = small_world.field
    vertices, faces = merge_rocks(field, shapes, sunk(small_world.ground, 100))
    merged = trimesh.Trimesh(vertices, faces, process=False)
    assert merged.is_watertight
    assert merged.volume == pytest.approx(field.volume.sum(), rel=1e-9)
    assert merged.body_count == len(field)


def test_merged_rocks_leave_out_only_what_is_under_the_ground(small_world):
    shapes = [shape.meshes[0] for shape in small_world.library.prototypes]
    field, ground = small_world.field, small_world.ground
    whole, every = merge_rocks(field, shapes, sunk(ground, 100))
    vertices, faces = merge_rocks(field, shapes, ground)
    assert 0.3 * len(every) < len(faces) < 0.9 * len(every)
    bare = whole[:, 2] > ground.height_at(whole[:, 0], whole[:, 1])
    kept = {corner.tobytes() for corner in vertices[faces].reshape(-1, 9)}
    shown = whole[every[bare[every].any(axis=1)]].reshape(-1, 9)
    assert all(corner.tobytes() in kept for corner in shown)
    assert np.array_equal(np.unique(faces), np.arange(len(vertices)))


def test_no_rock_makes_an_empty_mesh(small_world):
    shapes = [shape.meshes[0] for shape in small_world.library.prototypes]
    vertices, faces = merge_rocks(worlds.bare(small_world).field, shapes, small_world.ground)
    assert vertices.shape == (0, 3)
    assert faces.shape == (0, 3)


def test_the_coarse_shape_is_the_smallest_that_fits(small_world):
    prototype = small_world.library.prototypes[0]
    finest = prototype.meshes[0]
    assert outline_error(Mesh(vertices=finest.vertices * 1.1, faces=finest.faces), finest) < 0.12
    rough = Mesh(vertices=finest.vertices * 1.04, faces=finest.faces[:20])
    off = Mesh(vertices=np.add(finest.vertices, (0, 0, 0.3)), faces=finest.faces[:10])
    meshes = finest, rough, off
    levels = prototype.replace(
        meshes=meshes,
        hulls=(finest, finest),
        uvs=tuple(np.zeros((len(mesh.faces), 3, 2)) for mesh in meshes),
        outline_errors=(0.0, 0.1, 0.3),
    )
    assert coarse_shape(levels, 0.05) is levels.meshes[1]
    assert coarse_shape(levels, 0.5) is levels.meshes[2]
    assert coarse_shape(levels, 0.001) is levels.meshes[0]  # none fits but itself


def test_names_stay_apart_and_plain():
    names = [
        "gale",
        "Gale Höhe",
        "Gale Hohe",
        "火星",
        "月",
        "a b",
        "a_b",
        "a-b",
        "7",
        "_x_",
        "-",
        "",
    ]
    for make in (file_name, identifier):
        made = [make(name) for name in names]
        assert len(set(made)) == len(names)
        assert all(name.isascii() and name[0].isalpha() for name in made)
    assert file_name("gale-long") == "gale-long"
    assert identifier("gale_long") == "gale_long"
    assert identifier("gale-long").replace("_", "").isalnum()


def test_rocks_in_parts_are_the_rocks_at_once(small_world, monkeypatch):
    field, shapes = small_world.field, [p.meshes[0] for p in small_world.library.prototypes]
    whole, every = merge_rocks(field, shapes, small_world.ground)
    monkeypatch.setattr("terrain_forge.geometry.rock_mesh.PART", 7)
    parts = list(merge_in_parts(field, shapes, small_world.ground))
    assert len(parts) == 6
    assert np.array_equal(np.concatenate([vertices for vertices, _ in parts]), whole)
    first = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [part + start for (_, part), start in zip(parts, first, strict=False)]
    assert np.array_equal(np.concatenate(faces), every)
    below = small_world.ground.replace(elevation=small_world.ground.elevation + 100)
    assert list(merge_in_parts(field, shapes, below)) == []


def test_vertex_normals_are_weighted_by_area():
    vertices = np.array([(0, 0, 0), (2, 0, 0), (0, 1, 0), (0, 0, 3), (9, 9, 9)], float)
    faces = np.array([(0, 1, 2), (0, 3, 1)])  # areas 1 towards +z, 3 towards +y
    normals = vertex_normals(vertices, faces)
    assert normals[0] == pytest.approx((0, 6 / np.hypot(6, 2), 2 / np.hypot(6, 2)))
    assert normals[2] == pytest.approx((0, 0, 1))
    assert normals[3] == pytest.approx((0, 1, 0))
    assert normals[4] == pytest.approx((0, 0, 1))  # belongs to no face


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_tangents_lead_to_the_right_of_a_picture(side):
    """On a ball whose picture runs round it once, in either sense."""
    ball = trimesh.creation.uv_sphere(1.0)
    up = ball.vertices / np.linalg.norm(ball.vertices, axis=1)[:, None]
    east, north = np.arctan2(up[:, 1], up[:, 0]), np.arcsin(up[:, 2].clip(-1, 1))
    turns = east[ball.faces]
    away = (np.ptp(turns, axis=1) < 2.0) & (np.abs(north[ball.faces]) < 1.4).all(axis=1)
    faces = ball.faces[away]
    found = vertex_tangents(up, up, np.column_stack([side * east, north]), faces)
    inner = np.unique(faces)
    right = side * np.column_stack([-up[:, 1], up[:, 0], 0 * east])
    right /= np.linalg.norm(right, axis=1).clip(1e-9)[:, None]
    assert (np.sum(found[inner, :3] * right[inner], axis=1) > 0.99).all()
    assert (found[inner, 3] == side).all()
    assert np.allclose(np.linalg.norm(found[:, :3], axis=1), 1.0)
    assert np.abs(np.sum(found[:, :3] * up, axis=1)).max() < 1e-9
