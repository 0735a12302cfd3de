"""Continue decimated DTMs and compare with the originals: tables and pictures of docs/terrain.md.

    python docs/make_terrain_evidence.py jezero.tif gale.bin:60/65535 …

Each DTM (with a vertical scale after a colon, where its file has none) is averaged 4 × 4, continued
to its own posting with several seeds, and compared with itself, beside cubic interpolation of the
same averages. Then parts of it are averaged, or thinned out to single posts, by 4 and by 8. Prints
tables for docs/terrain.md and draws the first DTM.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import rasterio
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning

import terrain_forge as tf
from terrain_forge.dtm import ArrayDtm, cubic
from terrain_forge.recipe import TerrainSpec
from terrain_forge.terrain import Fractal, radial_spectrum, rms_deviation

Array = NDArray[np.float64]

FACTOR, MARGIN, SEEDS = 4, 8, (1, 2, 3)
LAGS = (1, 2, 3, 4, 8)
PART = 512
"""Posts a side of parts, which overlap by half."""
IMAGES = Path(__file__).parent / "images"


@dataclass(frozen=True)
class Trial:
    """A DTM, and what was made of its averages; all cut alike."""

    name: str
    truth: Array
    cubic: Array
    ours: tuple[Array, ...]
    residual: float
    roughness: str


def main() -> None:
    """Run all trials, print the table, draw the first."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dtm", nargs="+", help="raster, or raster:metres per unit")
    trials = [trial(argument) for argument in parser.parse_args().dtm]
    print(f"| DTM | | {' | '.join(f'{n} posts' for n in LAGS)} | median slope |")
    print(f"|---|---|{'---|' * (len(LAGS) + 1)}")
    for t in trials:
        print_rows(t)
        print(f"{t.name}: {t.roughness}; means off by {t.residual * 1000:.2g} mm at most")
    print("| parts of | by | parts | 1 post | 2 to 4 | 95th percentile of slopes | within |")
    print("|---|---|---|---|---|---|---|")
    for argument in parser.parse_args().dtm:
        print_parts(argument)
    draw(trials[0], IMAGES / "continuation.png")


