"""Horizons, shadows and hours of light against brute-force rays over the DTM's own samples."""

from __future__ import annotations

import json
from datetime import timedelta

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine, from_origin
from scipy.ndimage import map_coordinates

import terrain_forge as tf
from terrain_forge.base import DataError, OutputError, RecipeError
from terrain_forge.building import require_ours
from terrain_forge.illumination import Relief, Source, Wish, horizon_slopes, illuminate, seen_part
from terrain_forge.illumination.land import find_land
from terrain_forge.making import place_of, plan
from terrain_forge.model import MARS, MOON, Heightfield
from terrain_forge.sky import days_of, look_up, read_time
from tests.helpers.command_line import run
from tests.helpers.recipes import flat

_RADIUS = 1_737_400.0
_POSTING, _SIDE = 20.0, 200


def rough(rows: int, columns: int, seed: int = 4) -> np.ndarray:
    """Hills of all sizes."""
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((rows, columns)))
    k = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)[None])
    k[0, 0] = 1.0
    z = np.fft.irfft2(noise * k**-1.9, s=(rows, columns))
    return np.asarray(z / z.std())


def test_horizons_are_those_of_dense_rays():
    ground = Heightfield(
        elevation=(30.0 * rough(90, 70)).astype(np.float32), spacing=5.0, origin=(-100.0, 40.0)
    )
    relief, random = Relief.of(ground), np.random.default_rng(1)
    places = [(r, c) for r in (0, 44, 89) for c in (0, 30, 69)]
    points = np.array(
        [(ground.east[c], ground.north[r], ground.elevation[r, c]) for r, c in places]
    )
    points[:, 2] += 0.5
    away = np.geomspace(0.5, 700.0, 20_000)
    for azimuth in (*np.arange(8) * np.pi / 4.0, *random.uniform(0.0, 6.28, 8)):
        found = horizon_slopes((relief,), points, float(azimuth))
        for point, slope in zip(points, found, strict=True):
            east = point[0] + away * np.sin(azimuth)
            north = point[1] + away * np.cos(azimuth)
            on = ground.covers(east, north)
            if on.any():
                seen = (ground.height_at(east[on], north[on]) - point[2]) / away[on]
                assert np.arctan(slope) == pytest.approx(np.arctan(seen.max()), abs=4e-4)
            else:
                assert slope == -20.0


def test_grids_within_grids_are_one_horizon():
    whole = Heightfield(
        elevation=(30.0 * rough(65, 65)).astype(np.float32), spacing=5.0, origin=(0.0, 0.0)
    )
    inner = whole.cut(column=20, row=16, columns=24, rows=30)
    point = np.array([[150.0, 160.0, float(whole.height_at(150.0, 160.0)) + 1.0]])
    for azimuth in np.linspace(0.0, 6.0, 13):
        alone = horizon_slopes((Relief.of(whole),), point, azimuth)
        nested = horizon_slopes((Relief.of(inner), Relief.of(whole)), point, azimuth)
        assert nested == pytest.approx(alone, abs=1e-9)


@pytest.mark.parametrize("off", [-1e-3, 0.0, 1e-3])
def test_a_point_beside_a_node_has_the_horizon_of_the_node(off):
    ridge = 10.0 - np.abs(np.arange(9.0) - 4.0)
    ground = Heightfield(
        elevation=np.tile(ridge, (9, 1)).astype(np.float32), spacing=1.0, origin=(0.0, 0.0)
    )
    point = np.array([[4.0 + off, 4.0, float(ground.height_at(4.0 + off, 4.0))]])
    for azimuth in (0.5 * np.pi, 1.5 * np.pi):
        slope = horizon_slopes((Relief.of(ground),), point, azimuth)[0]
        assert slope == pytest.approx(-1.0, abs=2e-3)


