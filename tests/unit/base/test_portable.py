"""Arithmetic of the same bits everywhere: right, and equal to NumPy's but for the last of them."""

import numpy as np
import pytest

from terrain_forge.base import portable

RANDOM = np.random.default_rng(8)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("exp", -800, 800), ("expm1", -2, 2), ("log", 0, 50), ("log1p", -0.9, 9), ("log2", 0.1, 9),
        ("log10", 0.1, 9), ("cbrt", -5, 5), ("tan", -1.5, 1.5), ("arctan", -9, 9),
        ("arcsin", -1, 1), ("arccos", -1, 1),
    ],
)  # fmt: skip
def test_functions_are_numpys(name, low, high):
    x = RANDOM.uniform(low, high, (7, 5))
    with np.errstate(over="ignore"):
        wanted = getattr(np, name)(x)
    np.testing.assert_allclose(getattr(portable, name)(x), wanted, rtol=1e-14)
    np.testing.assert_allclose(getattr(portable, name)(x[0, 0]), wanted[0, 0], rtol=1e-14)
    assert getattr(portable, name)(np.zeros((0, 3)) + 0.5).shape == (0, 3)


def test_limits_of_functions():
    assert portable.log([0.0, -1.0, 1.0]).tolist()[0] == -np.inf
    assert np.isnan(portable.log(-1.0))
    assert portable.power([0.0, 2.0, 0.0], [-1.0, 3.0, 0.0]).tolist() == [np.inf, 8.0, 1.0]
    assert portable.power(1e200, 2.0) == np.inf
    np.testing.assert_allclose(portable.power([[2.0], [3.0]], [1.0, 2.0]), [[2, 4], [3, 9]])
    np.testing.assert_allclose(portable.arctan2(1.0, [1.0, -1.0]), np.arctan2(1.0, [1.0, -1.0]))
    np.testing.assert_allclose(portable.geomspace(0.1, 50.0, 9), np.geomspace(0.1, 50.0, 9))


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ((3,), (3,)), ((5, 3), (3,)), ((3,), (3, 4)), ((5, 3), (3, 4)), ((6, 5, 3), (3, 4)),
        ((6, 5, 3), (6, 3, 4)), ((3, 3), (6, 3, 2)), ((1, 3), (3, 1)),
    ],
)  # fmt: skip
def test_product_is_the_matrix_product(a, b):
    one, other = RANDOM.normal(size=a), RANDOM.normal(size=b)
    found = portable.product(one, other)
    assert np.shape(found) == np.shape(one @ other)
    np.testing.assert_allclose(found, one @ other, atol=1e-14)


def test_lengths_solutions_and_lines():
    x = RANDOM.normal(size=(6, 3))
    np.testing.assert_allclose(portable.norm(x), np.linalg.norm(x, axis=1))
    np.testing.assert_allclose(portable.norm(x, axis=0), np.linalg.norm(x, axis=0))
    assert portable.norm(x[0]) == pytest.approx(np.linalg.norm(x[0]))
    a = RANDOM.normal(size=(4, 4))
    np.testing.assert_allclose(portable.inverse(a) @ a, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(a @ portable.solve(a, x[0, :1].repeat(4)), x[0, 0], atol=1e-12)
    with pytest.raises(ValueError, match="singular"):
        portable.inverse(np.zeros((2, 2)))
    np.testing.assert_allclose(portable.fit_line([0, 1, 2], [1, 3, 5]), (2, 1))


def test_eigenvectors_of_symmetric_matrices():
    a = RANDOM.normal(size=(50, 3, 3))
    a = a @ a.swapaxes(1, 2)
    a[0], a[1] = np.eye(3), np.diag([3.0, 1.0, 2.0])
    values, vectors = portable.eigh(a)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(a), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(
        vectors @ (values[:, :, None] * vectors.swapaxes(1, 2)), a, atol=1e-12
    )
    np.testing.assert_allclose(vectors.swapaxes(1, 2) @ vectors, np.tile(np.eye(3), (50, 1, 1)),
                               atol=1e-13)  # fmt: skip
    assert portable.eigh(a[1])[0].tolist() == [1.0, 2.0, 3.0]


def test_smoothing_is_that_of_scipy():
    from scipy.ndimage import gaussian_filter

    values = np.random.default_rng(3).normal(size=(40, 30))
    for width, mode in ((0.7, "nearest"), (2.0, "constant"), (3.5, "nearest")):
        expected = gaussian_filter(values, width, mode=mode, truncate=3.0)
        found = portable.smoothed(values, width, mode=mode, truncate=3.0)
        assert np.allclose(found, expected, rtol=0, atol=1e-14)