def trial(argument: str) -> Trial:
    """Average, continue, cut."""
    name, heights = read(argument)
    rows, columns = (n // FACTOR for n in heights.shape)
    heights = heights[: rows * FACTOR, : columns * FACTOR]
    means = averages(heights, FACTOR)
    edge = MARGIN * FACTOR
    made = [continued(means, seed, FACTOR) for seed in SEEDS]
    inner = means[MARGIN:-MARGIN, MARGIN:-MARGIN]
    return Trial(
        name=name,
        truth=heights[edge:-edge, edge:-edge],
        cubic=interpolated(means)[edge:-edge, edge:-edge],
        ours=tuple(ground for ground, _ in made),
        residual=max(float(np.abs(averages(ground, FACTOR) - inner).max()) for ground, _ in made),
        roughness=made[0][1],
    )


def read(argument: str) -> tuple[str, Array]:
    """Name of a DTM and its heights."""
    name, _, scale = argument.partition(":")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(name) as file:
            heights = file.read(1).astype(float) * float(Fraction(scale or "1"))
    return Path(name).stem, heights


def print_parts(argument: str) -> None:
    """Ranges of errors of parts of a DTM, averaged and thinned out, and how many reach the goal."""
    name, heights = read(argument)
    corners = [
        (row, column)
        for row in range(0, max(len(heights) - PART, 0) + 1, PART // 2)
        for column in range(0, max(heights.shape[1] - PART, 0) + 1, PART // 2)
    ]
    parts = [heights[row : row + PART, column : column + PART] for row, column in corners]
    for factor in (4, 8):
        for thinned in (False, True):
            errors = np.array([part_errors(part, factor, thinned=thinned) for part in parts])
            one, few, steep = errors[:, 0], errors[:, 1:4], errors[:, 4]
            rough = (np.abs(one) < 0.15) & (np.abs(few).max(axis=1) < 0.10)
            cells = " | ".join(
                f"{100 * e.min():+.0f} to {100 * e.max():+.0f} %" for e in (one, few, steep)
            )
            kind = "thinned out" if thinned else "averaged"
            reached = f"{rough.sum()}, {(np.abs(steep) < 0.07).sum()}"
            print(f"| {name} | {factor}, {kind} | {len(parts)} | {cells} | {reached} |")


def part_errors(part: Array, factor: int, *, thinned: bool) -> list[float]:
    """Errors of the RMS deviation over 1 to 4 posts and of the slopes' 95th percentile."""
    means = averages(part, factor)
    if thinned:
        means = part[factor // 2 :: factor, factor // 2 :: factor][: len(means), : means.shape[1]]
    ground, _ = continued(means, 1, factor)
    edge = MARGIN * factor
    truth = part[edge : len(means) * factor - edge, edge : means.shape[1] * factor - edge]
    errors = [rms_deviation(ground, n) / rms_deviation(truth, n) - 1.0 for n in LAGS[:4]]
    steep = [np.percentile(np.tan(np.radians(slopes(z))), 95) for z in (ground, truth)]
    return [*errors, float(steep[0] / steep[1] - 1.0)]


def averages(heights: Array, factor: int) -> Array:
    """Means over blocks of samples."""
    rows, columns = (n // factor for n in heights.shape)
    heights = heights[: rows * factor, : columns * factor]
    return heights.reshape(rows, factor, columns, factor).mean(axis=(1, 3))


def continued(means: Array, seed: int, factor: int) -> tuple[Array, str]:
    """Ground that the fractal layer makes of the averages [m], and what it was fitted to."""
    posting, spacing = 4.0 * factor, 4.0
    size = [((n - 2 * MARGIN) * factor - 1) * spacing for n in means.shape[::-1]]
    recipe = tf.Recipe(
        schema=1,
        name="trial",
        body="mars",
        seed=seed,
        dtm=ArrayDtm(posting_m=posting, size_m=(size[0], size[1])),
        terrain=TerrainSpec(spacing_m=spacing, layers=(Fractal(),)),
    )
    site = tf.plan(recipe, heights=means)
    ground = tf.realise(site).ground.elevation
    return ground.astype(float) + site.datum_height, site.roughness.source


def interpolated(means: Array) -> Array:
    """Cubic convolution alone."""
    rows, columns = ((np.arange(n * FACTOR) + 0.5) / FACTOR - 0.5 for n in means.shape)
    column, row = np.meshgrid(columns, rows)
    return cubic(means, column=column, row=row)


def slopes(heights: Array) -> Array:
    """Slopes between neighbouring samples 4 m apart [degrees]."""
    east, north = np.diff(heights, axis=1)[:-1], np.diff(heights, axis=0)[:, :-1]
    return np.degrees(np.arctan(np.hypot(east, north) / 4.0)).ravel()


def print_rows(t: Trial) -> None:
    """Errors of the RMS deviation, and the median slope."""

    def cells(heights: Array) -> str:
        errors = [rms_deviation(heights, n) / rms_deviation(t.truth, n) - 1.0 for n in LAGS]
        off = np.median(slopes(heights)) / np.median(slopes(t.truth)) - 1.0
        return " | ".join(f"{100 * e:+.1f} %" for e in (*errors, off))

    print(f"| {t.name} | cubic alone | {cells(t.cubic)} |")
    for seed, ground in zip(SEEDS, t.ours, strict=True):
        print(f"| | continued, seed {seed} | {cells(ground)} |")


def draw(t: Trial, path: Path) -> None:
    """Hillshades of a part, spectra, slopes."""
    figure = Figure(figsize=(12, 7.4), dpi=80, facecolor="white")
    panels = figure.subplots(2, 3)
    figure.subplots_adjust(left=0.06, right=0.99, bottom=0.08, top=0.95, hspace=0.22, wspace=0.2)
    shown = (
        ("original", t.truth),
        ("averages, cubic", t.cubic),
        ("averages, continued", t.ours[0]),
    )
    for axes, (name, heights) in zip(panels[0], shown, strict=True):
        part = heights[300:500, 300:500] if min(heights.shape) > 500 else heights[:200, :200]
        north, east = np.gradient(part, 4.0)
        light = (1.0 - 2.0 * east + 1.0 * north) / np.sqrt(1.0 + east**2 + north**2)
        axes.imshow(light, cmap="gray", vmin=0.3, vmax=1.7)
        axes.set_title(name, loc="left")
        axes.set_axis_off()
    structure, spectrum, histogram = panels[1]
    for (name, heights), colour in zip(shown, ("#4a433d", "#2f6f8f", "#b4552d"), strict=True):
        lags = np.arange(1, 33)
        ratio = [rms_deviation(heights, int(n)) / rms_deviation(t.truth, int(n)) for n in lags]
        structure.semilogx(lags, ratio, color=colour)
        spectrum.loglog(*radial_spectrum(heights, 1.0), color=colour, label=name)
        histogram.hist(
            slopes(heights), np.arange(41.0), histtype="step", density=True, color=colour
        )
    structure.set(title="RMS deviation ÷ original's", xlabel="baseline [original posts]")
    spectrum.set(title="power spectrum", xlabel="cycles per original post")
    spectrum.axvline(0.5 / FACTOR, color="#4a433d", lw=0.8, ls=":")
    spectrum.legend(frameon=False)
    histogram.set(title="slopes over one original post", xlabel="degrees")
    figure.savefig(path, metadata={"Software": None})


if __name__ == "__main__":
    main()
