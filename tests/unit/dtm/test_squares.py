"""Large grids of posts are worked on square by square, and told by some of their squares."""

import numpy as np
import pytest

from terrain_forge.dtm import squares
from terrain_forge.dtm.increments import (
    local_square_increments,
    mean_square_increment,
    mixed_share,
)
from terrain_forge.dtm.quality import planar_posts
from terrain_forge.dtm.roughness import fit_roughness
from terrain_forge.model import BODIES
from tests.helpers.rasters import rough


@pytest.fixture
def small(monkeypatch):
    """What counts as large is small."""
    monkeypatch.setattr(squares, "WHOLE", 2**14)
    monkeypatch.setattr(squares, "SIDE", 96)
    monkeypatch.setattr(squares, "SAMPLE", 70)


def ground():
    """Heights of which a part is not known, and a plane."""
    heights = rough((610, 570))
    heights[200:240, 100:180] = np.linspace(0.0, 3.0, 80)
    trusted = np.ones(heights.shape, bool)
    trusted[300:420, 250:300] = False
    return heights, trusted


@pytest.mark.parametrize("width", [1.0, 2.0, 4.0])
def test_what_is_near_a_post_does_not_know_of_squares(width, request):
    """Where it is known; elsewhere it tends to what is usual, which some squares tell."""
    heights, trusted = ground()
    whole = local_square_increments(heights, 1, trusted, width)
    request.getfixturevalue("small")
    found = local_square_increments(heights, 1, trusted, width)
    for known in (np.s_[4:280, 4:-4], np.s_[440:-4, 4:-4]):
        np.testing.assert_allclose(found[known], whole[known], rtol=3e-3)
    np.testing.assert_allclose(found[300:420, 250:300], whole[300:420, 250:300], rtol=0.3)


def test_planes_are_found_across_squares(request):
    heights, _ = ground()
    whole = planar_posts(heights)
    assert whole.sum() > 2000
    request.getfixturevalue("small")
    assert (planar_posts(heights) == whole).all()


@pytest.mark.slow
def test_a_large_dtm_is_as_rough_as_its_squares(request):
    heights, trusted = rough((610, 570)), np.ones((610, 570), bool)
    whole = fit_roughness(heights, 1.0, BODIES["mars"], trusted)
    figures = [f(heights, 2, trusted) for f in (mean_square_increment, mixed_share)]
    request.getfixturevalue("small")
    found = fit_roughness(heights, 1.0, BODIES["mars"], trusted)
    assert found.hurst == pytest.approx(whole.hurst, abs=0.02)
    assert found.deviation == pytest.approx(whole.deviation, rel=0.1)
    assert [f(heights, 2, trusted) for f in (mean_square_increment, mixed_share)] == pytest.approx(
        figures, rel=0.25
    )
    np.testing.assert_allclose(
        found.local / found.deviation, whole.local / whole.deviation, rtol=0.3
    )
    assert (found.grain is None) == (whole.grain is None)


def test_a_strip_is_told_by_squares_along_it(small):
    parts = list(squares.samples((40, 10_000)))
    assert len(parts) == 8
    assert all(rows == slice(0, 70) for rows, _ in parts)
    assert parts[0][1].start == 0
    assert parts[-1][1].stop == 10_000
