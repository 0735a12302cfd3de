"""Clusters: pair correlation, number, variance, borders."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.special import erf
from scipy.stats import chi2, kstest, norm, t

from terrain_forge.base import RecipeError, stage_key
from terrain_forge.model import Window
from terrain_forge.rocks import Clustered, Golombek, PopulationSpec, expected
from terrain_forge.rocks.scattering.clusters import parents
from tests.helpers.scattering import CLUSTERED, image, run, sand, site


def test_clusters_have_the_pair_correlation_of_a_thomas_process():
    """Ripley's K = π r² + (1 - exp(-r²/4σ²)) / κ, from rocks that lie r within the border."""
    radii = np.array([0.5, 1.0, 2.0, 4.0, 6.0])
    kappa, sigma = CLUSTERED.clusters_per_m2, CLUSTERED.radius_m
    wanted = np.pi * radii**2 + (1.0 - np.exp(-(radii**2) / (4.0 * sigma**2))) / kappa
    excess = []
    for seed in range(8):
        xy = run(site(seed=seed), sand(arrangement=CLUSTERED)).xy
        middle = xy[np.all(np.abs(xy) < (24.0, 19.0), axis=1)]
        tree = cKDTree(xy)
        counted = np.array([tree.query_ball_point(middle, r, return_length=True) for r in radii])
        # Pairs less the number of them that the known density leads to, rock by rock.
        excess.append((counted - 1).sum(axis=1) - len(middle) * wanted)
    excess = np.array(excess)
    z = excess.mean(axis=0) / (excess.std(axis=0, ddof=1) / len(excess) ** 0.5)
    assert np.all(np.abs(z) < t.isf(0.0005, len(excess) - 1))
    assert np.all(wanted[:3] > 1.5 * np.pi * radii[:3] ** 2)


def held_by_clusters(spec, place, window):
    """Expected area of a window, given the clusters: their shares in it over clusters per m²."""
    key = stage_key(place.seed, f"rocks/{spec.name}")
    arrangement, shares = spec.arrangement, 1.0
    centres = parents(arrangement, site=place, key=key).xy
    for axis, ends in enumerate(place.axes(window)):
        away = (ends[[0, -1], None] - centres[:, axis]) / (2.0**0.5 * arrangement.radius_m)
        shares = shares * 0.5 * np.diff(erf(away), axis=0)[0]
    return shares.sum() / arrangement.clusters_per_m2


def test_clusters_number_and_its_variance():
    """Given the parents the count is Poisson; over seeds it varies as the clusters do."""
    given, free = [], []
    for seed in range(24):
        place, spec = site((30.0, 30.0), seed=seed), sand(arrangement=CLUSTERED)
        count = len(run(place, spec))
        whole = expected(spec, site=place, window=place.window)
        known = held_by_clusters(spec, place, place.window)
        assert whole.area == pytest.approx(900.0)
        given.append((count - known) / known**0.5)
        free.append((count - whole.area) / (whole.area + whole.area_variance) ** 0.5)
    for z in (given, free):
        assert chi2.ppf(0.0005, len(z)) < np.square(z).sum() < chi2.isf(0.0005, len(z))
        assert abs(np.sum(z)) < norm.isf(0.0005) * len(z) ** 0.5


def test_clusters_are_as_dense_at_the_border():
    found = near = wanted = 0.0
    for seed in range(30):
        place, spec = site((30.0, 30.0), seed=seed), sand(arrangement=CLUSTERED)
        xy = run(place, spec).xy
        inner = Window(column=8, row=8, columns=104, rows=104)
        rim = 900.0 - 26.0**2
        found += np.count_nonzero(np.max(np.abs(xy), axis=1) > 13.0)
        wanted += held_by_clusters(spec, place, place.window)
        wanted -= held_by_clusters(spec, place, inner)
        near += rim
    assert abs(found - wanted) < norm.isf(0.0005) * wanted**0.5
    assert found == pytest.approx(near, rel=0.15)


def test_clusters_share_their_parents_and_keep_the_law():
    spec = PopulationSpec(
        name="a",
        size_frequency=Golombek(k=0.05),
        diameter_m=(0.1, 1.0),
        arrangement=Clustered(clusters_per_m2=0.02, radius_m=2.0),
    )
    law, sizes, lost, total = spec.size_frequency, [], 0, 0
    for seed in range(10):
        place = site(seed=seed)
        found = run(place, spec)
        key = stage_key(seed, "rocks/a")
        tree = cKDTree(parents(spec.arrangement, site=place, key=key).xy)
        for low, high in ((0.1, 0.2), (0.2, 1.0)):
            chosen = (found.diameter >= low) & (found.diameter < high)
            away, _ = tree.query(found.xy[chosen])
            random = np.random.default_rng(seed).uniform((-30, -25), (30, 25), (2000, 2))
            assert np.median(away) < 0.8 * np.median(tree.query(random)[0])
        sizes.append(found.diameter)
        lost, total = lost + sum(found.unplaced), total + len(found)
    ends = law.cumulative_number(np.array([0.1, 1.0]))
    cdf = lambda d: (ends[0] - law.cumulative_number(d)) / (ends[0] - ends[1])  # noqa: E731
    assert kstest(np.concatenate(sizes), cdf).pvalue > 0.001
    assert lost < 1e-3 * total


def test_variance_of_the_area_in_clusters():
    """Of a rectangle: L erf(L/2σ) - (2σ/√π)(1 - exp(-L²/4σ²)) for each side L, over κ."""
    place = site((24.0, 16.0))
    spec = sand(arrangement=CLUSTERED)
    sigma, kappa = CLUSTERED.radius_m, CLUSTERED.clusters_per_m2
    wanted = 1.0 / kappa
    for side in (24.0, 16.0):
        falling = 2.0 * sigma / np.pi**0.5 * (1.0 - np.exp(-(side**2) / (4.0 * sigma**2)))
        wanted *= side * erf(side / (2.0 * sigma)) - falling
    found = expected(spec, site=place, window=place.window).area_variance
    assert found == pytest.approx(wanted, rel=1e-12)
    white = place.replace(images=(image([[1.0]]),))
    shaped = expected(
        sand(arrangement=CLUSTERED, density_image="map.png"), site=white, window=place.window
    )
    assert shaped.area_variance == pytest.approx(wanted, rel=1e-9)


def test_too_many_clusters_are_refused():
    spec = sand(arrangement=Clustered(clusters_per_m2=10.0, radius_m=100.0))
    with pytest.raises(RecipeError, match="clusters on the site and 400 m around it"):
        run(site(), spec)
