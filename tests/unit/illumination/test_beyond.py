"""Beyond the first DTM the horizon comes from a second one: against rays over both on a sphere."""

from __future__ import annotations

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

import terrain_forge as tf
from terrain_forge.illumination import Source, Wish, illuminate
from terrain_forge.making import place_of, plan

_RADIUS = 1_737_400.0
_CRS = f"+proj=stere +lat_0=-90 +lon_0=0 +k=1 +x_0=0 +y_0=0 +R={_RADIUS} +units=m +no_defs"
_MIDDLE = 3000.0, 5000.0
"""Of both DTMs, in their coordinates [m]."""
_FINE, _COARSE = (20.0, 120), (200.0, 240)
"""Posting [m] and samples along a side."""
_RAISED = 570.0
"""How much too high the second DTM is [m]."""


_EYE = 3.0
"""Of who looks, above the ground [m]."""

_REACH = 20_000.0
"""How far from the middle is looked, east and north [m]."""


def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Hills of 5 to 12 km that both DTMs show [m]."""
    waves = ((1.0, 0.4, 5000.0), (-0.3, 1.0, 7000.0), (0.7, -0.8, 9000.0), (0.9, 0.6, 12_000.0))
    return np.asarray(sum(
        0.03 * long * np.sin(2.0 * np.pi * (a * x + b * y) / (long * np.hypot(a, b)) + long)
        for a, b, long in waves
    ))  # fmt: skip


def knolls(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Knolls in the middle that the first DTM alone shows [m]."""
    u, v = x - _MIDDLE[0], y - _MIDDLE[1]
    inside = np.clip(1.0 - (u * u + v * v) / 600.0**2, 0.0, 1.0) ** 2
    return np.asarray(6.0 * inside * np.sin(u / 120.0) * np.cos(v / 150.0))


def write(path, posting: float, side: int, heights) -> None:
    west, north = _MIDDLE[0] - 0.5 * side * posting, _MIDDLE[1] + 0.5 * side * posting
    centres = (np.arange(side) + 0.5) * posting
    z = heights(*np.meshgrid(west + centres, north - centres)).astype(np.float32)
    with rasterio.open(
        path, "w", driver="GTiff", height=side, width=side, count=1, dtype="float32", crs=_CRS,
        transform=from_origin(west, north, posting, posting),
    ) as file:  # fmt: skip
        file.write(z, 1)


@pytest.fixture(scope="module")
def pole(tmp_path_factory) -> tf.RecipeFile:
    folder = tmp_path_factory.mktemp("beyond")
    write(folder / "near.tif", *_FINE, lambda x, y: hills(x, y) + knolls(x, y))
    write(folder / "far.tif", *_COARSE, lambda x, y: hills(x, y) + _RAISED)
    (folder / "pole.yaml").write_text(
        "name: pole\nbody: moon\n"
        "dtm: {source: near.tif, size_m: [320, 240], noise: keep}\n"
        "horizon: {dtm: far.tif}\nterrain: {spacing_m: 4}\nsun: {elevation_deg: 2}\nexports: []\n"
    )
    return tf.load_recipe(folder / "pole.yaml")


def brute_horizon(site, east: float, north: float, azimuth: float) -> float:
    """Height of the horizon [rad] by rays on a sphere with the hills' own formula on it."""
    _, (lon, lat) = place_of(site, key=())

    def height(points: np.ndarray) -> np.ndarray:
        unit = points / np.linalg.norm(points, axis=-1, keepdims=True)
        scale = 2.0 * _RADIUS / (1.0 - unit[..., 2])  # from the north pole onto the southern plane
        x, y = scale * unit[..., 1], scale * unit[..., 0]
        return hills(x, y) + knolls(x, y)

    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    eastward = np.array([-np.sin(lon), np.cos(lon), 0.0])
    northward = np.cross(up, eastward)
    foot = up + (east * eastward + north * northward) / _RADIUS
    foot /= np.linalg.norm(foot)
    own = foot * (_RADIUS + height(foot) + _EYE)
    level = np.sin(azimuth) * eastward + np.cos(azimuth) * northward
    level -= (level @ foot) * foot
    level /= np.linalg.norm(level)
    far = _REACH / max(abs(np.sin(azimuth)), abs(np.cos(azimuth)))
    angles = np.concatenate([np.arange(10.0, 1500.0, 5.0), np.arange(1500.0, far, 25.0)])
    angles /= _RADIUS
    along = np.cos(angles)[:, None] * foot + np.sin(angles)[:, None] * level
    rise = along * (_RADIUS + height(along))[:, None] - own
    return float(np.arctan2(rise @ foot, rise @ level).max())