def test_a_hole_hides_nothing():
    z = np.zeros((9, 9), np.float32)
    z[4, 6], z[4, 7] = 10.0, -1e9
    ground = Heightfield(elevation=z, spacing=1.0, origin=(0.0, 0.0))
    point = np.array([[1.0, 4.0, 0.0]])
    assert horizon_slopes((Relief.of(ground),), point, np.pi / 2)[0] == pytest.approx(2.0)
    z[4, 6] = -1e9
    assert horizon_slopes((Relief.of(ground.replace(elevation=z)),), point, np.pi / 2)[0] == 0.0


def test_horizons_of_a_dtm_that_lies_askew_are_those_of_rays_over_its_samples(tmp_path):
    """Where its samples lie between the nodes of a grid east and north, close horizons count."""
    side, posting, eye = 160, 20.0, 0.5
    heights = 40.0 * rough(side, side)
    corner = Affine.translation(3.0 - 0.5 * side * posting, 0.5 * side * posting - 7.0)
    turned = Affine.rotation(30.0) * corner * Affine.scale(posting, -posting)
    with rasterio.open(
        tmp_path / "dtm.tif", "w", driver="GTiff", height=side, width=side, count=1,
        dtype="float32", transform=turned,
        crs=f"+proj=stere +lat_0=-89.5 +lon_0=45 +R={_RADIUS} +units=m",
    ) as file:  # fmt: skip
        file.write(heights.astype(np.float32), 1)
    dtm = tf.RasterDtm(
        source="dtm.tif", size_m=(400.0, 400.0), noise="keep", level="none",
        centre=tf.Centre(lonlat_deg=(45.0, -89.5)),
    )  # fmt: skip
    terrain = tf.TerrainSpec(spacing_m=4.0)
    site = plan(tf.Recipe(name="askew", body="moon", dtm=dtm, terrain=terrain), folder=tmp_path)
    source = Source(dtm=dtm, folder=tmp_path)
    land = find_land(site, source=source, size=None, spacing=50.0, reach=2000.0, height=eye)

    def above(x, y):  # linear between the samples, over the plane through the centre
        column, row = ~turned * (x, y)
        inside = np.maximum(abs(column - 0.5 * side), abs(row - 0.5 * side)) < 0.5 * side - 1
        found = map_coordinates(heights, [row - 0.5, column - 0.5], order=1)
        return np.where(inside, found - (x * x + y * y) / (2.0 * _RADIUS), -1e9)

    away, off = np.arange(2.0, 1500.0, 0.5), []
    for azimuth in np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, 24):
        slopes = horizon_slopes(land.reliefs, land.points, float(azimuth))
        for (east, north, _), slope in zip(land.points, slopes, strict=True):
            stand = above(np.array([east]), np.array([north])) + eye
            x, y = east + away * np.sin(azimuth), north + away * np.cos(azimuth)
            true = np.arctan(((above(x, y) - stand) / away).max())
            off.append(abs(np.degrees(np.arctan(slope) - true)))
    assert np.median(off) < 0.06
    assert np.quantile(off, 0.95) < 1.1


def test_a_disc_sets_by_parts():
    assert seen_part(np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), 1.0).tolist() == [0, 0, 0.5, 1, 1]
    assert seen_part(np.array([0.4]), 1.0) == pytest.approx(1.0 - seen_part(np.array([-0.4]), 1.0))


@pytest.fixture(scope="module")
def pole(tmp_path_factory) -> tuple[tf.RecipeFile, np.ndarray]:
    """Hills 3 km from the Moon's south pole in a polar stereographic DTM, and their heights."""
    folder = tmp_path_factory.mktemp("pole")
    heights = (300.0 * rough(_SIDE, _SIDE)).astype(np.float32)
    corner = -1000.0, 5000.0
    with rasterio.open(
        folder / "pole.tif", "w", driver="GTiff", height=_SIDE, width=_SIDE, count=1,
        dtype="float32", transform=from_origin(*corner, _POSTING, _POSTING),
        crs=f"+proj=stere +lat_0=-90 +lon_0=0 +k=1 +x_0=0 +y_0=0 +R={_RADIUS} +units=m +no_defs",
    ) as file:  # fmt: skip
        file.write(heights, 1)
    (folder / "pole.yaml").write_text(
        "name: pole\nbody: moon\ndtm: {source: pole.tif, size_m: [320, 240], noise: keep}\n"
        "terrain: {spacing_m: 4}\nsun: {elevation_deg: 2}\n"
    )
    return tf.load_recipe(folder / "pole.yaml"), heights


