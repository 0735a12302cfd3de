"""The Sun by date against other ephemerides, and what dates are refused."""

from __future__ import annotations

import json
from datetime import UTC, datetime

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.base import RecipeError
from terrain_forge.model import BODIES, MARS, MERCURY, MOON
from terrain_forge.sky import (
    SunSpec,
    day_of,
    days_of,
    highest_declination,
    look_up,
    moment_of,
    planetographic,
    read_time,
)
from tests.helpers.ephemerides import GOLDEN
from tests.helpers.recipes import flat

_JEZERO = (np.radians(77.45), np.radians(18.44))
ROWS = json.loads(GOLDEN.read_text())


def apart_deg(a, b) -> float:
    return float(np.degrees(2.0 * np.arcsin(0.5 * np.linalg.norm(np.subtract(a, b)))))


@pytest.mark.parametrize("row", ROWS, ids=[f"{row['body']}-{row['time'][:10]}" for row in ROWS])
def test_sun_and_earth_stand_where_other_ephemerides_have_them(row):
    lonlat = tuple(np.radians(row["lonlat_deg"]))
    days = days_of(datetime.fromisoformat(row["time"]))
    above = look_up(BODIES[row["body"]].ephemeris, lonlat, np.array([days]))
    assert apart_deg(above.sun[0], row["sun"]) < 0.05
    assert above.sun_distance[0] == pytest.approx(row["au"], rel=3e-4)
    if "earth" in row:
        assert apart_deg(above.earth[0], row["earth"]) < 0.05
    if "season_deg" in row:
        off = np.degrees(above.season[0]) - row["season_deg"]
        assert abs((off + 180.0) % 360.0 - 180.0) < 0.05


def test_known_moments():
    # Mars: northern spring equinox of its year 36 on 2021-02-07, and perihelion at 1.38 au.
    above = look_up(
        MARS.ephemeris, _JEZERO, np.array([days_of(datetime(2021, 2, 7, 12, tzinfo=UTC))])
    )
    assert abs((np.degrees(above.season[0]) + 180.0) % 360.0 - 180.0) < 0.5
    # Moon: in the middle of its near side the Earth leaves the zenith by its librations.
    days = np.linspace(0.0, 8000.0, 500)
    earth = look_up(MOON.ephemeris, (0.0, 0.0), days).earth
    off = np.degrees(np.arccos(earth[:, 2]))
    assert 7.0 < off.max() < 11.0
    assert np.degrees(look_up(MOON.ephemeris, (0.0, 0.0), days).earth_diameter).mean() == (
        pytest.approx(1.9, abs=0.05)
    )
    # Obliquities: Allison & McEwen 2000; 1.54° and librations; Margot et al. 2012.
    found = np.degrees([highest_declination(b.ephemeris) for b in (MARS, MOON, MERCURY)])
    assert found == pytest.approx([25.19, 1.59, 0.034], abs=0.02)


def test_a_latitude_on_a_sphere_is_no_vertical():
    assert np.degrees(planetographic(MARS.ephemeris, np.radians(45.0))) == pytest.approx(
        45.338, abs=1e-3
    )
    assert planetographic(MOON.ephemeris, 0.7) == pytest.approx(0.7)


@pytest.mark.parametrize("body", [MARS, MOON, MERCURY], ids=lambda body: body.name)
def test_season_and_local_time_are_met(body):
    spec = SunSpec(time="2031-03-01", ls_deg=120.0, ltst="16:45:30")
    found = moment_of(spec, body.ephemeris, _JEZERO)
    first = moment_of(SunSpec(time="2031-03-01", ls_deg=120.0), body.ephemeris, _JEZERO)
    assert datetime(2031, 3, 1, tzinfo=UTC) <= first <= found
    above = look_up(body.ephemeris, _JEZERO, np.array([days_of(first), days_of(found)]))
    assert np.degrees(above.season[0]) == pytest.approx(120.0, abs=1e-3)
    assert above.solar_time[1] == pytest.approx(16.75 / 24 + 30 / 86400, abs=2e-5)
    assert above.sun[1, 0] < 0.0, "in the afternoon the Sun stands in the west"


