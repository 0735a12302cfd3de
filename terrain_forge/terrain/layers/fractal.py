"""Fractal relief that continues the DTM below its posting."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from terrain_forge.base import Array, Key, RecipeError, Spec, portable, stage_key
from terrain_forge.dtm import Nodes, PixelFrame, Posts
from terrain_forge.model import Roughness, Site, Window
from terrain_forge.terrain.continuation import Grain, Octaves, continue_dtm, noise_at
from terrain_forge.terrain.layer import Beyond, Layer
from terrain_forge.terrain.noise import octaves

# Mean square difference of the unit-lattice noise at distances 2^(n/2), n = -12 … 8, over 4 million
# pairs each (measured again by tests/test_terrain.py).
_STRUCTURE = np.array(
    [9.52e-05, 1.903e-04, 3.803e-04, 7.595e-04, 1.514e-03, 3.010e-03, 5.946e-03, 1.160e-02]
    + [2.211e-02, 4.025e-02, 6.721e-02, 9.614e-02, 1.075e-01, 9.651e-02, 9.301e-02, 9.316e-02]
    + [9.316e-02] * 5
)
_ALL = np.arange(-60, 401)  # octaves beyond, shorter and longer, change nothing, up to H = 0.98

# Lattice distance of the last octave, in spacings: its waves are somewhat longer. Nodes above a DTM
# are means over their cells, which show no more; on a flat site they are points.
_SHORTEST, _SHORTEST_OF_POINTS = 1.5, 0.75
_FLAT_LONGEST = 32.0  # longest wavelength on a flat site [m] …
_BASELINES = 8.0  # … and in baselines of the roughness
_STAGE = "terrain/fractal"
_DRAWN_OUT = 4.0  # length over width of noise with a direction
# RMS slope of detail over one spacing: of loose ground, of the tangent of its angle of repose, and
# of crags, as their faces are rough where their law would stand on needles.
_RESTING, _CRAG = 0.5, 1.0
_STEEPEST_DEG = 80.0
_FEWEST_BASELINES = 4.0  # in a longest wavelength, so that longer ones are planes over it


@dataclass(frozen=True, kw_only=True)
class _Preset:
    """Roughness that was measured at a site: ν(L) = deviation · (L / 1 m)^hurst."""

    hurst: float
    deviation: float


# Landing sites: exponents, the middle of their ranges, and RMS deviations at 1 m of Shepard,
# Seelos, Arvidson & Haldemann, "The Roughness of the Martian Surface"; of Viking 2 they have one
# profile of 6 m and no deviation: Viking 1's is assumed. Moon: exponents and median slopes at
# 17 m, 2.0° and 7.5°, of Rosenburg et al. 2011 (doi:10.1029/2010JE003716). Shots lie 57 m
# apart, so these are of planes through three spots of one shot (√½ · 25 m is 17.7 m): their median
# is √(2 ln 2) times the RMS slope along a line.
PRESETS = {
    "pathfinder": _Preset(hurst=0.57, deviation=0.0959),
    "viking_1": _Preset(hurst=0.65, deviation=0.0865),
    "viking_2": _Preset(hurst=0.8, deviation=0.0865),
    "lunar_mare": _Preset(hurst=0.76, deviation=0.0585),
    "lunar_highlands": _Preset(hurst=0.95, deviation=0.129),
}


@dataclass(frozen=True, kw_only=True)
class RmsSlope(Spec):
    """A roughness as the RMS slope over a baseline."""

    slope_deg: Annotated[float, Interval(ge=0, le=60)]
    """Angle whose tangent is the RMS height difference over the baseline [degrees]."""
    baseline_m: Annotated[float, Interval(gt=0, le=1e4)] = 1.0
    """Distance of the points that are compared [m]."""


@dataclass(frozen=True, kw_only=True)
class Fractal(Layer):
    """Self-affine relief of the RMS deviation ν(L) = ν(1 m)·L^H below the DTM's posting.

    Shepard et al. 2001, doi:10.1029/2000JE001429. Without figures of its own it takes those that
    were fitted to the DTM, and is higher where the DTM around is rougher. The mean of the ground
    over each of the DTM's pixels stays as the DTM has it.
    """

    kind: Literal["fractal"] = "fractal"
    hurst: Annotated[float, Interval(ge=0.05, le=0.98)] | None = None
    """Hurst exponent H; without it the preset's or the one fitted to the DTM."""
    deviation_1m_m: Annotated[float, Interval(ge=0, le=10)] | None = None
    """RMS height difference of points 1 m apart [m]; without it the one fitted to the DTM."""
    rms_slope: RmsSlope | None = None
    """The same as an RMS slope: `{slope_deg: 5, baseline_m: 1}`."""
    preset: (
        Literal["pathfinder", "viking_1", "viking_2", "lunar_mare", "lunar_highlands"] | None
    ) = None
    """Roughness of a site that was measured, instead of the DTM's."""
    amplitude: Literal["local", "uniform"] | None = None
    """`local`: higher where the DTM around is rougher; `uniform`: the same everywhere. Without it,
    local where the amplitude is fitted to the DTM, and uniform where it is given."""
    keep_means: bool = True
    """Whether the means over the DTM's pixels stay as they are. If not, wavelengths that the DTM
    itself tells are added too."""
    longest_wavelength_m: Annotated[float, Interval(gt=0, le=1e6)] | None = None
    """Longest wavelength [m]; without it twice the DTM's posting, or on a flat site 32 m and at
    least eight baselines of the RMS slope. There the longest waves are as steep as they would be
    together with all longer ones, so that the roughness is the one asked for up to a quarter of
    this length."""
    gain: Annotated[float, Interval(ge=0, le=100)] = 1.0
    """Factor on the heights."""

    def check(self, *, site: Site, key: Key) -> None:
        """Refuse relief that is no ground."""
        rise = self.gain * self.figures(site).deviation_over(site.spacing) / site.spacing
        slope = float(np.degrees(np.arctan(rise)))
        if slope > _STEEPEST_DEG and len(self.octaves(site)):
            raise RecipeError(
                f"an RMS slope of {slope:.1f}° over the spacing of {site.spacing:g} m, at most "
                f"{_STEEPEST_DEG:g}°: less of gain, deviation_1m_m or rms_slope",
                key=key,
            )

    def relief(self, *, site: Site, window: Window, elevation: Array) -> Array:  # noqa: ARG002
        """Noise octaves from the longest wavelength down to what the spacing can hold."""
        noise = partial(self._noise, site)
        if site.dtm is None or not self.keep_means:
            return noise_at(site, Nodes.of(window), noise)
        return continue_dtm(site=site, window=window, noise=noise)

    def beyond(self, site: Site) -> Beyond | None:
        """The octaves whose waves the nodes can show, as rough as the ground is on the whole."""
        noise = self._noise(site)

        def relief(east: Array, north: Array, cell: float) -> Array:
            shown = np.clip(noise.wavelengths / cell - 1.5, 0.0, 1.0)
            count = int(np.count_nonzero(shown))
            if not count:
                return np.zeros((len(north), len(east)))
            return octaves(
                noise.key,
                east=east,
                north=north,
                wavelengths=noise.wavelengths[:count],
                amplitudes=(noise.factors * shown)[:count],
            )

        return relief

    def _noise(self, site: Site, posts: Posts | None = None) -> Octaves:
        """The noise that continues the ground; as high as it is around some posts of the DTM."""
        wavelengths = self.octaves(site)
        hurst = self.figures(site).hurst
        factors = octave_amplitudes(self.figures(site), wavelengths)
        if site.dtm is None and len(wavelengths):
            baseline = min(self._baseline, wavelengths[0] / _FEWEST_BASELINES)
            factors *= end_factors(hurst, wavelengths, baselines=(baseline, site.spacing))
        return Octaves(
            key=stage_key(site.seed, _STAGE),
            wavelengths=wavelengths,
            factors=self.gain * factors,
            variation=self.variation(site, posts) if posts else None,
            grains=_grains(site, hurst, posts) if posts and self._follows(site) else (),
        )

    @property
    def _baseline(self) -> float:
        """Baseline of the roughness that is asked for [m]."""
        return 1.0 if self.rms_slope is None else self.rms_slope.baseline_m

    @property
    def _given(self) -> bool:
        """Whether the recipe says how rough the ground is."""
        given = (self.preset, self.rms_slope, self.deviation_1m_m)
        return any(figure is not None for figure in given)

    def _follows(self, site: Site) -> bool:
        """Whether the detail is as the DTM around is."""
        local = self.amplitude == "local" or (self.amplitude is None and not self._given)
        return local and site.dtm is not None

    def octaves(self, site: Site) -> Array:
        """Lattice distances of the octaves [m], the longest first."""
        longest, shortest = self._ends(site)
        count = max(int(np.floor(portable.log2(longest / shortest) + 1e-9)) + 1, 0)
        return np.asarray(longest * portable.power(0.5, np.arange(count)))

    def _ends(self, site: Site) -> tuple[float, float]:
        """The longest wavelength, and the shortest that the nodes show [m]."""
        if site.dtm is None:
            longest, shortest = max(_FLAT_LONGEST, _BASELINES * self._baseline), _SHORTEST_OF_POINTS
        else:
            longest, shortest = 2.0 * site.dtm.posting, _SHORTEST
        return self.longest_wavelength_m or longest, shortest * site.spacing

    def __post_init__(self) -> None:
        given = [
            n for n in ("deviation_1m_m", "rms_slope", "preset") if getattr(self, n) is not None
        ]
        if len(given) > 1:
            raise ValueError(f"one of {' and '.join(given)}, not both")

    def facts(self, site: Site) -> Iterator[tuple[str, str]]:
        """The law of the detail, and whether there is any."""
        law = self.figures(site)
        rough = float(f"{law.deviation * 100:.2g}")
        yield "roughness", f"H = {law.hurst:.2f}, {rough:g} cm at 1 m ({law.source})"
        if not len(self.octaves(site)):
            longest, shortest = self._ends(site)
            yield (
                "warning",
                f"the fractal layer adds nothing: its longest waves, {longest:g} m, are below "
                f"{shortest:g} m, the shortest that nodes {site.spacing:g} m apart show",
            )

    def figures(self, site: Site) -> Roughness:
        """The law of the detail; the DTM's own bends, one that is asked for does not."""
        found = site.roughness
        if not self._given and self.hurst is None:
            return found
        if self.preset is not None:
            preset = PRESETS[self.preset]
            return _straight(self.hurst or preset.hurst, preset.deviation)
        hurst = self.hurst or found.hurst
        if self.rms_slope is not None:
            rise = portable.tan(np.radians(self.rms_slope.slope_deg))
            return _straight(hurst, float(rise * self.rms_slope.baseline_m ** (1.0 - hurst)))
        if self.deviation_1m_m is not None:
            return _straight(hurst, self.deviation_1m_m)
        if site.dtm is None or found.local is None:
            return _straight(hurst, found.deviation)
        # Another exponent turns the line about the shortest baseline that the DTM tells.
        joint = found.resolved * site.dtm.posting
        return _straight(hurst, found.deviation_over(joint) * joint**-hurst)

    def variation(self, site: Site, posts: Posts) -> NDArray[np.float64] | None:
        """RMS deviation around some of the DTM's posts, as a factor on that of all; or None.

        Where loose ground would not rest it is less: the RMS slope over one spacing is at most half
        the tangent of the angle of repose, which one place in forty then exceeds. Ground as steep
        at the DTM's own posting is rock, and of that it is at most 1.
        """
        found = site.roughness
        if not self._follows(site) or found.local is None or site.dtm is None:
            return None
        factors = np.asarray(found.local[posts] / found.deviation, np.float64)
        if self._given:
            return factors
        repose = site.body.repose
        loose = _CRAG if repose is None else _RESTING * float(portable.tan(repose))
        law = self.figures(site)
        slope, coarse = (
            self.gain * factors * law.deviation_over(length) / length
            for length in (site.spacing, site.dtm.posting)
        )
        limit = loose + (_CRAG - loose) * np.clip(2.0 * coarse / loose - 1.0, 0.0, 1.0)
        return np.asarray(factors * np.minimum(limit / np.maximum(slope, limit), 1.0))