def brute_seen(site, heights: np.ndarray, moment: str, east: float, north: float) -> float:
    """Part of the Sun's disc over a place, by rays on a sphere with the DTM on it.

    Everything is done anew in the body's own axes: the place, its vertical, points along a great
    circle, their distances from the body's centre, the stereographic projection by its formula.
    """
    ephemeris, (lon, lat) = place_of(site, key=())
    above = look_up(ephemeris, (lon, lat), np.array([days_of(read_time(moment))]))

    def axes(lon: float, lat: float) -> np.ndarray:
        up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        return np.stack([east, np.cross(up, east), up])

    def height(points: np.ndarray) -> np.ndarray:
        unit = points / np.linalg.norm(points, axis=-1, keepdims=True)
        scale = 2.0 * _RADIUS / (1.0 - unit[..., 2])  # from the north pole onto the southern plane
        column = (scale * unit[..., 1] + 1000.0) / _POSTING - 0.5
        row = (5000.0 - scale * unit[..., 0]) / _POSTING - 0.5
        i = np.clip(np.floor(column).astype(int), 0, _SIDE - 2)
        j = np.clip(np.floor(row).astype(int), 0, _SIDE - 2)
        u, v = column - i, row - j
        z = (1 - v) * ((1 - u) * heights[j, i] + u * heights[j, i + 1])
        z += v * ((1 - u) * heights[j + 1, i] + u * heights[j + 1, i + 1])
        off = (u < -0.5) | (u > 1.5) | (v < -0.5) | (v > 1.5)
        return np.where(off, -1e5, z)

    centre = axes(lon, lat)
    foot = centre[2] + (east * centre[0] + north * centre[1]) / _RADIUS
    foot /= np.linalg.norm(foot)
    own = foot * (_RADIUS + height(foot))
    sun = above.sun[0] @ centre
    level = sun - (sun @ foot) * foot
    level /= np.linalg.norm(level)
    angles = np.arange(4.0, 4200.0, 4.0) / _RADIUS
    along = np.cos(angles)[:, None] * foot + np.sin(angles)[:, None] * level
    rise = along * (_RADIUS + height(along))[:, None] - own
    top = np.arctan2(rise @ foot, rise @ level).max()
    return float(seen_part(np.array(np.arcsin(sun @ foot) - top), 0.5 * above.sun_diameter[0]))


def test_shadows_and_hours_are_those_of_brute_force_rays(pole, tmp_path):
    file, heights = pole
    site = plan(file.recipe, folder=file.folder)
    source = Source(dtm=file.recipe.dtm, folder=file.folder)
    wish = Wish(begin="2030-08-01", end="2030-08-29", step="2d", azimuths=24)
    illuminate(site, source, tmp_path, wish)
    with rasterio.open(tmp_path / "sun_seen.tif") as seen:
        shares, names = seen.read()[:, ::-1] / 100.0, seen.descriptions
    assert len(names) == 14
    table = json.loads((tmp_path / "illumination.json").read_text())["moments"]
    assert [row["time"] for row in table] == list(names)
    with rasterio.open(tmp_path / "sunlight_hours.tif") as hours:
        total = hours.read(1)[::-1]
    assert total == pytest.approx(48.0 * shares.sum(axis=0), abs=48.0 * 14 * 0.006)
    random, off = np.random.default_rng(2), []
    rows, columns = total.shape
    for _ in range(150):
        n, j, i = random.integers(14), random.integers(rows), random.integers(columns)
        east = 20.0 * (i - (columns - 1) / 2.0) * (320.0 / 20.0 / (columns - 1))
        north = 20.0 * (j - (rows - 1) / 2.0) * (240.0 / 20.0 / (rows - 1))
        off.append(abs(brute_seen(site, heights, names[n], east, north) - shares[n, j, i]))
    assert 0.1 < shares.mean() < 0.9, "some is lit and some is not"
    # Bilinear there, triangles here: edges of shadows lie a little apart.
    assert np.mean(off) < 0.03
    assert np.mean(np.array(off) > 0.25) < 0.05


