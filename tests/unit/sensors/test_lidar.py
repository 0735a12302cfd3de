"""Lidars against closed forms: where points lie, when they were measured, what their noise is."""

from __future__ import annotations

import io
import json
from functools import cache

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from scipy import stats

from terrain_forge.base import RecipeError
from terrain_forge.model import LidarSensor, rotations
from terrain_forge.sensors import (
    Curve,
    Motion,
    Scenery,
    Setting,
    deskewed_points,
    instrument_kinds,
    point_classes,
    take_sweep,
)
from terrain_forge.sensors.labels import CLASSES
from tests.helpers import worlds
from tests.helpers.rovers import skid4

_GROUND, _BEYOND, _ROVER = -1, -3, -4
_EXACT = {"noise_m": 0.0, "quantum_m": 0.0, "range_at_tenth_m": 0.0}


@cache
def _motion():
    """Three turns in four seconds on a tight circle, rolling and pitching."""
    time = np.arange(0.0, 4.01, 0.02)
    angle = 4.5 * time
    east, north = 2.0 * np.cos(angle), 2.0 * np.sin(angle)
    up = worlds.ground().height_at(east, north)
    tilt = np.stack([0.1 * np.sin(5.0 * time), 0.1 * np.cos(4.0 * time)], axis=-1)
    samples = np.column_stack([east, north, up, tilt, angle + 0.5 * np.pi])
    return Motion(path="arc", source="path", base=Curve(begin=0.0, step=0.02, samples=samples))


def _setting(world):
    world = worlds.with_horizon(world)
    scenery = Scenery(world, _motion())
    return Setting(world=world, motion=_motion(), scenery=scenery, gravity=3.7, seed=1)


@pytest.fixture(scope="module")
def hill():
    """The world by hand, with a rover in it."""
    setting = _setting(worlds.world(rover=skid4()))
    yield setting
    setting.scenery.close()


@pytest.fixture(scope="module")
def plain():
    """A plane at height 0 without rocks."""
    world = worlds.world(rocks=0, rover=skid4())
    flat = np.zeros_like(world.ground.elevation)
    setting = _setting(world.replace(ground=world.ground.replace(elevation=flat)))
    yield setting
    setting.scenery.close()


def _lidar(preset="", **fields):
    given = {"name": "lidar", "position_m": (0.1, 0.05, 0.9), "rpy_deg": (2.0, 5.0, 30.0)}
    return TypeAdapter(LidarSensor).validate_python(given | {"preset": preset} | fields)


def _azimuth(points):
    return np.degrees(np.arctan2(points[:, 1], points[:, 0]))


def _elevation(points):
    return np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))


def _off(found, wanted):
    """The largest difference of two arrays."""
    return np.abs(np.asarray(found, np.float64) - wanted).max()