def horizon_map(site, source, folder, **wish) -> tuple[np.ndarray, list[str]]:
    """Heights of the horizon [degrees], shape [azimuths, rows north, columns]; what was told."""
    period = {"begin": "2030-08-01", "end": "2030-08-02", "step": "12h"}
    lines = illuminate(
        site, source, folder, Wish(**period, azimuths=24, height=_EYE, reach=_REACH, **wish)
    )
    with rasterio.open(folder / "horizon.tif") as made:
        return made.read()[:, ::-1], lines


def differences(site, horizon: np.ndarray, spacing: float) -> np.ndarray:
    """How far horizons of random points lie from those of rays [degrees]."""
    random, off = np.random.default_rng(5), []
    azimuths, rows, columns = horizon.shape
    for _ in range(80):
        k, j, i = random.integers(azimuths), random.integers(rows), random.integers(columns)
        east, north = ((n - (m - 1) / 2) * spacing for n, m in ((i, columns), (j, rows)))
        turn = 2.0 * np.pi * k / azimuths
        true = np.degrees(brute_horizon(site, east, north, turn))
        off.append(abs(true - horizon[k, j, i]))
    return np.array(off)


def test_the_horizon_is_that_of_rays_over_both(pole, tmp_path):
    site = plan(pole.recipe, folder=pole.folder)
    near = Source(dtm=pole.recipe.dtm, folder=pole.folder)
    both = Source(dtm=pole.recipe.dtm, folder=pole.folder, beyond="far.tif")
    wish = {"size": (320.0, 240.0), "spacing": 20.0}
    found, lines = horizon_map(site, both, tmp_path / "both", **wish)
    off = differences(site, found, 20.0)
    assert np.median(off) < 0.02
    assert off.max() < 0.1
    assert "at 5 m, then 20 m, then 200 m" in lines[0]
    alone, _ = horizon_map(site, near, tmp_path / "near", **wish)
    assert differences(site, alone, 20.0).max() > 1.0, "the first alone is not enough"
    assert (found - alone).min() > -0.1, "what the first shows is still there"


def test_holes_of_the_first_are_filled_and_nothing_beside_them_changes(pole, tmp_path):
    (tmp_path / "far.tif").write_bytes((pole.folder / "far.tif").read_bytes())
    with rasterio.open(pole.folder / "near.tif") as file:
        profile, heights = file.profile, file.read(1)
    heights[52:56, 40:45] = heights[57, 62] = heights[65, 50] = -9999.0
    with rasterio.open(tmp_path / "near.tif", "w", **profile | {"nodata": -9999.0}) as file:
        file.write(heights, 1)
    wish = {"size": (320.0, 240.0), "spacing": 20.0}
    found = []
    for folder in (pole.folder, tmp_path):
        site = plan(pole.recipe, folder=pole.folder)
        source = Source(dtm=pole.recipe.dtm, folder=folder, beyond="far.tif")
        found.append(horizon_map(site, source, tmp_path / f"light{len(found)}", **wish)[0])
    whole, bored = found
    told = bored > -90.0
    assert 0 < np.count_nonzero(~told[0]) < 20
    off = np.abs(bored - whole)[told]
    assert np.quantile(off, 0.9) < 2e-3
    assert off.max() < 0.3


def test_a_world_has_the_horizon_of_what_it_holds(pole, tmp_path):
    site = plan(pole.recipe, folder=pole.folder)
    world = tf.realise(site)
    found, lines = horizon_map(
        world.site, None, tmp_path / "held", size=(320.0, 240.0), spacing=20.0
    )
    off = differences(site, found, 20.0)
    assert np.median(off) < 0.03
    assert off.max() < 0.2
    assert "at 5 m, then " in lines[0]


def test_the_command_reads_the_recipe_s_horizon(pole, tmp_path, capsys):
    from terrain_forge.cli import main

    when = ["--from", "2030-08-01", "--to", "2030-08-02", "--step", "12h", "--azimuths", "8"]
    map_ = ["--size", "100", "100", "--spacing", "30", "-o", str(tmp_path / "light")]
    assert main(["illumination", str(pole.path), *when, *map_]) == 0
    told = capsys.readouterr().out
    assert "then 200 m" in told
    assert "map 90 × 90 m, a point each 30 m (nearest to 100 × 100 m)" in told