@pytest.mark.slow
def test_horizon_maps_serve_many_moments(pole, tmp_path):
    """With more moments than azimuths the horizon lies between those that were looked at."""
    file, _ = pole
    site = plan(file.recipe, folder=file.folder)
    source = Source(dtm=file.recipe.dtm, folder=file.folder)
    period = {"begin": "2030-08-01", "end": "2030-08-29", "step": "1d", "size": (80.0, 80.0)}
    folders = [tmp_path / "exact", tmp_path / "map"]
    for folder, azimuths in zip(folders, (720, 24), strict=True):
        illuminate(site, source, folder, Wish(**period, azimuths=azimuths))
    hours = []
    for folder in folders:
        with rasterio.open(folder / "sunlight_hours.tif") as made:
            hours.append(made.read(1))
        with rasterio.open(folder / "horizon.tif") as made:
            assert made.descriptions[0] == "height of the horizon 0 deg from grid north"
        assert (folder / "shadows.webp").stat().st_size > 1000
    assert np.abs(hours[0] - hours[1]).mean() < 0.1 * 24 * 28
    with rasterio.open(folders[0] / "never_lit.tif") as made:
        never = made.read(1)
    assert (hours[0][never == 1] == 0.0).all()


@pytest.mark.parametrize(
    ("wish", "error", "told"),
    [
        ({"begin": "2030-02-01", "end": "2030-01-01"}, OutputError, "must be after"),
        ({"begin": "2030-02-01", "step": "soon"}, OutputError, "such as 90s, 30m, 1h or 2d"),
        ({"begin": "2030-02-01", "step": "5"}, OutputError, "a length with its unit"),
        ({"begin": "1999-01-01", "end": "2040-01-01", "step": "60s"}, OutputError, "at most"),
        ({"begin": "2055-01-01"}, RecipeError, "1950"),
        ({"begin": "2030-01-01", "size": (9000.0, 9000.0)}, DataError, "reaches beyond the DTM"),
        (
            {"begin": "2030-01-01", "size": (1e6, 1e6)},
            DataError,
            "beyond the DTM, which",
        ),
        ({"begin": "2030-01-01", "spacing": 1e-3}, OutputError, "points needs about .* GB"),
        ({"begin": "2030-01-01", "spacing": 900.0}, OutputError, "a side of the map is 240 m"),
    ],
)
def test_what_cannot_be_found_is_refused(pole, tmp_path, wish, error, told):
    file, _ = pole
    site = plan(file.recipe, folder=file.folder)
    source = Source(dtm=file.recipe.dtm, folder=file.folder)
    with pytest.raises(error, match=told):
        illuminate(site, source, tmp_path, Wish(**wish))
    assert not [*tmp_path.iterdir()]


def test_light_over_a_period_needs_a_place(tmp_path):
    dtm = tf.FlatDtm(size_m=(4.0, 4.0))
    site = plan(tf.Recipe(name="x", body="mars", dtm=dtm, terrain=tf.TerrainSpec(spacing_m=0.5)))
    with pytest.raises(RecipeError, match=r"dtm\.lonlat_deg of a flat site$") as error:
        illuminate(site, Source(dtm=dtm, folder=tmp_path), tmp_path, Wish(begin="2030-01-01"))
    assert error.value.key == ("dtm",)


@pytest.mark.parametrize(
    "wish",
    [{"height": np.nan}, {"height": -1.0}, {"reach": np.inf}, {"spacing": 0.0}, {"spacing": np.nan},
     {"size": (-5.0, 40.0)}, {"size": (40.0, np.inf)}],
)  # fmt: skip
def test_a_length_is_a_number(wish):
    with pytest.raises(OutputError, match=f"^{next(iter(wish))} "):
        Wish(**wish)


