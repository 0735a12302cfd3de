"""Makes the synthetic DTMs in this folder: `python dtm_samples/make_samples.py`.

They are statistics, not places. Each is a self-affine surface made by spectral synthesis with a
given RMS deviation ν(1 m) and Hurst exponent (Shepard et al. 2001, doi:10.1029/2000JE001429); the
lunar one carries fresh and worn craters besides. Float32 GeoTIFF in the IAU 2015 equirectangular
CRS of its body.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import from_origin
from scipy.special import gamma

HERE = Path(__file__).parent


def self_affine(shape: tuple[int, int], posting: float, hurst: float, deviation: float, seed: int):
    """Heights [m] with ν(L) = deviation·(L / 1 m)^hurst, from twice the size to cut off the period.

    Two-sided spectrum S(k) = A k^(-2H-2), A = ν₁² / C(H) with
    C = 4π (2π)^2H Γ(1-H) / (2^(2H+1) H Γ(1+H)), k in cycles per metre.
    """
    rows, columns = 2 * shape[0], 2 * shape[1]
    constant = 4 * np.pi * (2 * np.pi) ** (2 * hurst) * gamma(1 - hurst)
    constant /= 2 ** (2 * hurst + 1) * hurst * gamma(1 + hurst)
    k = np.hypot(np.fft.fftfreq(rows, posting)[:, None], np.fft.rfftfreq(columns, posting)[None, :])
    k[0, 0] = np.inf
    power = deviation**2 / constant * k ** (-2 * hurst - 2)
    white = np.fft.rfft2(np.random.default_rng(seed).standard_normal((rows, columns)))
    heights = np.fft.irfft2(white * np.sqrt(power) / posting, s=(rows, columns))
    return heights[: shape[0], : shape[1]]


def crater(distance: np.ndarray, diameter: float) -> np.ndarray:
    """Fresh simple crater [m]: Fassett & Thomson 2014, doi:10.1002/2014JE004698, equation 4."""
    x = 2 * distance / diameter
    inner = -0.228809953 + 0.227533882 * x + 0.083116795 * x**2 - 0.039499407 * x**3
    outer = 0.188253307 - 0.187050452 * x + 0.01844746 * x**2 + 0.01505647 * x**3
    profile = np.where(x <= 0.2, -0.181, np.where(x <= 0.98, inner, outer))
    return diameter * np.where(x > 1.5, 0.0, profile)


def add_craters(
    heights: np.ndarray, posting: float, seed: int, smallest: float = 8.0, largest: float = 90.0
) -> None:
    """Stamp craters, N(≥D) = 10^-1.1 D^-2 per m² (Trask), most of them worn."""
    random = np.random.default_rng(seed)
    rows, columns = heights.shape
    density = 10**-1.1 * (smallest**-2 - largest**-2)
    count = random.poisson(density * rows * columns * posting**2)
    u = random.random(count)
    diameters = np.sort((smallest**-2 - u * (smallest**-2 - largest**-2)) ** -0.5)[::-1]
    north, east = np.mgrid[0:rows, 0:columns] * posting
    for diameter in diameters:
        x, y = random.random(2) * (columns * posting, rows * posting)
        freshness = random.beta(0.8, 3.0)
        heights += freshness * crater(np.hypot(east - x, north - y), diameter)


def write(name: str, heights: np.ndarray, posting: float, crs: str, west: float, north: float):
    """Write a float32 GeoTIFF with its upper left corner at (west, north)."""
    with rasterio.open(
        HERE / name,
        "w",
        driver="GTiff",
        width=heights.shape[1],
        height=heights.shape[0],
        count=1,
        dtype="float32",
        crs=crs,
        transform=from_origin(west, north, posting, posting),
        compress="deflate",
        predictor=3,
        zlevel=9,
    ) as file:
        file.write(np.round(heights, 3).astype(np.float32), 1)
        file.update_tags(DESCRIPTION="synthetic, see README.md", UNITS="metres above the datum")


def main() -> None:
    """Make all samples."""
    gale = self_affine((416, 416), 1.0, 0.7, 0.06, seed=2020) - 4500.0
    write("gale_floor_synthetic.tif", gale, 1.0, "IAU_2015:49910", 8144000.0, -272000.0)
    mare = self_affine((320, 320), 2.0, 0.76, 0.035, seed=1969)
    add_craters(mare, 2.0, seed=11)
    write("moon_mare_synthetic.tif", mare - 1900.0, 2.0, "IAU_2015:30110", 711000.0, 20600.0)
    pole = self_affine((360, 360), 10.0, 0.8, 0.1, seed=1972)
    add_craters(pole, 10.0, seed=13, smallest=40.0, largest=800.0)
    write("moon_pole_synthetic.tif", pole + 1200.0, 10.0, "IAU_2015:30135", -8000.0, 5200.0)


if __name__ == "__main__":
    main()