def _grains(site: Site, hurst: float, posts: Posts) -> tuple[Grain, ...]:
    """Noise alike in all directions, and drawn out along four, each where the DTM's ground is so.

    Between two of the directions their shares of the variance add up to one.
    """
    grain = site.roughness.grain
    if grain is None or site.dtm is None:
        return ()
    # From the DTM's columns and rows to east and north, in terms of the doubled angle.
    (a, b), (c, d) = PixelFrame.of(site).per_metre
    cosine, sine = np.asarray(grain[:, *posts], np.float64)
    sine = sine if a * d - b * c > 0.0 else -sine
    across, up = (d, -c) if a * d - b * c > 0.0 else (-d, c)  # where columns run to
    double = (across**2 - up**2) / (across**2 + up**2), 2.0 * across * up / (across**2 + up**2)
    cosine, sine = cosine * double[0] - sine * double[1], cosine * double[1] + sine * double[0]
    size = np.sqrt(cosine**2 + sine**2)
    fall = _DRAWN_OUT ** (-2.0 * hurst)
    part = np.minimum(size * (1.0 + fall) / (1.0 - fall), 1.0)
    key = stage_key(site.seed, _STAGE)
    found = [Grain(key=key, turn=np.eye(2), factor=1.0, share=np.sqrt(1.0 - part))]
    towards = np.stack([cosine, sine, -cosine, -sine])
    shares = np.maximum(towards, 0.0) / np.maximum(np.abs(cosine) + np.abs(sine), 1e-300) * part
    half = math.sqrt(0.5)
    directions = ((1.0, 0.0), (half, half), (0.0, 1.0), (-half, half))
    for number, (x, y) in enumerate(directions):
        share = shares[number]
        if not share.any():
            continue
        turn = np.array([[x, y], [-y / _DRAWN_OUT, x / _DRAWN_OUT]])
        # Mean square differences along east and north, beside those of noise without direction.
        squares = portable.power(np.sum(turn**2, axis=0), hurst)
        factor = float(1.0 / np.sqrt(0.5 * (squares[0] + squares[1])))
        key = stage_key(site.seed, f"{_STAGE}/{number}")
        found.append(Grain(key=key, turn=turn, factor=factor, share=np.sqrt(share)))
    return tuple(found)


