"""The SDF export, its files read without Gazebo: ground and rocks."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from terrain_forge.exporters.sdf import Options, export
from terrain_forge.exporters.sdf.heightmap import heightmap_error, make_heightmap

from terrain_forge.base import ExportError
from terrain_forge.dtm.projection import body_crs, local_crs
from terrain_forge.geometry import bake_ground, rock_factors, rock_texture, skin
from terrain_forge.model import Heightfield, rotations
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import grain, rock_tints
from tests.helpers import worlds
from tests.helpers.ground_pictures import FINER, PIXELS, shows_its_nodes, speckled
from tests.helpers.sdf_files import exported, file_of, meshes, models, numbers


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_every_reference_leads_to_a_file(small_world, tmp_path, flavour):
    directory = exported(small_world, tmp_path / "sdf", flavour=flavour, tile_cells=48)
    version = {"gz": "1.9", "classic": "1.6"}[flavour]
    for name in ("world.sdf", "scene.sdf"):
        root = ET.parse(directory / name).getroot()
        assert root.get("version") == version
        uris = [uri.text for uri in root.iter("uri")]
        assert uris == ["model://by-hand_ground", "model://by-hand_rocks"]
        assert all((file_of(directory, uri) / "model.config").is_file() for uri in uris)
    for name, model in models(directory).items():
        assert model.get("name") == name
        assert model.findtext("static") == "true"
        uris = [e.text for e in model.iter() if e.tag in ("uri", "albedo_map")]
        assert len(uris) > 4
        assert all(file_of(directory, uri).exists() for uri in uris)
        for link in model.iter("link"):
            names = [part.get("name") for part in link]
            assert len(set(names)) == len(names)
    scripts = list(directory.glob("models/*/materials/scripts/*.material"))
    assert len(scripts) == (2 if flavour == "classic" else 0)
    for script in scripts:
        texts = script.read_text().split()
        images = [text for text in texts if text.endswith(".png")]
        assert images
        assert all((script.parents[1] / "textures" / image).is_file() for image in images)
        assert ("wrap" in texts) == script.stem.endswith("_rocks")


def test_gravity_and_sun(small_world, sdf):
    world = ET.parse(sdf / "world.sdf").getroot().find("world")
    assert np.allclose(numbers(world.find("gravity")), (0, 0, -small_world.site.body.gravity))
    light = world.find("light")
    assert light.get("type") == "directional"
    direction = numbers(light.find("direction"))
    assert np.allclose(direction, -small_world.lighting.towards_sun, atol=1e-8)
    assert world.findtext("physics/dart/collision_detector") == "ode"
    assert world.find("actor") is None


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_the_texture_lies_the_right_way(small_world, tmp_path, flavour):
    world = speckled(small_world)
    options = {"flavour": flavour, "tile_cells": 48, "texture_pixels": PIXELS}
    directory = exported(world, tmp_path / "sdf", **options)
    model = directory / "models/by-hand_ground"
    rows = [line.split() for line in (model / "meshes/ground_003.obj").read_text().splitlines()]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], float)
    u, v = np.array([row[1:] for row in rows if row[0] == "vt"], float).T
    with Image.open(model / "materials/textures/ground_003.png") as image:
        pixels = np.asarray(image)
    assert pixels.shape == (17 * FINER, 49 * FINER, 3)
    assert shows_its_nodes(pixels, u, v, world, vertices)


@pytest.mark.parametrize("kind", ["visual", "collision"])
def test_large_rocks_are_where_they_are(small_world, sdf, kind):
    field, shapes = small_world.field, small_world.library.prototypes
    large = np.flatnonzero(field.diameter >= 0.5)
    found = {
        int(name.split("_")[1]): vertices
        for name, vertices, _ in meshes(sdf, models(sdf)["by-hand_rocks"], kind)
        if name.startswith("rock_")
    }
    assert sorted(found) == field.id[large].tolist()
    turns = rotations(field)
    for row in large:
        points = shapes[field.prototype[row]].meshes[0].vertices * field.scale[row]
        wanted = points @ turns[row].T + field.position[row]
        vertices = found[field.id[row]]
        assert np.allclose(vertices.min(0), wanted.min(0), atol=2e-6)
        assert np.allclose(vertices.max(0), wanted.max(0), atol=2e-6)


def test_small_rocks_are_merged_where_they_are(small_world, sdf):
    field, shapes = small_world.field, small_world.library.prototypes
    rocks = models(sdf)["by-hand_rocks"]
    merged = [m for m in meshes(sdf, rocks, "collision") if m[0].startswith("small_")]
    turns = rotations(field)
    small = np.flatnonzero(field.diameter < 0.5)
    assert len(small) > 5
    for row in small:
        points = shapes[field.prototype[row]].meshes[0].vertices * field.scale[row]
        placed = points @ turns[row].T + field.position[row]
        top = placed[placed[:, 2].argmax()]
        off = [np.linalg.norm(vertices - top, axis=1).min() for _, vertices, _ in merged]
        assert min(off) < 1e-5


def test_all_rocks_merged_or_none(small_world, tmp_path):
    merged = exported(small_world, tmp_path / "merged", individual_min_m=100)
    single = exported(small_world, tmp_path / "single", individual_min_m=0)
    assert not list(merged.glob("models/*_rocks/meshes/shape_*"))
    assert not list(single.glob("models/*_rocks/meshes/small_*"))
    assert len(list(models(single)["by-hand_rocks"].iter("collision"))) == len(small_world.field)


def test_a_world_without_rocks_and_paths(small_world, tmp_path):
    directory = exported(worlds.bare(small_world, trajectories=()), tmp_path / "sdf")
    assert (directory / "scene.sdf").read_bytes() == (directory / "world.sdf").read_bytes()
    assert len(list(models(directory)["by-hand_rocks"].iter("collision"))) == 0


@pytest.mark.parametrize("name", ['Gale <"Höhe"> & 7', "火星 \x01", "two  words"])
def test_any_name_will_do(small_world, tmp_path, name):
    path = small_world.trajectories[0].replace(name=name)
    world = small_world.replace(site=small_world.site.replace(name=name), trajectories=(path,))
    directory = exported(world, tmp_path / "sdf")
    files = [str(p.relative_to(directory)) for p in directory.rglob("*")]
    assert all(file.isascii() and " " not in file for file in files)
    for config in directory.glob("models/*/model.config"):
        assert ET.parse(config).getroot().findtext("name").strip()
    scene = ET.parse(directory / "scene.sdf").getroot()
    assert all(file_of(directory, uri.text).is_dir() for uri in scene.iter("uri"))


@pytest.mark.parametrize("name", ["by-hand_ground", "by-hand_horizon"])
def test_no_actor_is_called_as_something_else(small_world, tmp_path, name):
    path = small_world.trajectories[0].replace(name=name)
    with pytest.raises(ExportError, match=f"path '{name}': a model of the scene is called so"):
        exported(small_world.replace(trajectories=(path,)), tmp_path / "sdf")


def test_single_rocks_show_their_populations_texture(small_world, sdf):
    """Through the OBJ's own texture coordinates, each corner's."""
    rocks = models(sdf)["by-hand_rocks"]
    for visual in rocks.iter("visual"):
        if visual.get("name").startswith("rock_"):
            row = int(visual.get("name").split("_")[1])
            population = small_world.field.population[row]
            image = file_of(sdf, visual.findtext("material/pbr/metal/albedo_map"))
            assert image.name == f"rock_{population}.png"
            for kind in ("normal", "roughness"):
                assert file_of(sdf, visual.findtext(f"material/pbr/metal/{kind}_map")).is_file()
            factor = [float(n) for n in visual.findtext("material/diffuse").split()][:3]
            wanted = rock_factors(small_world, population)
            tint = rock_tints(small_world.field.id[row : row + 1], small_world.site.seed)[0]
            assert np.allclose(factor, wanted[tint], atol=1e-5)
    with Image.open(image) as picture:
        pixels = np.asarray(picture)[::-1].astype(int)
    assert np.array_equal(pixels[::-1], rock_texture(small_world, population, tinted=True))
    shape = small_world.library.prototypes[0]
    lines = (sdf / "models/by-hand_rocks/meshes/shape_000.obj").read_text().splitlines()
    vt = np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)
    faces = [line.split()[1:] for line in lines if line.startswith("f ")]
    index = np.array([[corner.split("/")[1] for corner in face] for face in faces], int)
    assert np.abs(vt[index - 1] - skin(shape)[1]).max() < 1e-6


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_dynamic_rocks_are_bodies(small_world, tmp_path, flavour):
    world = worlds.loosened(small_world)
    directory = exported(world, tmp_path / "sdf", flavour=flavour)
    field, turns = world.field, rotations(world.field)
    for file in ("world.sdf", "scene.sdf"):
        bodies = ET.parse(directory / file).getroot().findall("world/model")
        assert [b.get("name") for b in bodies] == [f"rock_{i}" for i in field.id[field.dynamic]]
    for body, row in zip(bodies, np.flatnonzero(field.dynamic), strict=True):
        assert body.find("static") is None
        pose = numbers(body.find("pose"))
        assert np.allclose(pose[:3], field.position[row], atol=1e-7)
        turn = Rotation.from_euler("xyz", pose[3:]).as_matrix()
        assert np.allclose(turn, turns[row], atol=1e-8)
        hull = world.library.prototypes[field.prototype[row]].meshes[0].vertices
        for kind in ("visual", "collision"):
            ((_, vertices, _),) = meshes(directory, body, kind)
            wanted = field.scale[row] * np.ptp(hull, axis=0)
            assert np.allclose(np.ptp(vertices, axis=0), wanted, atol=2e-6)
        friction = body.find("link/collision/surface/friction")
        patch = float(friction.findtext("torsional/patch_radius"))
        torsional = 3 * np.pi / 16 * patch * float(friction.findtext("torsional/coefficient"))
        assert torsional == pytest.approx(dynamic_contact(field.diameter[row]).torsional)


def test_every_convex_part_is_a_collision(small_world, tmp_path):
    world = worlds.loosened(small_world)
    shapes = [p.replace(hulls=(*p.hulls, *p.hulls)) for p in world.library.prototypes]
    world = world.replace(library=world.library.replace(prototypes=tuple(shapes)))
    directory = exported(world, tmp_path / "sdf", individual_min_m=0)
    model = models(directory)["by-hand_rocks"]
    field = world.field
    fixed = field.collides & ~field.dynamic
    assert len(list(model.iter("collision"))) == 2 * fixed.sum()
    for body in ET.parse(directory / "world.sdf").getroot().findall("world/model"):
        names = [part.get("name") for part in body.iter("collision")]
        assert names == ["collision_0", "collision_1"]


def test_rocks_visual_only_have_no_collision(small_world, tmp_path):
    world = worlds.loosened(small_world)
    model = models(exported(world, tmp_path / "sdf", individual_min_m=0.8))["by-hand_rocks"]
    field = world.field
    large, fixed = field.diameter >= 0.8, ~field.dynamic
    for kind, wanted in (("visual", fixed & large), ("collision", fixed & large & field.collides)):
        names = [part.get("name") for part in model.iter(kind)]
        single = [int(name.split("_")[1]) for name in names if name.startswith("rock_")]
        assert single == field.id[wanted].tolist()
    merged = {
        kind: sum(len(m[2]) for m in meshes(tmp_path / "sdf", model, kind) if "rock_" not in m[0])
        for kind in ("visual", "collision")
    }
    assert (fixed & ~large & ~field.collides).any()
    assert 0 < merged["collision"] < merged["visual"]


def test_losses_are_named(small_world, tmp_path):
    world = small_world.replace(site=small_world.site.replace(crs="LOCAL_CS[]", lonlat=(0.1, 0.2)))
    (tmp_path / "sdf").mkdir()
    losses = " ".join(export(world, tmp_path / "sdf", options=Options(texture_pixels=1024)).losses)
    for word in ("fixed", "merged", "W/m²", "longitude", "without colliding", "pixels of 25 mm;"):
        assert word in losses


def read_heightmap(directory):
    """The collision as `height(x, y)`, its samples, and the number of grey levels."""
    collision = models(directory)["by-hand_ground"].find("link/collision")
    shape = collision.find("geometry/heightmap")
    with Image.open(file_of(directory, shape.findtext("uri"))) as image:
        pixels = np.asarray(image)[::-1].astype(float)
    place = "geometry/heightmap/pos" if collision.find("pose") is None else "pose"
    return numbers(shape.find("size")), numbers(collision.find(place))[:3], pixels


@pytest.mark.parametrize(
    ("bits", "flavour", "release"),
    [(8, "gz", None), (16, "gz", "garden"), (8, "classic", None)],
)
def test_a_heightmap_is_the_ground_up_to_its_steps(small_world, tmp_path, bits, flavour, release):
    options = {"ground": "heightmap", "flavour": flavour, "release": release}
    directory = exported(small_world, tmp_path / "sdf", **options)
    size, pos, pixels = read_heightmap(directory)
    assert pixels.shape == (129, 129)
    assert (pixels.min(), pixels.max()) == (0, 2**bits - 1)
    spread = size[:2] * (128 / 129 if flavour == "gz" else 1)
    assert np.allclose(spread, (24, 16))
    heights = pos[2] + size[2] * pixels / (2**bits - 1)
    east = pos[0] + np.linspace(-0.5, 0.5, 129) * spread[0]
    north = pos[1] + np.linspace(-0.5, 0.5, 129) * spread[1]
    wanted = small_world.ground.height_at(*np.meshgrid(east, north))
    assert np.abs(heights - wanted).max() <= 0.5001 * size[2] / (2**bits - 1)
    model = models(directory)["by-hand_ground"]
    assert [c.get("name") for c in model.iter("collision")] == ["ground_heightmap"]
    assert len(list(model.iter("visual"))) == 1


def test_a_square_grid_of_the_right_size_is_kept_node_for_node(small_world, tmp_path):
    square = small_world.ground.cut(column=20, row=0, columns=64, rows=64)
    heightmap = make_heightmap(square, bits=16)
    assert not heightmap.resampled
    assert heightmap_error(heightmap, square) <= 0.5 * heightmap.quantum + 1e-6
    (tmp_path / "sdf").mkdir()
    options = Options(ground="heightmap", release="garden")
    losses = " ".join(export(small_world, tmp_path / "sdf", options=options).losses)
    assert "resampled to 129² samples" in losses
    found = make_heightmap(small_world.ground, bits=16)
    assert f"{1000 * heightmap_error(found, small_world.ground):.3g} mm" in losses


def test_a_ground_too_large_for_a_heightmap_is_refused(small_world, tmp_path):
    strip = Heightfield(elevation=np.zeros((2, 4098)), spacing=0.25, origin=(0.0, 0.0))
    world = worlds.on_ground(small_world, strip)
    with pytest.raises(ExportError, match=r"4097 × 1 cells.*at most 4096.*ground: mesh"):
        export(world, tmp_path, options=Options(ground="heightmap"))
    assert not list(tmp_path.iterdir())


def soil_slope(spacing, finer):
    """RMS slope along an axis of waves of soil that a texture of so many pixels a node shows.

    Unit noise interpolates gradients from -1 to 1 by a quintic: 0.51, integrated over its cell. The
    waves are half as long and steeper by the next, down to two pixels.
    """
    place = (np.arange(400) + 0.5) / 400
    fade = place**3 * (place * (place * 6 - 15) + 10)
    steep = 30 * place**2 * (place - 1) ** 2
    weights = [(1 - fade, -steep, place), (fade, steep, place - 1)]
    variance = sum(
        (((w + rise * away)[:, None] * v) ** 2 + (rise[:, None] * v * other) ** 2).mean() / 3
        for w, rise, away in weights
        for v, _, other in weights
    )
    total, wave = 0.0, min(grain.SOIL_COARSEST, 1.5 * spacing)
    weight = (wave / grain.SOIL_COARSEST) ** (grain.SOIL_HURST - 1.0)
    least, whole = grain.SOIL_SHOWN
    while (shown := min(1.0, (wave * finer / spacing - least) / (whole - least))) > 0.0:
        total += (grain.SOIL_STEEP * shown * weight) ** 2 * variance
        wave *= grain.SOIL_STEP
        weight *= grain.SOIL_STEP ** (grain.SOIL_HURST - 1.0)
    return np.sqrt(total)


def test_normal_maps_show_the_soil_where_it_lies(small_world, tmp_path):
    options = {"tile_cells": 48, "texture_pixels": PIXELS}
    directory = exported(small_world, tmp_path / "sdf", **options)
    folder = directory / "models/by-hand_ground/materials/textures"
    whole = bake_ground(small_world, finer=FINER).normals
    shown = (whole - 127.75) / 127.5
    slopes = shown[..., :2] / shown[..., 2:]
    # Stones add a little to the soil.
    assert slopes.std() == pytest.approx(soil_slope(small_world.ground.spacing, FINER), rel=0.1)
    for number, (row, column) in enumerate([(0, 0), (0, 48), (48, 0), (48, 48)]):
        with Image.open(folder / f"ground_{number:03}_normals.png") as image:
            normals = np.asarray(image)[::-1].astype(int)
        assert normals.shape == ((49 if row == 0 else 17) * FINER, 49 * FINER, 3)
        part = whole[row * FINER :, column * FINER :][: len(normals), : normals.shape[1]]
        assert np.abs(normals - part).max() <= 1
    classic = exported(small_world, tmp_path / "classic", flavour="classic")
    plain = exported(small_world, tmp_path / "plain", normal_maps=False)
    for directory in (classic, plain):
        assert not list(directory.rglob("*_normals.png"))
        assert models(directory)["by-hand_ground"].find(".//normal_map") is None


def test_the_site_is_placed_where_sdf_knows_its_body(small_world, tmp_path):
    lonlat = (np.radians(137.4), np.radians(-4.6))
    crs = local_crs(body_crs(3396190.0), 137.4, -4.6)
    site = small_world.site.replace(crs=crs, lonlat=lonlat, datum_height=-4500.0)
    world = small_world.replace(site=site)
    known = exported(world, tmp_path / "known", release="garden")
    root = ET.parse(known / "world.sdf").getroot()
    assert root.get("version") == "1.10"
    place = root.find("world/spherical_coordinates")
    figures = {e.tag: e.text for e in place}
    assert figures["surface_model"] == "CUSTOM_SURFACE"
    assert float(figures["latitude_deg"]) == pytest.approx(-4.6, abs=1e-8)
    assert float(figures["longitude_deg"]) == pytest.approx(137.4, abs=1e-8)
    assert float(figures["surface_axis_equatorial"]) == 3396190
    assert float(figures["elevation"]) == -4500
    for options in ({}, {"flavour": "classic"}):
        unknown = exported(world, tmp_path / f"{len(options)}", **options)
        assert ET.parse(unknown / "world.sdf").getroot().find(".//spherical_coordinates") is None
