"""Shapes of craters: fresh ones, wear, windows of them, and those that overlap."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.model import MARS, MERCURY, MOON
from terrain_forge.terrain import (
    BodyProduction,
    fresh_shapes,
    shape_ground,
)
from terrain_forge.terrain.cratering import degradation
from terrain_forge.terrain.cratering.degradation import ejecta_thickness, worn_shapes
from terrain_forge.terrain.cratering.population import Wear
from tests.helpers.craters import everywhere, fresh_profile, layer, listed, moon, near


def test_fresh_depths():
    """Pike's 5 km crater; the classes of Stopar et al. in their middles; the ends on Mars."""
    diameters = np.array([5000.0, 283.0, 141.0, 63.0])
    shape = fresh_shapes(diameters, body=MOON)
    assert shape.depth[0] == pytest.approx(995.90, rel=1e-5)
    assert shape.rim[0] == pytest.approx(184.10, rel=1e-4)
    assert shape.depth[1:] / diameters[1:] == pytest.approx([0.17, 0.15, 0.13], abs=0.005)
    ends = np.array([1.0, 5000.0])
    assert fresh_shapes(ends, body=MARS).depth / ends == pytest.approx([0.15, 0.2], abs=0.001)


@pytest.mark.parametrize("body", [MOON, MARS, MERCURY], ids=lambda body: body.name)
def test_depth_and_wear_have_no_steps(body):
    """Over a diameter that is one in a thousand larger they change by less than six in 1000."""
    diameters = 1.001 ** np.arange(np.log(0.5) / np.log(1.001), np.log(5000.0) / np.log(1.001))
    ratio = fresh_shapes(diameters, body=body).depth / diameters
    assert np.all(np.diff(ratio) > 0.0)
    assert np.abs(np.diff(np.log(ratio))).max() < 0.0006
    for one in body.craters.productions:
        for equilibrium in ("trask", "hartmann"):
            wear = Wear(body=body, kind=one.kind, equilibrium=equilibrium)
            assert np.abs(np.diff(np.log(wear.diffusivity(diameters)))).max() < 0.006


LUNAR_SHARES = 0.50, 0.30, 0.17, 0.03
"""Of lunar craters below a kilometre, by depth over diameter: below 0.07, 0.10 and 0.15, and above
(SLS-SPEC-159, table 3.4.1.2-2, after Basilevsky 1976)."""


def shares(place, spec, low, high):
    """Shares of the classes among craters of some diameters, over three seeds."""
    depths = []
    for seed in range(3):
        craters = everywhere(spec, place.replace(seed=seed))
        craters = craters.select((craters.diameter >= low) & (craters.diameter < high))
        depths.append(craters.depth / craters.diameter)
    depths = np.concatenate(depths)
    assert len(depths) > 300
    return np.histogram(depths, [0.0, 0.07, 0.10, 0.15, 1.0])[0] / len(depths)


@pytest.mark.parametrize(("low", "high"), [(2, 10), (10, 40), (40, 100)])
@pytest.mark.parametrize("age", [1.5, 3.3, 3.8])
def test_shares_of_depths_at_equilibrium(low, high, age):
    """Within 0.1 of the table in each class."""
    place = moon((25.0 * high, 25.0 * high), spacing=low / 4.0)
    spec = layer(
        production=BodyProduction(kind="neukum", age_ga=age), diameter_m=(float(low), float(high))
    )
    assert np.abs(shares(place, spec, low, high) - LUNAR_SHARES).max() < 0.1


@pytest.mark.parametrize("kind", ["ivanov", "hartmann_daubar"])
@pytest.mark.parametrize(("low", "high"), [(10, 40), (40, 100), (100, 200)])
def test_old_craters_of_mars_are_shallow(kind, low, high):
    """After 3·10⁹ years few are deeper than 0.15, and the mix is the Moon's within 0.15."""
    place = moon((40.0 * high, 40.0 * high), spacing=low / 4.0).replace(body=MARS)
    spec = layer(
        production=BodyProduction(kind=kind, age_ga=3.0), diameter_m=(float(low), float(high))
    )
    found = shares(place, spec, low, high)
    assert found[3] < 0.12
    assert np.abs(found - LUNAR_SHARES).max() < 0.15


def test_craters_of_a_young_surface_are_deep():
    place = moon((2000.0, 2000.0), spacing=4.0)
    spec = layer(production=BodyProduction(kind="neukum", age_ga=0.1), diameter_m=(20.0, 400.0))
    craters = everywhere(spec, place)
    young = craters.select(craters.diameter > 30.0)
    assert len(young) > 50
    assert np.all(young.depth > 0.7 * young.fresh_depth)


