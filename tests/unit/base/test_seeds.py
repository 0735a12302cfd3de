"""Numbers drawn by address."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest, poisson

from terrain_forge.base import seeds


@pytest.mark.parametrize("mean", [0.3, 12.0, 511.0, 513.0, 40_000.0])
def test_counts_are_poisson_whatever_their_mean(mean):
    counts = np.array([seeds.poisson(np.uint64(seeds.mix(1, n)), mean) for n in range(2000)])
    dispersion = np.square(counts - mean).sum() / mean
    assert chi2.ppf(0.0005, len(counts)) < dispersion < chi2.isf(0.0005, len(counts))
    if mean > 500.0:
        assert kstest(counts + 0.5, poisson(mean).cdf).pvalue > 0.001
