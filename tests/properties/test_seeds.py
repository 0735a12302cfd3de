"""Randomness by address: the same for the same address, of the right range, of any seed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.stats import chi2, kstest, poisson

import terrain_forge as tf
from terrain_forge.base import mix, stage_key, uniform, uniforms, zigzag
from terrain_forge.base import seeds as drawn
from terrain_forge.model import mix as tf_mix
from terrain_forge.model import uniform as tf_uniform

FEW = settings(max_examples=40, deadline=None, derandomize=True, database=None)
seeds = st.integers(0, 2**63 - 1)
words = st.integers(-(2**31), 2**31)


@FEW
@given(seed=seeds, other=seeds, stage=st.sampled_from(["rocks", "grain", "ground"]))
def test_a_stage_has_a_key_of_its_seed_and_name(seed, other, stage):
    key = stage_key(seed, stage)
    assert key.dtype == np.uint64
    assert key == stage_key(seed, stage)
    assert (key == stage_key(other, stage)) == (seed == other)
    assert key != stage_key(seed, stage + "s")


@FEW
@given(seed=seeds, count=st.integers(1, 50), more=st.integers(0, 50))
def test_more_draws_do_not_change_the_first(seed, count, more):
    key = stage_key(seed, "draws")
    few, many = uniforms(key, count), uniforms(key, count + more)
    assert few.tobytes() == many[:count].tobytes()
    assert 0.0 < many.min() <= many.max() < 1.0


@FEW
@given(seed=seeds, address=st.lists(words, min_size=1, max_size=4))
def test_plugins_hash_arrays_as_kernels_hash_numbers(seed, address):
    key = stage_key(seed, "plugin")
    expected = [uniform(np.uint64(mix(key, word))) for word in address]
    assert tf.uniform(tf.mix(key, np.array(address))).tolist() == expected
    assert tf.uniform(tf.mix(key, address[0])) == _inside(key, address[0]) == expected[0]
    with pytest.raises(tf.DataError, match="whole numbers, found float64"):
        tf.uniform(0.5)


@njit
def _inside(key, word):
    return tf_uniform(tf_mix(key, word))


@FEW
@given(seed=seeds, address=st.lists(words, min_size=1, max_size=4))
def test_addresses_are_told_apart_by_their_order(seed, address):
    def draw(parts):
        key = stage_key(seed, "address")
        for part in parts:
            key = np.uint64(mix(key, np.int64(part)))
        return uniform(key)

    assert draw(address) == draw(list(address))
    if address != address[::-1]:
        assert draw(address) != draw(address[::-1])
    assert draw(address) != draw([*address, 0])


@FEW
@given(one=words, other=words)
def test_codes_of_signed_integers_are_their_own(one, other):
    assert zigzag(np.int64(one)) >= 0
    assert (zigzag(np.int64(one)) == zigzag(np.int64(other))) == (one == other)


@pytest.mark.parametrize("mean", [0.3, 12.0, 511.0, 513.0, 40_000.0])
def test_counts_are_poisson_whatever_their_mean(mean):
    counts = np.array([drawn.poisson(np.uint64(mix(1, n)), mean) for n in range(2000)])
    dispersion = np.square(counts - mean).sum() / mean
    assert chi2.ppf(0.0005, len(counts)) < dispersion < chi2.isf(0.0005, len(counts))
    if mean > 500.0:
        assert kstest(counts + 0.5, poisson(mean).cdf).pvalue > 0.001
