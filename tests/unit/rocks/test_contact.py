"""Soil at rocks: drifts, tails and moats of the wind, fillets, in height and colour."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.model import Window
from terrain_forge.recipe import recipe_from_json, recipe_json
from terrain_forge.rocks import (
    FilletContact,
    NoContact,
    WindContact,
    bank_reach,
    bank_soil,
    embed,
    rock_margin,
)
from terrain_forge.rocks.scattering.scatter import Scattered
from terrain_forge.validation.checks.rocks import foot_and_top
from tests.helpers import worlds
from tests.helpers.recipes import flat as level_recipe

SITE, LIBRARY = worlds.site(), worlds.library()
SOUTHERLY = WindContact(wind_from_deg=180.0, drift=0.2, tail=4.0, moat=0.1)


def site(contact):
    """The site by hand with finer nodes, and rocks of 2 m at most."""
    recipe = SITE.recipe
    recipe = replace(recipe, rocks=replace(recipe.rocks, contact=contact))
    return SITE.replace(spacing=0.05, recipe_json=recipe_json(recipe))


def flat(place):
    return worlds.shaped(place, lambda *_: 0.25)


def rocks(count, *, diameter=1.0, dynamic=False, first=0, spread=0.0):
    """Rocks in the middle, each with an id of its own, so that each draws its own supply."""
    rows = np.arange(count)
    return Scattered(
        populations=("rocks",),
        id=first + rows,
        population=0 * rows,
        prototype=rows % 3,
        xy=np.column_stack([spread * (rows - 0.5 * (count - 1)), 0.01 * rows]),
        yaw=0.7 * rows,
        buried=np.full(count, 0.3),
        diameter=np.full(count, diameter),
        dynamic=np.full(count, dynamic),
        collides=np.full(count, True),
        unplaced=(0,),
    )


def banked(contact, scattered):
    place = site(contact)
    land = flat(place)
    found = bank_soil(site=place, scattered=scattered, library=LIBRARY, ground=land)
    east, north = place.axes(place.window)
    return found, (found.ground.elevation - land.elevation).astype(float), east, north


def test_the_wind_lays_soil_to_the_lee_and_digs_before_a_rock():
    for number in range(12):
        scattered = rocks(1, first=number)
        _, change, east, north = banked(SOUTHERLY, scattered)
        x, y = scattered.xy[0]
        lee, windward = north > y + 0.6, north < y - 0.6
        assert change[lee].max() > 0.0  # northwards
        assert change[lee][:, np.abs(east - x) < 0.3].min() >= 0.0
        assert change[windward].min() < 0.0
        assert change[windward].max() <= change[lee].max()
        reached = np.hypot(east[None, :] - x, north[:, None] - y)[change != 0.0].max()
        assert 1.0 < reached < bank_reach(site(SOUTHERLY), LIBRARY)
        tail = np.abs(east - x)[np.abs(change[north > y + 1.4]).max(axis=0) > 0.0]
        assert tail.max() < 1.0  # it stays behind the rock, within a wind that turns by 15°


def test_supplies_differ_about_their_mean():
    """Each rock has 0 to twice the stated drift."""
    several = rocks(60, spread=0.39, diameter=0.3)
    _, change, east, _ = banked(replace(SOUTHERLY, moat=0.0), several)
    near = np.abs(east[:, None] - several.xy[:, 0]) < 0.1
    highest = np.array([change[:, one].max() for one in near.T]) / several.diameter
    assert highest.min() < 0.02
    assert 0.04 < highest.mean() < 0.14  # 0.2 of a height of some 0.5
    assert highest.max() < 0.26


def test_a_fillet_is_what_its_rock_has_lost():
    """Its section, by the area that it covers of it, is the wear times the height of the side."""
    many = [banked(FilletContact(exposure_myr=5.0), rocks(1, first=n))[1] for n in range(40)]
    heights = np.array([change.max() for change in many])
    section = heights**2 / (1.5 * 0.466)
    rate = 0.2e-3 * (1.0 / 0.05) ** 0.87
    assert section.mean() == pytest.approx(rate * 5.0 * 0.5, rel=0.35)  # a height of some 0.5
    assert min(change.min() for change in many) == 0.0
    young = banked(FilletContact(exposure_myr=1.0), rocks(1, first=3))[1]
    assert np.all(young <= many[3])
    assert young.max() < 0.6 * many[3].max()
    none = banked(FilletContact(exposure_myr=0.0), rocks(1))[1]
    assert not none.any()


def test_only_static_rocks_that_the_nodes_can_show_have_any():
    for scattered in (rocks(3, dynamic=True), rocks(3, diameter=0.099)):
        found, change, _, _ = banked(SOUTHERLY, scattered)
        assert not change.any()
        assert not found.raised.any()
    place = site(NoContact())
    nothing = bank_soil(site=place, scattered=rocks(1), library=LIBRARY, ground=flat(place))
    assert nothing is None
    assert bank_reach(place, LIBRARY) == 0.0


def test_the_order_of_the_rocks_changes_no_byte():
    several = rocks(9, spread=0.5)
    one = banked(SOUTHERLY, several)[0].ground
    other = banked(SOUTHERLY, several.select(np.arange(9)[::-1]))[0].ground
    assert one == other


@pytest.mark.parametrize("contact", [SOUTHERLY, FilletContact(exposure_myr=60.0)])
def test_rocks_are_as_large_and_as_deep_as_without(contact):
    """On level ground: burial counts from the lowest soil that touches a rock."""
    several = rocks(9, spread=2.4)
    place = site(contact)
    land = flat(place)
    found = bank_soil(site=place, scattered=several, library=LIBRARY, ground=land).ground
    common = {"scattered": several, "library": LIBRARY, "density": (2900.0,)}
    before, after = embed(**common, ground=land), embed(**common, ground=found, bare=land)
    np.testing.assert_array_equal(after.diameter, before.diameter)
    np.testing.assert_array_equal(after.quaternion, before.quaternion)
    np.testing.assert_allclose(after.buried_fraction, before.buried_fraction, atol=0.02)
    for number, prototype in enumerate(LIBRARY.prototypes):
        foot, top = foot_and_top(after.select(after.prototype == number), prototype, found)
        assert foot.max() <= 1e-9
        assert top.min() > 0.1


def recipe(contact, **populations):
    stones = {"name": "rocks", "size_frequency": tf.Golombek(k=0.2), "diameter_m": (0.3, 1.2)}
    some = (tf.PopulationSpec(**stones, **populations),)
    rocks = tf.RocksSpec(library=tf.LibrarySpec(shapes=2), populations=some, contact=contact)
    terrain, horizon = {"layers": (tf.Fractal(),)}, tf.HorizonSpec(reach_m=0)
    more = {"seed": 4, "rocks": rocks, "horizon": horizon, "exports": ()}
    return level_recipe((16, 12), 0.1, terrain=terrain, **more)


def test_tiles_that_share_a_border_have_one_ground():
    """Whichever of them has the rock: tails of 10 heights cross it."""
    place = tf.plan(recipe(WindContact(wind_from_deg=100.0, drift=0.3, tail=10.0)))
    whole = tf.realise(place)
    bare = tf.realise(tf.plan(recipe(NoContact())))
    changed = whole.ground.elevation != bare.ground.elevation
    assert changed[:, 80].any()
    for column, columns in ((0, 80), (80, 80), (77, 3)):
        part = tf.realise(place, Window(column=column, row=0, columns=columns, rows=120))
        own = slice(column, column + columns + 1)
        assert np.array_equal(part.ground.elevation, whole.ground.elevation[:, own])
        assert np.array_equal(part.appearance.ground_rgb, whole.appearance.ground_rgb[:, own])
        assert np.isin(part.field.id, whole.field.id).all()
        same = whole.field.select(np.isin(whole.field.id, part.field.id))
        assert part.field == same
    margin = rock_margin(
        site=place, populations=place.recipe.rocks.populations, library=bare.library
    )
    assert margin > 0.0


def test_dust_brightens_what_it_lies_on_and_nothing_else():
    dusty, own = (
        tf.realise(tf.plan(recipe(WindContact(soil=soil)))) for soil in ("dust", "regolith")
    )
    bare = tf.realise(tf.plan(recipe(NoContact())))
    assert np.array_equal(own.appearance.ground_rgb, bare.appearance.ground_rgb)
    assert np.array_equal(own.ground.elevation, dusty.ground.elevation)
    covered = dusty.appearance.drift
    assert covered.max() == 255
    brighter = dusty.appearance.ground_rgb.astype(int) - bare.appearance.ground_rgb
    assert brighter[covered == 255].min() > 0
    assert brighter[covered == 0].max() <= 1  # less than 20 µm of dust
    assert brighter.min() == 0
    pebbles = dusty.appearance.grain[..., 0]
    assert pebbles[covered == 255].max() < 0.2 * pebbles[covered == 0].min()


def test_soil_evens_what_is_rough_beneath_it():
    """A spike under a fillet: hidden by as much soil as it is high, half gone."""
    place, scattered = site(FilletContact(exposure_myr=60.0)), rocks(1)
    level = flat(place)
    found, raised = bank_soil(site=place, scattered=scattered, library=LIBRARY, ground=level)
    j, i = np.unravel_index(raised.argmax(), raised.shape)
    spiked = level.elevation.copy()
    spiked[j, i] += 0.02
    over = bank_soil(
        site=place, scattered=scattered, library=LIBRARY, ground=level.replace(elevation=spiked)
    ).ground
    above = float(over.elevation[j, i] - found.elevation[j, i])
    soil, spike = float(raised[j, i]), 0.02 * 48 / 49
    assert above == pytest.approx(0.02 - spike * soil / (soil + spike), abs=1e-6)


def test_the_mean_height_hardly_changes():
    """Below the noise of any DTM: millimetres over a pixel of 2 m."""
    soiled, bare = (tf.realise(tf.plan(recipe(one))) for one in (None, NoContact()))
    added = (soiled.ground.elevation - bare.ground.elevation).astype(float)[:120, :160]
    pixels = added.reshape(6, 20, 8, 20).mean(axis=(1, 3))
    assert added.max() > 0.02
    assert np.abs(pixels).max() < 0.01


def test_bodies_have_what_is_usual_there():
    assert "  soil at them drifts of dust, wind from 29°" in tf.check(recipe(None))
    windy = replace(
        recipe(None),
        terrain=tf.TerrainSpec(
            spacing_m=0.1, layers=(tf.Ripples(wavelength_m=1.0, wind_from_deg=120.0),)
        ),
    )
    assert "  soil at them drifts of dust, wind from 120°" in tf.check(windy)
    moon = tf.plan(replace(recipe(None), body="moon"))
    soiled = tf.realise(moon)
    bare = tf.realise(tf.plan(replace(recipe(NoContact()), body="moon")))
    change = soiled.ground.elevation - bare.ground.elevation
    assert change.max() > 0.0
    assert change.min() == 0.0  # fillets alone


@pytest.mark.parametrize(
    ("body", "contact", "told"),
    [
        ("moon", WindContact(), "moon has no wind; allowed: fillets, none"),
        ("mars", FilletContact(), "mars has air .* allowed: wind, none"),
    ],
)
def test_what_a_body_cannot_do_is_refused(body, contact, told):
    with pytest.raises(tf.RecipeError, match=told) as refused:
        tf.plan(replace(recipe(contact), body=body))
    assert refused.value.key == ("rocks", "contact", "kind")


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"kind": "wind", "drift": 0.7}, "drift"),
        ({"kind": "wind", "tail": -1}, "tail"),
        ({"kind": "wind", "moat": "nan"}, "moat"),
        ({"kind": "wind", "wind_from_deg": 400}, "wind_from_deg"),
        ({"kind": "fillets", "exposure_myr": -5}, "exposure_myr"),
        ({"kind": "wind", "exposure_myr": 5}, "exposure_myr"),
        ({"kind": "gale"}, "wind"),
    ],
)
def test_bad_figures_name_their_place(wrong, told):
    plain = json.loads(recipe_json(recipe(None)))
    plain["rocks"]["contact"] = wrong
    with pytest.raises(tf.RecipeError, match=told):
        recipe_from_json(json.dumps(plain))