def test_a_folder_that_holds_anything_else_stays(pole, tmp_path):
    file, _ = pole
    site, light = plan(file.recipe, folder=file.folder), tmp_path / "light"
    source = Source(dtm=file.recipe.dtm, folder=file.folder)
    wish = Wish(begin="2030-08-01", end="2030-08-02", step="6h", size=(40.0, 40.0), azimuths=8)
    mine = tmp_path / "mine" / "horizon.tif"
    mine.parent.mkdir()
    mine.write_text("my own")
    told: list[str] = []
    with pytest.raises(OutputError, match="not a terrain-forge illumination"):
        illuminate(site, source, mine.parent, wish)
    assert (mine.read_text(), [*mine.parent.iterdir()]) == ("my own", [mine])
    for _ in range(2):  # an older one of ours is replaced
        illuminate(site, source, light, wish, tell=told.append)
    assert told[0].startswith("17 × 17 points, 16 rays each: about ")
    manifest = json.loads((light / "manifest.json").read_text())
    assert {*manifest["outputs"], "manifest.json"} == {path.name for path in light.iterdir()}
    (light / "note").write_text("my own")
    with pytest.raises(OutputError, match="1 file that its manifest does not list: note"):
        illuminate(site, source, light, wish)
    assert illuminate(site, source, light, wish, force=True)[0].endswith("light: note")
    with pytest.raises(OutputError, match="holds a terrain-forge illumination, no world"):
        require_ours(light)
    (light / "manifest.json").write_text(json.dumps({**manifest, "holds": "world"}))
    with pytest.raises(OutputError, match="holds a terrain-forge world, no illumination"):
        illuminate(site, source, light, wish, force=True)


def test_a_sol_may_begin_by_night_and_names_the_place_as_its_map_does(tmp_path, monkeypatch):
    """On Mars a map's latitudes are from the planet's centre, the Sun's are not."""
    side = 40
    with rasterio.open(
        tmp_path / "mars.tif", "w", driver="GTiff", height=side, width=side, count=1,
        dtype="float32", transform=from_origin(1e6, 1.2e6, _POSTING, _POSTING),
        crs="+proj=eqc +R=3396190 +units=m +no_defs",
    ) as raster:  # fmt: skip
        raster.write((40.0 * rough(side, side)).astype(np.float32), 1)
    (tmp_path / "sol.yaml").write_text(
        "name: sol\nbody: mars\ndtm: {source: mars.tif, size_m: [200, 200]}\n"
        'terrain: {spacing_m: 4}\nsun: {time: 2031-02-18, ltst: "00:00"}\n'
    )
    monkeypatch.chdir(tmp_path)
    assert "it is night" in run("check", "sol.yaml").stderr
    done = run("illumination", "sol.yaml", "--size", 40, 40, "--azimuths", 8)
    assert done.returncode == 0, done.stderr
    table = json.loads((tmp_path / "sol_illumination" / "illumination.json").read_text())
    up = [row["sun_elevation_deg"] > 0.0 for row in table["moments"]]
    assert (len(up), up[0], up[24], up[-1]) == (48, False, True, False)
    site = plan(tf.load_recipe("sol.yaml").recipe, folder=tmp_path, by_night=True)
    assert np.radians(table["lonlat_deg"]) == pytest.approx(np.array(site.lonlat), abs=1e-8)


def test_a_flat_site_has_nothing_to_show(tmp_path):
    level = plan(flat((8.0, 8.0), 1.0, lonlat=(0.0, 0.0)))
    with pytest.raises(RecipeError, match="flat"):
        illuminate(level, None, tmp_path, Wish(begin="2030-01-01"))


def test_solar_days():
    from terrain_forge.illumination import solar_day

    assert solar_day(MARS.ephemeris) / timedelta(seconds=1) == pytest.approx(88_775.24, abs=0.1)
    assert solar_day(MOON.ephemeris) / timedelta(days=1) == pytest.approx(29.5306, abs=1e-3)
