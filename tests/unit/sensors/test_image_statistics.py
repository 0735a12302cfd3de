"""Figures of pictures against closed forms and OpenCV."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.sensors import image_statistics
from terrain_forge.sensors.likeness import fast_corners


def _noise(exponent: float, size: int = 512):
    """A periodic field of a known power law, and as many samples of a Gaussian."""
    rng = np.random.default_rng(4)
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.fftfreq(size)[None, :])
    frequency[0, 0] = 1.0
    field = np.fft.fft2(rng.normal(size=(size, size))) * frequency ** (0.5 * exponent)
    field = np.fft.ifft2(field).real
    return field / field.std()


@pytest.mark.parametrize("exponent", [-1.5, -2.5])
def test_the_slope_of_a_power_law_is_found(exponent):
    found = image_statistics(10.0 + 0.5 * _noise(exponent))
    for slope in (found.slope, found.slope_low, found.slope_high):
        assert slope == pytest.approx(exponent, abs=0.2)


def test_kurtosis_and_shadow_share():
    found = image_statistics(np.exp(0.1 * _noise(0.0)))
    assert found.kurtosis == pytest.approx(3.0, abs=0.1)
    picture = np.ones((100, 200))
    picture[:, :30] = 0.1
    assert image_statistics(picture).dark == pytest.approx(0.15)


def test_corners_are_those_of_opencv():
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")
    picture = np.clip(128 + 40 * _noise(-1.0), 0, 255).astype(np.uint8)
    kind = cv2.FAST_FEATURE_DETECTOR_TYPE_9_16
    oracle = cv2.FastFeatureDetector_create(threshold=20, nonmaxSuppression=True, type=kind)
    wanted = {(round(p.pt[1]), round(p.pt[0])) for p in oracle.detect(picture)}
    assert len(wanted) > 100
    assert {(int(r), int(c)) for r, c in fast_corners(picture)} == wanted


def test_a_picture_too_small_is_refused():
    with pytest.raises(ValueError, match="20 × 90 pixels, at least 32 × 32"):
        image_statistics(np.ones((90, 20)))