def _apart(one, other):
    """Angles between angles [degrees]."""
    return np.abs((one - other + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("preset", LidarSensor.PRESETS)
def test_points_lie_on_surfaces_at_their_own_times(hill, preset):
    lidar, world = _lidar(preset, **_EXACT), hill.world
    sweep = take_sweep(hill, lidar, 7)
    ground = sweep.instance == _GROUND
    assert {_GROUND, _BEYOND} < set(sweep.instance.tolist())
    points = deskewed_points(hill, lidar, sweep)
    off = points[ground, 2] - world.ground.height_at(*points[ground, :2].T)
    assert np.abs(off).max() < 1e-4
    if not lidar.snapshot:  # the pose of the sweep fails
        still = sweep.replace(time=0.0 * sweep.time)
        skewed = deskewed_points(hill, lidar, still)
        inside = ground & world.ground.covers(*skewed[:, :2].T)
        off = skewed[inside, 2] - world.ground.height_at(*skewed[inside, :2].T)
        assert np.quantile(np.abs(off), 0.9) > 0.05
    turns = rotations(world.field)
    for rock in np.unique(sweep.instance[sweep.instance >= 0]):
        mesh = world.library.prototypes[world.field.prototype[rock]].meshes[0]
        own = (points[sweep.instance == rock] - world.field.position[rock]) @ turns[rock]
        corners = mesh.vertices[mesh.faces] * world.field.scale[rock]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        above = own @ normal.T - (corners[:, 0] * normal).sum(axis=1)
        assert np.abs(above.max(axis=1)).max() < 1e-4  # the shapes are convex


def test_a_vlp_16_fires_as_its_manual_says(hill):
    lidar = _lidar("vlp-16", **_EXACT)
    sweep = take_sweep(hill, lidar, 5)
    lasers = np.array([-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15])
    assert _off(_elevation(sweep.points), np.sort(lasers)[sweep.ring]) < 1e-4
    since = sweep.begin * 1e-9 + sweep.time
    assert sweep.begin == 500_000_000
    laser = np.argsort(np.argsort(lasers))  # ring of each laser
    order = np.argsort(laser)[sweep.ring]
    assert _off(sweep.time, 55.296e-6 * sweep.column + 2.304e-6 * order) < 1e-8
    assert _apart(_azimuth(sweep.points), 180.0 - 3600.0 * since).max() < 1e-3
    assert np.all(np.diff(sweep.time) >= 0.0)
    assert _off(np.linalg.norm(sweep.points, axis=1), sweep.distance) < 2e-5
    assert sweep.column.max() == 1807  # 100 ms are 1808.4 firings


def test_an_hdl_64e_has_two_blocks_that_fire_at_once(hill):
    sweep = take_sweep(hill, _lidar("hdl-64e", **_EXACT), 5)
    elevations = np.concatenate([-24 - 1 / 3 + np.arange(32) / 2, -8 - 1 / 3 + np.arange(32) / 3])
    assert _off(_elevation(sweep.points), elevations[sweep.ring]) < 1e-3
    delay = np.zeros(64)
    delay[sweep.ring] = sweep.time - 48e-6 * sweep.column
    both = delay[32:] > 0.0
    assert _off(delay[:32][both], delay[32:][both]) < 1e-8
    assert delay.max() == pytest.approx(45.66e-6, abs=1e-8)


def test_an_os1_has_azimuth_offsets_and_beams_that_begin_beside_the_axis(hill):
    lidar = _lidar("os1-64", **_EXACT)
    sweep = take_sweep(hill, lidar, 5)
    column = 180.0 - 360.0 * sweep.column / 1024
    origin = 0.012163 * np.stack(
        [np.cos(np.radians(column)), np.sin(np.radians(column)), 0.0 * column], axis=-1
    )
    beam = sweep.points - origin
    ring = sweep.ring.astype(int)
    assert _off(_elevation(beam), np.array(lidar.elevations_deg)[ring]) < 1e-3
    offset = np.array(lidar.azimuth_offsets_deg)[ring]
    assert _apart(_azimuth(beam), column - offset).max() < 1e-3
    assert _off(np.linalg.norm(beam, axis=1) + 0.012163, sweep.distance) < 2e-5


def test_the_papers_lidar_is_measured_at_once(hill):
    sweep = take_sweep(hill, _lidar("paper-64", **_EXACT), 2)
    assert not sweep.time.any()
    assert sweep.begin == 200_000_000
    even = np.linspace(-16.0, 16.0, 64)
    assert _off(_elevation(sweep.points), even[sweep.ring]) < 1e-4
    assert _apart(_azimuth(sweep.points), 180.0 - 0.2 * sweep.column).max() < 1e-3
    assert sweep.distance.min() > 1.5


def test_a_rosette_never_repeats_itself(hill):
    lidar = _lidar("livox-avia", **_EXACT)
    one, other = (take_sweep(hill, lidar, number) for number in (3, 4))
    for sweep in (one, other):
        since = sweep.begin * 1e-9 + sweep.time.astype(float)
        first, second = (2.0 * np.pi * rpm / 60.0 * since for rpm in (7294.0, -4664.0))
        left = np.radians(17.6) * (np.sin(first) + np.sin(second))
        up = np.radians(17.6) * (np.cos(first) + np.cos(second)) + lidar.elevations[sweep.ring]
        away = np.hypot(left, up)
        wanted = np.stack([np.cos(away), *(np.sin(away) / away * [left, up])], axis=-1)
        assert _off(sweep.points / sweep.distance[:, None], wanted) < 1e-5
    assert not np.array_equal(one.points[:100], other.points[:100])


def test_noise_is_normal_and_new_for_each_point_and_sweep(hill):
    exact, noisy = _lidar("paper-64", noise_m=0.0), _lidar("paper-64", noise_m=0.02)
    residuals = []
    for number in (1, 2):
        true, told = take_sweep(hill, exact, number), take_sweep(hill, noisy, number)
        rows, others = (one.column.astype(int) * 64 + one.ring for one in (true, told))
        _, at, back = np.intersect1d(rows, others, return_indices=True)
        residuals.append(told.distance[back].astype(float) - true.distance[at])
        towards = true.points[at] / true.distance[at, None]
        assert _off(told.points[back], towards * told.distance[back, None]) < 2e-5
    for found in residuals:
        assert stats.kstest(found / 0.02, "norm").pvalue > 0.001
        assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 3.3 / np.sqrt(len(found))
    count = min(map(len, residuals))
    assert abs(np.corrcoef(*(r[:count] for r in residuals))[0, 1]) < 3.3 / np.sqrt(count)


def test_ranges_come_in_steps(hill):
    sweep = take_sweep(hill, _lidar("vlp-16"), 1)
    steps = sweep.distance.astype(float) / 0.002
    assert np.abs(steps - np.round(steps)).max() < 0.01


def test_power_falls_with_range_and_incidence(plain):
    lidar = _lidar("paper-64", noise_m=0.0, intensity="power")
    sweep = take_sweep(plain, lidar, 3)
    points = deskewed_points(plain, lidar, sweep)
    mast = deskewed_points(plain, lidar, sweep.replace(points=0.0 * sweep.points))
    ground = sweep.instance == _GROUND
    assert ground.sum() > 10_000
    albedo = ((166 / 255 + 0.055) / 1.055) ** 2.4
    level = 100.0 * albedo * (mast - points)[:, 2] / sweep.distance
    power = level * (10.0 / sweep.distance) ** 2
    assert _off((sweep.intensity / power)[ground], 1.0) < 1e-3
    other = take_sweep(plain, lidar.replace(intensity="reflectivity"), 3)
    assert _off((other.intensity / level)[ground], 1.0) < 1e-3


def test_weak_returns_are_lost(plain):
    lidar = _lidar("paper-64", noise_m=0.0, intensity="power")
    every = take_sweep(plain, lidar, 3)
    some = take_sweep(plain, lidar.replace(range_at_tenth_m=9.0), 3)
    limit = 100.0 * 0.1 * (10.0 / 9.0) ** 2
    assert (some.intensity >= limit / 1.2001).all()
    assert (some.intensity >= 1.2501 * limit).sum() == (every.intensity >= 1.2501 * limit).sum()
    near = np.abs(every.intensity / limit - 1.0) < 0.1
    kept = np.abs(some.intensity / limit - 1.0) < 0.1
    assert near.sum() > 500
    assert kept.sum() / near.sum() == pytest.approx(0.5, abs=0.1)
    lost = take_sweep(plain, lidar.replace(dropout=0.25), 3)
    assert len(lost.points) / len(every.points) == pytest.approx(0.75, abs=0.01)


def test_the_sun_blinds(plain):
    lidar = _lidar("paper-64", noise_m=0.0, rpy_deg=(0.0, -30.0, 0.0))
    every = take_sweep(plain, lidar, 3)
    blind = take_sweep(plain, lidar.replace(sun_blinding_deg=60.0), 3)

    def cosines(sweep):
        mast = deskewed_points(plain, lidar, sweep.replace(points=0.0 * sweep.points))
        towards = deskewed_points(plain, lidar, sweep) - mast
        sun = plain.world.lighting.towards_sun
        return towards @ sun / np.linalg.norm(towards, axis=1)

    assert (cosines(blind) < 0.5).all()
    assert 0 < (cosines(every) < 0.5).sum() == len(blind.points) < len(every.points)


def test_a_wide_beam_mixes_what_it_spans_and_nothing_else(hill):
    wide = {"channels": 12, "vertical_fov_deg": 22.0, "horizontal_samples": 180, "snapshot": True}
    thin = _lidar(noise_m=0.0, **wide)
    line = take_sweep(hill, thin, 2)
    fans = {r: take_sweep(hill, thin.replace(divergence_mrad=20.0, returns=r), 2)
            for r in ("first", "strongest", "last")}  # fmt: skip
    # The same beams, each by many thin ones within its cone.
    lows, highs = [], []
    for turn in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        for part in (0.0, 7.2e-3, 1e-2):
            up, left = np.degrees(part * np.sin(turn)), np.degrees(part * np.cos(turn))
            table = np.degrees(thin.elevations) + up
            side = -left / np.cos(np.radians(table))
            near = thin.replace(
                channels=16,
                vertical_fov_deg=30.0,
                elevations_deg=tuple(table.tolist()),
                azimuth_offsets_deg=tuple(side.tolist()),
            )
            sweep, image = take_sweep(hill, near, 2), np.full((180, 12), np.nan)
            image[sweep.column, sweep.ring] = sweep.distance
            lows.append(np.where(np.isnan(image), np.inf, image))
            highs.append(np.where(np.isnan(image), -np.inf, image))
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    images = {}
    for name, sweep in fans.items():
        images[name] = np.full((180, 12), np.nan)
        images[name][sweep.column, sweep.ring] = sweep.distance
        at = sweep.column, sweep.ring
        slack = 0.01 + 0.03 * (high[at] - low[at])
        assert np.mean(sweep.distance > low[at] - slack) > 0.995
        assert np.mean(sweep.distance < high[at] + slack) > 0.995
    both = ~np.isnan(images["first"] + images["last"])
    assert (images["first"] <= images["strongest"] + 1e-5)[both].all()
    assert (images["strongest"] <= images["last"] + 1e-5)[both].all()
    assert (images["last"] - images["first"])[both].max() > 0.5
    central = np.full((180, 12), np.nan)
    central[line.column, line.ring] = line.distance
    off = np.abs(images["strongest"] - central)
    calm = high - low < 0.05
    assert calm.sum() > 200
    assert np.nanmax(off[calm]) < 0.05
    assert np.nanmax(off) > 0.1


def test_any_sweep_alone_is_the_same_in_bytes(hill, use_threads):
    lidar = _lidar("os1-64", dropout=0.1, horizontal_samples=128, divergence_mrad=2.0)
    make = instrument_kinds()["lidar"]
    whole = [make(lidar, hill).measure(number)["data"] for number in (3, 4, 5)]
    fresh = Setting(world=hill.world, motion=hill.motion, scenery=hill.scenery, gravity=3.7, seed=1)
    use_threads(3)
    assert make(lidar, fresh).measure(5)["data"] == whole[2]
    assert make(lidar, fresh).measure(4)["data"] == whole[1]
    other = make(lidar.replace(name="twin"), hill).measure(3)["data"]
    assert other != whole[0]


def test_it_sees_the_rover_or_leaves_it_out(hill):
    lidar = _lidar(
        position_m=(0.0, 0.0, 1.6), rpy_deg=(0.0, 90.0, 0.0), range_min_m=0.1, noise_m=0.0,
        channels=48, vertical_fov_deg=120.0, horizontal_samples=256,
    )  # fmt: skip
    sweep = take_sweep(hill, lidar, 6)
    own = sweep.instance == _ROVER
    assert own.sum() > 100
    state = hill.motion.base.at(1e-9 * sweep.begin + sweep.time.astype(float))
    points = deskewed_points(hill, lidar, sweep) - state.position
    points = (np.swapaxes(state.rotation, 1, 2) * points[:, None, :]).sum(axis=-1)
    bodies = hill.scenery.rover_at(0.65).bodies
    low, high = bodies.low, bodies.high
    assert (points[own] > np.array(low) - 1e-3).all()
    assert (points[own] < np.array(high) + 1e-3).all()
    top = own & (np.hypot(points[:, 0] + 0.1, points[:, 1]) < 0.1)
    assert _off(points[top, 2], 0.14 + 0.22) < 1e-4  # the body's upper side
    masked = take_sweep(hill, lidar.replace(sees_rover=False), 6)
    assert np.array_equal(masked.points, sweep.points[~own])


def test_points_have_the_classes_of_pictures(hill):
    lidar = _lidar("vlp-16")
    sweep = take_sweep(hill, lidar, 9)
    classes = point_classes(hill, lidar, sweep)
    assert (CLASSES.index("rock") == classes)[sweep.instance >= 0].all()
    assert (CLASSES.index("beyond") == classes)[sweep.instance == _BEYOND].all()
    ground = {CLASSES[number] for number in np.unique(classes[sweep.instance == _GROUND])}
    assert "ground" in ground <= {"ground", "track"}


def test_its_files_are_arrays_of_points(hill):
    lidar = _lidar("vlp-16")
    instrument = instrument_kinds()["lidar"](lidar, hill)
    assert instrument.times[:2].tolist() == [0, 100_000_000]
    assert instrument.times[-1] * 1e-9 + 0.1 <= hill.motion.end + 1e-9
    assert len(instrument.times) == 40
    points = np.load(io.BytesIO(instrument.measure(2)["data"]))
    sweep = take_sweep(hill, lidar, 2)
    assert points.dtype.names == ("x", "y", "z", "intensity", "ring", "time", "instance")
    for axis, name in enumerate("xyz"):
        assert np.array_equal(points[name], sweep.points[:, axis])
    for name in ("intensity", "ring", "time", "instance"):
        assert np.array_equal(points[name], getattr(sweep, name))
    told = json.loads(json.dumps(instrument.calibration()))
    assert told["rings"] == len(told["elevations_deg"]) == len(told["firing_times_s"]) == 16
    assert [stream.name for stream in instrument.streams()] == ["data"]
    told = instrument.calibration()
    assert told["sweep_s"] == pytest.approx(1.0 / instrument.sensor.rate_hz)


def test_a_motion_shorter_than_a_sweep_is_refused(hill):
    short = _motion().replace(base=_motion().base.replace(samples=_motion().base.samples[:4]))
    setting = Setting(world=hill.world, motion=short, scenery=hill.scenery, gravity=3.7, seed=1)
    with pytest.raises(RecipeError, match=r"lasts 0\.1 s, the motion along 'arc' 0\.06 s"):
        instrument_kinds()["lidar"](_lidar("vlp-16"), setting).check()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"elevations_deg": [0, 1], "azimuth_offsets_deg": [0]}, "azimuth_offsets_deg has 1 num"),
        ({"firing_times_us": [0, 1]}, "firing_times_us has 2 numbers, not 16"),
        ({"elevations_deg": [0, 1], "firing_times_us": [0, 60]}, "before the next column, 55.5556"),
        ({"range_min_m": 100}, "range_min_m must be below range_max_m"),
        ({"firing_period_us": 2e5}, "firing_period_us must be"),
        ({"channels": 1000, "horizontal_samples": 100_000}, "more than 4000000 points"),
        ({"prism_deviations_deg": [1, 1]}, "no effect: there is no prism_rpm"),
        ({"preset": "vlp-61"}, r"'vlp-61' \(did you mean 'vlp-16'\?\), there are: vlp-16, hdl"),
        ({"elevations_deg": [91]}, "less than or equal to 90"),
    ],
)
def test_what_cannot_be_is_refused(fields, message):
    with pytest.raises((ValidationError, RecipeError), match=message):
        _lidar(**{"preset": ""} | fields)


def test_formats_hear_what_they_cannot_say():
    lost = _lidar("os1-64").unsaid("sdf")
    assert {"unevenly spread beams", "azimuth offsets", "firing times"} <= set(lost)
    assert _lidar("paper-64").unsaid("sdf") == ()
    kind, elements = _lidar("livox-avia").sdf(classic=False, far=100.0)
    assert kind == "gpu_lidar"
    angles = elements["lidar"]["scan"]["vertical"]
    assert np.degrees(angles["max_angle"] - angles["min_angle"]) == pytest.approx(77.2)