def test_ejecta_never_exceed_half_the_rim():
    assert ejecta_thickness(np.array([50.0])) == pytest.approx(2.53143, rel=1e-5)
    diameters = np.geomspace(0.5, 10_000, 200)
    shape = fresh_shapes(diameters, body=MOON)
    assert np.all(shape.ejecta <= 0.5 * shape.rim * (1 + 1e-12))
    large = diameters > 500.0
    np.testing.assert_allclose(shape.ejecta[large], ejecta_thickness(0.5 * diameters[large]))
    assert not fresh_shapes(diameters, body=MOON, ejecta=False).ejecta.any()


def test_profile_of_fassett_and_thomson():
    heights = degradation.fassett_thomson(np.array([0.0, 0.5, 1.2, 1.5, 2.0]))
    assert heights == pytest.approx([-0.181, -0.099201, 0.016375, 0.0, 0.0], abs=1e-6)
    x = np.linspace(0.0, 3.0, 3001)
    own = fresh_profile(x, depth=degradation.FT_DEPTH, rim=degradation.FT_RIM, ejecta=0.0)
    assert np.abs(own - degradation.fassett_thomson(x)).max() < 2e-5
    assert np.ptp(own) == pytest.approx(0.21783, abs=1e-5)


def test_blanket_falls_with_the_cube():
    """McGetchin: R = 50 m has 2.53 m at the rim, an eighth of it at 2 R; the rest is uplift."""
    thickness = float(ejecta_thickness(np.array([50.0]))[0])
    x = np.array([1.0, 1.6, 2.0, 2.7, 4.0])
    blanket = fresh_profile(x, depth=15.0, rim=6.0, ejecta=thickness)
    assert blanket[1:3] == pytest.approx([thickness / 1.6**3, 0.316429], rel=1e-5)
    assert blanket[3:] == pytest.approx([0.0, 0.0], abs=1e-12)
    crest = fresh_profile(np.array([degradation.CREST]), depth=15.0, rim=6.0, ejecta=thickness)
    assert crest[0] == pytest.approx(6.0)


def worn(heights, step, tau):
    """Radial heat equation by explicit differences: ∂z/∂s = z'' + z'/x, s = 4τ, x in radii."""
    x = (np.arange(len(heights)) + 0.5) * step
    outer, inner = (x + 0.5 * step) / x, (x - 0.5 * step) / x
    steps = int(np.ceil(4.0 * tau / (0.2 * step**2)))
    rate = 4.0 * tau / steps / step**2
    z = heights.copy()
    for _ in range(steps):
        up = np.append(z[1:], z[-1]) - z
        down = z - np.append(z[0], z[:-1])
        z += rate * (outer * up - inner * down)
    return x, z


@pytest.mark.parametrize("tau", [0.0005, 0.01, 0.1])
def test_wear_is_diffusion(tau):
    """Against finite differences, for the whole profile with its ejecta."""
    step = 0.02
    x = (np.arange(400) + 0.5) * step
    place, spec = listed([(0.0, 0.0, 100.0, 1.0)], diffusivity_m2_per_myr=tau * 10.0)
    craters = everywhere(spec, place)
    assert craters.wear == pytest.approx(tau)
    fresh = fresh_profile(
        x,
        depth=craters.fresh_depth[0],
        rim=craters.fresh_rim[0],
        ejecta=craters.fresh_ejecta[0],
    )
    _, wanted = worn(fresh, step, tau)
    found = craters.profile(0, 50.0 * x)
    assert np.abs(found - wanted).max() < 0.005 * craters.fresh_depth[0]
    assert craters.depth[0] == pytest.approx(np.ptp(wanted), abs=0.005 * craters.fresh_depth[0])


def fassett_and_thomson(craters):
    """The same craters with the very profile of the paper: its rim is lower than Pike's."""
    diameter = craters.diameter
    return craters.replace(
        fresh_depth=degradation.FT_DEPTH * diameter,
        fresh_rim=degradation.FT_RIM * diameter,
        fresh_ejecta=0.0 * diameter,
    )


@pytest.mark.parametrize(
    ("diameter", "left"), [(1000.0, 0.525), (300.0, 0.060)], ids=["52 %", "about 7 %"]
)
def test_wear_of_the_last_three_billion_years(diameter, left):
    """Fassett & Thomson 2014: 5.5 m²/10⁶ years over 3·10⁹ years."""
    place, spec = listed(
        [(0.0, 0.0, diameter, 3.0)],
        ejecta=False,
        depth_to_diameter=0.21782,
        diffusivity_m2_per_myr=5.5,
    )
    craters = everywhere(spec, place)
    assert craters.depth[0] / craters.fresh_depth[0] == pytest.approx(left, abs=0.012)
    pure = fassett_and_thomson(craters)
    assert pure.depth[0] / pure.fresh_depth[0] == pytest.approx(left, abs=0.002)