def detail_law(site: Site) -> Roughness | None:
    """The law of the detail that a site's first fractal layer makes; None where none makes any."""
    made = (one for one in site.recipe.terrain.layers if isinstance(one, Fractal) and one.gain)
    if (layer := next(made, None)) is None:
        return None
    law = layer.figures(site)
    return law.replace(deviation=layer.gain * law.deviation)


def _straight(hurst: float, deviation: float) -> Roughness:
    return Roughness(hurst=hurst, deviation=deviation, source="the recipe")


def octave_amplitudes(law: Roughness, wavelengths: Array) -> Array:
    """Factors of noise octaves, halving in wavelength, whose sum has the law's deviations.

    An endless sum of octaves λ with factors a·λ^H has the mean square difference a²·K(H)·L^2H,
    where K is the sum over all octaves of 2^(2Hn)·D(2^-n), averaged over a factor 2 of L.
    """
    return np.array(
        [law.deviation_over(w) / _mean_sum(law.exponent_over(w)) ** 0.5 for w in wavelengths]
    )


@cache
def _mean_sum(hurst: float) -> float:
    """K of an exponent."""
    sums = [
        _sum(hurst, d, _ALL) / d ** (2 * hurst) for d in portable.power(2.0, np.arange(8) / 8.0)
    ]
    return float(np.mean(sums))


