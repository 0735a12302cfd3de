"""What a rock shows where its texture coordinates point to."""

import numpy as np
import pytest

from terrain_forge.base import linear_from_srgb
from terrain_forge.geometry import lie_upright, rock_factors, rock_maps, rock_texture, skin
from terrain_forge.model import rotations
from terrain_forge.scene import soil_colour, tint_colours
from terrain_forge.writers import vertex_normals


def shown(image, uvs):
    """Pixels where coordinates point to, u to the right and v up, the image repeating."""
    rows, columns = image.shape[:2]
    column = np.floor(uvs[..., 0] * columns).astype(int)
    assert ((column >= 0) & (column < columns)).all()
    return image[::-1][np.floor(uvs[..., 1] * rows).astype(int) % rows, column]


def faces(shape, *, upright):
    """Rise of each face's smooth normal, where its middle is in the image and in the tile."""
    mesh, uvs = skin(shape, upright=upright)
    rise = vertex_normals(mesh.vertices, mesh.faces)[mesh.faces, 2].mean(axis=1)
    return rise, uvs.mean(axis=1), shape.uvs[0].mean(axis=1)


def of_tile(tile, uvs):
    side = len(tile)
    return tile[tuple(np.floor(uvs[:, ::-1] * side).astype(int).T % side)]


def test_dust_lies_on_top_and_nowhere_else(small_world):
    image = linear_from_srgb(rock_texture(small_world, 0) / 255.0)
    bare, soil = tint_colours(small_world)[0].mean(axis=0), soil_colour(small_world)
    texture = small_world.library.texture
    kinds = [faces(shape, upright=True) for shape in small_world.library.prototypes]
    rise, places, own = map(np.concatenate, zip(*kinds, strict=True))
    light = of_tile(texture, own)[:, None] / texture.mean()
    seen, rock = shown(image, places), np.minimum(light * bare, 1.0)
    assert np.allclose(seen[rise < 0.3], rock[rise < 0.3], atol=0.02)
    share = ((seen - rock) / (soil * (0.6 + 0.4 * light) - rock))[..., 0]
    even = np.abs(light[:, 0] - 1.0) < 0.2
    assert np.median(share[even & (rise > 0.9)]) == pytest.approx(0.55, abs=0.05)
    assert 0.1 < np.median(share[even & (rise > 0.55) & (rise < 0.7)]) < 0.45


def test_a_rock_on_another_side_is_bare(small_world):
    texture, bare = small_world.library.texture, tint_colours(small_world)[0].mean(axis=0)
    image = linear_from_srgb(rock_texture(small_world, 0) / 255.0)
    for shape in small_world.library.prototypes:
        _, places, own = faces(shape, upright=False)
        rock = of_tile(texture, own)[:, None] / texture.mean() * bare
        assert np.allclose(shown(image, places), np.minimum(rock, 1.0), atol=0.02)
    field = small_world.field
    up = rotations(field) @ np.array([0.0, 0.0, 1.0])
    assert np.array_equal(lie_upright(field), up[:, 2] > 0.8)


def test_dusty_tops_have_the_soils_colour_whatever_their_tint(small_world):
    """Materials multiply the dust too: it is right in the mean of the tints."""
    image = linear_from_srgb(rock_texture(small_world, 0, tinted=True) / 255.0)
    factor = rock_factors(small_world, 0).mean(axis=0)
    _, columns = image.shape[:2]
    most = image[:, -columns // 4 :].mean(axis=(0, 1)) * factor
    bare = tint_colours(small_world)[0].mean(axis=0)
    assert np.allclose(most, bare + 0.55 * (soil_colour(small_world) - bare), atol=0.02)


def test_the_maps_lie_as_the_texture_does(small_world):
    library = small_world.library
    normals, roughness = rock_maps(small_world)
    assert normals.shape == rock_texture(small_world, 0).shape
    for shape in library.prototypes:
        _, places, own = faces(shape, upright=True)
        assert np.array_equal(shown(normals, places), of_tile(library.normals, own))
        assert np.array_equal(shown(roughness, places), of_tile(library.roughness, own))


def test_coordinates_of_long_shapes_stay_in_the_image(small_world):
    shape = small_world.library.prototypes[0]
    far = shape.replace(uvs=tuple(3.0 * uv - 1.0 for uv in shape.uvs))
    _, uvs = skin(far)
    assert uvs[..., 0].min() >= 0.0
    assert uvs[..., 0].max() <= 1.0