def test_leap_seconds_are_counted():
    """Astropy's figures: 2017-01-01, the first second of UTC, and Apollo 11's landing."""
    assert days_of(datetime(2017, 1, 1, tzinfo=UTC)) * 86400.0 % 86400.0 == pytest.approx(
        43200.0 + 69.184, abs=1e-3
    )
    assert days_of(datetime(1972, 1, 1, tzinfo=UTC)) * 86400.0 % 86400.0 == pytest.approx(
        43200.0 + 42.184, abs=1e-3
    )
    for text in ("1969-07-20T20:17:40Z", "1971-12-31T23:59:59Z", "2049-12-31T00:00:00Z"):
        moment = read_time(text)
        assert day_of(days_of(moment)) == moment


def recipe(**sun) -> tf.Recipe:
    return flat((4.0, 4.0), 0.5, lonlat=(77.45, 18.44), sun=SunSpec(**sun))


@pytest.mark.slow
def test_a_date_lights_a_world():
    world = tf.realise(tf.plan(recipe(time="2021-02-18T20:55:00Z")))
    light = world.lighting
    assert (light.time, light.solar_time[:2]) == ("2021-02-18T20:55:00Z", "15")
    assert light.irradiance == pytest.approx(1361.0 / 1.5713**2, rel=1e-3)
    assert world.sun_diameter == pytest.approx(0.0093 / 1.5713, rel=2e-3)
    assert np.degrees(light.season) == pytest.approx(5.65, abs=0.05)


@pytest.mark.parametrize(
    ("sun", "key", "told"),
    [
        ({"time": "2051-02-18"}, "time", "1950 to the end of 2049"),
        ({"time": "1949-12-31T23:00:00Z"}, "time", "1950"),
        ({"time": "0001-01-01T00:00:00+14:00"}, "time", "1950"),
        ({"time": "18 Feb 2031"}, "time", "ISO 8601"),
        ({"time": "2021-02-19T08:55:00Z"}, "time", "it is night; it rises before 2021-02-19T12"),
        ({"time": "2049-12-31", "ls_deg": 300.0}, "time", "that moment comes at"),
        ({"time": "2030-01-01", "azimuth_deg": 10.0}, "azimuth_deg", "no effect"),
        ({"ltst": "25:00"}, "ltst", "24 hours"),
        ({"ltst": "9h"}, "ltst", "24 hours"),
    ],
)
def test_what_no_date_can_tell_is_refused(sun, key, told):
    with pytest.raises(RecipeError, match=told) as error:
        tf.plan(recipe(**sun))
    assert error.value.key == ("sun", key)


def test_a_site_without_a_place_has_no_date():
    nowhere = tf.FlatDtm(size_m=(4.0, 4.0))
    unplaced = recipe(time="2030-01-01T05:00:00Z").__class__(
        name="nowhere", body="mars", dtm=nowhere,
        terrain=tf.TerrainSpec(spacing_m=0.5), sun=SunSpec(time="2030-01-01"),
    )  # fmt: skip
    with pytest.raises(RecipeError, match="nobody knows where on mars"):
        tf.plan(unplaced)


def test_dates_need_no_quotes(tmp_path):
    text = (
        "name: x\nbody: mars\ndtm: {kind: flat, size_m: [4, 4], lonlat_deg: [0, 0]}\n"
        "terrain: {spacing_m: 0.5}\nsun: {time: 2031-02-18T20:55:00Z, ltst: 10:30}\n"
    )
    (tmp_path / "x.yaml").write_text(text)
    sun = tf.load_recipe(tmp_path / "x.yaml").recipe.sun
    assert (sun.time, sun.ltst) == ("2031-02-18T20:55:00Z", "10:30")