def end_factors(hurst: float, wavelengths: Array, *, baselines: tuple[float, float]) -> Array:
    """Factors on octaves of which the first and the last stand for all that are missing.

    The longer ones are planes over a baseline much shorter than they, the shorter ones are white
    to nodes farther apart than they: one octave has the same mean square difference.

    Args:
        hurst: the exponent of the octaves.
        wavelengths: their lattice distances [m], the longest first.
        baselines: over which the first and the last make up for the longer and the shorter [m].
    """
    squares = np.ones(len(wavelengths))
    ends = zip((0, -1), baselines, (_ALL[_ALL > 0], _ALL[_ALL < 0]), strict=True)
    for end, baseline, missing in ends:
        away = float(baseline / wavelengths[end])
        squares[end] += _sum(hurst, away, missing) / structure_function(np.array(away))
    return np.asarray(np.sqrt(squares))


def _sum(hurst: float, distance: float, numbers: NDArray[np.int_]) -> float:
    """Mean square difference, over a distance, of octaves 2^n with the factors 2^(nH)."""
    wavelengths = portable.power(2.0, numbers)
    return float(
        np.sum(
            portable.power(wavelengths, 2.0 * hurst) * structure_function(distance / wavelengths)
        )
    )


def structure_function(distance: Array) -> Array:
    """Mean square difference of the unit noise; r² below the table, constant above it."""
    table = portable.log2(_STRUCTURE)
    steps = 2.0 * portable.log2(distance)
    inside = np.interp(steps, np.arange(-12, 9), table)
    return np.asarray(portable.power(2.0, np.where(steps < -12, table[0] + (steps + 12), inside)))