def test_wear_table_against_known_ratios():
    known = {0.001: 0.946, 0.005: 0.799, 0.01: 0.658, 0.05: 0.227, 0.1: 0.113, 0.1833: 0.0597}
    rows = [(0.0, 0.0, 50.0, 1.0)]
    for tau, ratio in known.items():
        place, spec = listed(rows, diffusivity_m2_per_myr=2.5 * tau)
        craters = fassett_and_thomson(everywhere(spec, place))
        assert craters.depth[0] / craters.fresh_depth[0] == pytest.approx(ratio, abs=0.001)


def test_wear_is_even_in_space():
    """No step where a crater ends, and the old reach farther than the fresh."""
    values, reaches = worn_shapes()
    for row, reach in enumerate(reaches):
        beyond = int(np.ceil(reach / 0.01))
        assert np.abs(values[row, beyond:]).max(initial=0.0) < 1e-12
    assert np.all(np.diff(reaches) >= 0.0)


def test_wear_holds_equilibrium_and_is_measured_at_a_kilometre():
    """A crater has reached 0.046 of its diameter when as many of its size have come as can be."""
    wear = Wear(body=MOON, kind="neukum", equilibrium="trask")
    diameters = np.array([5.0, 20.0, 100.0])
    at = wear.lifetime(diameters) * 1000.0 * wear.diffusivity(diameters) / diameters**2
    fresh = fresh_shapes(diameters, body=MOON)
    place, spec = listed([(0.0, 0.0, diameter, 0.0) for diameter in diameters])
    craters = everywhere(spec, place)
    craters = craters.select(np.argsort(craters.diameter)).replace(wear=at)
    np.testing.assert_array_equal(craters.fresh_depth, fresh.depth)
    assert craters.depth / diameters == pytest.approx(0.046, abs=0.0015)
    assert wear.diffusivity(np.array([1e3, 5e3])) == pytest.approx([5.5, 5.5])
    assert 0.1 < wear.diffusivity(np.array([100.0]))[0] < 0.4


@pytest.mark.parametrize("age", [0.0, 0.05, 2.0])
def test_surface_of_one_crater_is_its_profile(age):
    place, spec = listed([(3.17, -8.41, 40.0, age)])
    ground = shape_ground(site=place, window=place.window, layers=(spec,))
    east, north = place.axes(place.window)
    x = np.hypot(east[None, :] - 3.17, north[:, None] + 8.41) / 20.0
    shape = fresh_shapes(np.array([40.0]), body=MOON)
    depth, rim, ejecta = float(shape.depth[0]), float(shape.rim[0]), float(shape.ejecta[0])
    tau = float(everywhere(spec, place).wear[0])
    radii, wanted = (
        worn(
            fresh_profile((np.arange(400) + 0.5) * 0.02, depth=depth, rim=rim, ejecta=ejecta),
            *(0.02, tau),
        )
        if age
        else (x, None)
    )
    if wanted is None:
        expected = fresh_profile(x, depth=depth, rim=rim, ejecta=ejecta)
    else:
        expected = np.interp(x, radii, wanted)
    assert np.abs(ground.elevation - expected).max() < 0.01 * depth


def heights(*rows, **changes):
    """Ground under listed craters."""
    place, spec = listed(rows, diffusivity_m2_per_myr=0.0, **changes)
    return shape_ground(site=place, window=place.window, layers=(spec,)).elevation.astype(float)


@pytest.mark.parametrize(
    "craters",
    [((-50, 0, 20, 0.0), (50, 10, 30, 1.0)), ((0, 0, 80, 2.0), (5, 3, 6, 0.1))],
    ids=["apart", "a small young one on the floor of a large old one"],
)
def test_craters_that_add_up(craters):
    alone = sum(heights(crater) for crater in craters)
    np.testing.assert_allclose(heights(*craters), alone, atol=1e-6)


def test_a_large_young_crater_erases_a_small_old_one():
    young = heights((0, 0, 80, 0.1))
    both = heights((0, 0, 80, 0.1), (20, 10, 12, 2.0), (70, 50, 10, 2.0))
    np.testing.assert_allclose(both[near(0, 0, 36)], young[near(0, 0, 36)], atol=1e-6)
    assert np.abs((both - young)[near(70, 50, 5)]).max() > 0.5
    younger = heights((0, 0, 80, 0.1), (20, 10, 12, 0.0))
    assert np.abs((younger - young)[near(20, 10, 5)]).max() > 0.5


def test_of_two_alike_the_younger_keeps_its_rim():
    """Where the younger one's rim crosses the older one's bowl, it stands up."""
    both = heights((0, 0, 40, 0.1), (24, 0, 40, 2.0))
    old, young = heights((24, 0, 40, 2.0)), heights((0, 0, 40, 0.1))
    only_young = near(0, 0, 17)
    expected = young + 0.5 * old
    np.testing.assert_allclose(both[only_young], expected[only_young], atol=1e-5)
