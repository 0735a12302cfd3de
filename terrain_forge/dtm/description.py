"""What a raster is, in words for `terrain-forge check`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import DataError
from terrain_forge.dtm.projection import ellipsoid, geographic_crs, scale_error, transform
from terrain_forge.dtm.quality import assess
from terrain_forge.dtm.raster import Raster, ground_steps
from terrain_forge.dtm.roughness import COARSE_POSTING
from terrain_forge.dtm.vertical import FELT
from terrain_forge.model import Body, Site

_MOST_SAMPLES = 2**24
_PIECE, _PIECES = 256, 5
FEWEST_ACROSS = 4.0
"""Postings across a site below which its ground is nearly all invented."""
NATURAL = (0.5, 1.0)
"""Hurst exponents that ground has."""


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a raster is."""

    facts: tuple[tuple[str, str], ...]
    """Name and value, for a table."""
    warnings: tuple[str, ...]
    """What a user should know before building from it."""


def describe(raster: Raster, *, destaired: bool = False) -> Description:
    """Say what an open raster is, where it lies, what its numbers mean, what is wrong with it.

    Stairs that are smoothed, if `destaired`, are no wrong.
    """
    dataset, band = raster.dataset, raster.band
    rows, columns = raster.shape
    steps = ground_steps(raster)
    posting = max(steps) if steps else None
    values = _Values.read(raster)
    form = f"{dataset.driver}, {columns} × {rows} samples, {dataset.dtypes[band - 1]}"
    if dataset.count > 1:
        form += f", band {band} of {dataset.count}"
    facts = [
        ("format", form),
        ("place", _place(raster)),
        ("posting", _posting_text(raster)),
        ("values", _meaning(raster)),
        ("heights", values.range_text(raster)),
        ("nodata", f"{100 * values.missing:.1f} % of the samples{values.looked_at}"),
    ]
    if raster.quantum is None and values.heights.size:
        facts.append(("planar fill", f"{100 * values.planar:.1f} % of the samples lie in planes"))
    warnings = _warnings(raster, posting, values, destaired)
    return Description(facts=tuple(facts), warnings=tuple(warnings))


_BURIED = 3.0
"""RMS differences of neighbouring samples in a step from which on it buries the roughness: over
a quarter of a posting, ground of H = 0.6 and 0.9 came out 0.8 and 1 times as rough at 2.5, 2 and
1.1 times at 5, 3 and 13 times at 12."""
_TOWER = 4.0
"""Postings by which a single sample of real ground does not stand out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Values:
    """A look at the samples: all of a small raster, pieces all over a large one."""

    heights: NDArray[np.float64]
    missing: float
    whole: bool
    planar: float
    seams: tuple[str, ...]
    stripes: dict[str, float]
    """RMS of the steps between columns or rows [m], of each that has stripes."""
    difference: float
    """RMS difference of neighbouring samples [m] before heights were rounded."""
    spike: tuple[float, int, int]
    """Height of the highest single sample over its neighbours, or depth below them [m], and its row
    and column."""
    suspects: tuple[str, ...]

    @classmethod
    def read(cls, raster: Raster) -> _Values:
        whole = raster.shape[0] * raster.shape[1] <= _MOST_SAMPLES
        found, missing, planar, differences = [], [], [], []
        seams: list[str] = []
        stripes: dict[str, float] = {}
        spike = 0.0, 0, 0
        suspects: list[str] = []
        for rows, columns in _pieces(raster.shape, whole):
            try:
                heights, valid = raster.read(rows, columns)
            except DataError as error:
                suspects.append(str(error))
                heights, valid = raster.read(rows, columns, strict=False)
            found.append(heights[valid])
            missing.append(1.0 - valid.mean())
            if min(valid.shape) >= 8 and valid.any():
                quality = assess(heights, valid, quantum=raster.quantum)
                planar.append(quality.planar_fraction)
                differences.append(quality.difference)
                height, row, column = quality.spike
                spike = max(spike, (height, row + rows.start, column + columns.start))
                start = {"row": rows.start, "column": columns.start}
                seams += [f"{line} {n + start[line]}" for line, n, _ in quality.seams]
                for line, step in quality.stripes:
                    stripes[line] = max(step, stripes.get(line, 0.0))
        return cls(
            heights=np.concatenate(found),
            missing=float(np.mean(missing)),
            whole=whole,
            planar=float(np.mean(planar)) if planar else 0.0,
            seams=tuple(dict.fromkeys(seams)),
            stripes=stripes,
            difference=float(np.mean(differences)) if differences else 0.0,
            spike=spike,
            suspects=tuple(suspects[:1]),
        )

    def range_text(self, raster: Raster) -> str:
        if not self.heights.size:
            return f"no valid sample{self.looked_at}"
        low, high = self.heights.min(), self.heights.max()
        unit = "m" if raster.vertical.known else "(no vertical scale: raw numbers)"
        return f"{low:.8g} to {high:.8g} {unit}{self.looked_at}"

    @property
    def looked_at(self) -> str:
        return "" if self.whole else " in the pieces looked at"


def _lengths(error: float) -> str:
    """How true a site's lengths are, off by a fraction at its edge."""
    millimetres = 1e6 * error  # in a kilometre
    if millimetres < 0.1:
        return "true throughout, to 0.1 mm in a kilometre"
    told = f"{float(f'{millimetres:.1g}'):g}"
    return f"true in the middle, off by {told} mm in a kilometre at the edge"


def site_facts(site: Site) -> list[str]:
    """Lines that say what became of the DTM of a site that is planned."""
    facts = []
    if site.crs:
        facts.append(f"lengths      {_lengths(scale_error(site.crs, site.size))}")
    if site.dtm is not None:
        rows, columns = site.dtm.heights.shape
        facts.append(f"context      {columns} × {rows} samples of {_metres(site.dtm.posting)}")
        facts += [f"repair       {repair}" for repair in site.dtm.repairs]
        if site.dtm.planar_fraction > 0.001:
            share = 100 * site.dtm.planar_fraction
            facts.append(f"planar fill  {share:.1f} % of the samples around lie in exact planes")
    facts += [f"warning      {warning}" for warning in site_warnings(site)]
    return facts


LONGEST_HIDDEN = 8
"""Waves [posts] above which what noise hides is a guess; roughness is fitted over 1 and 2."""


def site_warnings(site: Site) -> list[str]:
    """What a user should know of the ground that a site's DTM makes."""
    dtm, roughness = site.dtm, site.roughness
    if dtm is None:
        return []
    found = []
    across = min(site.size) / dtm.posting
    if across < FEWEST_ACROSS:
        found.append(
            f"the site is {across:.2g} postings wide, {_metres(dtm.posting)} each: nearly all of "
            "its ground is invented"
        )
    found += odd_heights(dtm.heights, site.body)
    if dtm.noise:
        found.append(
            f"the DTM had noise of {_metres(dtm.noise)} RMS, which was taken away: heights are the "
            "DTM's within that only; dtm.noise: keep leaves it in, a figure says how much it is"
        )
    if dtm.doubt and dtm.doubtful < 1.0:
        found.append(
            f"at least {dtm.doubtful:.0%} of the DTM seems to have noise of {_metres(dtm.doubt)} "
            "RMS, in the rest none was found: it is left in, and may make the ground there too "
            "rough; choose another part, or give dtm.noise, which smooths the rest too"
        )
    elif dtm.doubt:
        found.append(
            f"the DTM may have noise of {_metres(dtm.doubt)} RMS: that fits it better than ground "
            "alone, but not clearly; it is left in and continued as ground; as dtm.noise a figure "
            "takes it away, keep says that it is ground"
        )
    if dtm.hidden > LONGEST_HIDDEN * dtm.posting:
        found.append(
            f"that noise hid all waves up to {_metres(dtm.hidden)}, {dtm.hidden / dtm.posting:.2g} "
            f"posts, where roughness is fitted over 1 and 2: the ground's waves up to "
            "there are all made as the longer ones tell; a mare whose craters end there came out "
            "up to 62 % too rough (docs/terrain.md)"
        )
    if roughness.exponent is not None:
        fitted, error = roughness.exponent
        low, high = NATURAL
        if fitted + 2.0 * error < low:
            found.append(
                f"the exponent fitted to the DTM, {fitted:.2f} ± {error:.2f}, is below {low:g}: "
                f"rougher than ground is at its posting, as noise is; a fractal layer without its "
                f"own takes {roughness.hurst:.2f}; where the noise is known, give it as dtm.noise"
            )
        elif fitted - 2.0 * error > high:
            found.append(
                f"the exponent fitted to the DTM, {fitted:.2f} ± {error:.2f}, is above {high:g}: "
                "smoother than ground is at its posting; a fractal layer without its own takes "
                f"{roughness.hurst:.2f}"
            )
    return found


def odd_heights(heights: NDArray[np.float64], body: Body) -> list[str]:
    """A warning of heights that no ground of the body has; none if all can be."""
    if body.relief is None or not heights.size:
        return []
    low, high = float(heights.min()), float(heights.max())
    if body.relief[0] <= low and high <= body.relief[1]:
        return []
    return [
        f"heights of {low:.6g} to {high:.6g} m are beyond {body.name}'s, {body.relief[0]:g} to "
        f"{body.relief[1]:g} m: another unit, datum or no data? See dtm.height_scale, "
        "dtm.height_offset_m, dtm.nodata"
    ]


def _pieces(shape: tuple[int, int], whole: bool) -> list[tuple[slice, slice]]:
    """The raster as one piece, or a few of it on a grid."""
    rows, columns = shape
    if whole:
        return [(slice(0, rows), slice(0, columns))]
    size = (min(_PIECE, rows), min(_PIECE, columns))
    starts = [
        np.linspace(0, n - piece, _PIECES).astype(int).tolist()
        for n, piece in zip(shape, size, strict=True)
    ]
    return [
        (slice(row, row + size[0]), slice(column, column + size[1]))
        for row in dict.fromkeys(starts[0])
        for column in dict.fromkeys(starts[1])
    ]


def _posting_text(raster: Raster) -> str:
    steps = ground_steps(raster)
    if steps is None:
        return "unknown"
    across, down = steps
    if abs(across / down - 1.0) < 2e-3:
        return _metres(max(steps))
    return f"{_metres(across)} along rows, {_metres(down)} along columns, in true metres"


def _place(raster: Raster) -> str:
    if not raster.crs:
        known = (
            "its size on the ground comes from the recipe" if raster.to_pixel else "no size known"
        )
        return f"not georeferenced, {known}"
    from rasterio.crs import CRS

    x, y = raster.middle
    lon, lat = transform(raster.crs, geographic_crs(raster.crs), np.array([x]), np.array([y]))
    name = raster.crs.split('"')[1]
    kind = "longitude and latitude" if CRS.from_wkt(raster.crs).is_geographic else name
    return f"{kind}, centre {lon[0]:.4f}° E {lat[0]:.4f}° N"


def _meaning(raster: Raster) -> str:
    dtype, v = raster.dataset.dtypes[raster.band - 1], raster.vertical
    unit = "kilometres" if v.scale == 1000.0 else "metres"
    assumed = f"; the file declares no unit: {unit} are assumed" if v.assumed else ""
    if v.reference_radius:
        sphere = not raster.crs or len(set(ellipsoid(raster.crs))) == 1
        above = "" if sphere else " in the middle, above the ellipsoid elsewhere"
        return (
            f"radius: value × {v.scale:g} + {v.offset:.10g} m from the body's centre; "
            f"heights are taken above {v.reference_radius:.10g} m{above}{assumed}"
        )
    if not v.known:
        return f"unknown: {dtype} without a vertical scale, an image or a stretched height map"
    stated = f", the file says {v.unit!r}" if v.unit else assumed
    if (v.scale, v.offset) == (1.0, 0.0):
        return f"height above the datum in metres{stated}"
    return f"height: value × {v.scale:.6g} + {v.offset:g} m{stated}"


def _times(ratio: float) -> str:
    return f"{ratio:.2g}" if ratio < 10.0 else f"{ratio:.0f}"


def _warnings(raster: Raster, posting: float | None, values: _Values, destaired: bool) -> list[str]:
    found = []
    if not values.heights.size:
        found.append(
            "no valid sample: nothing can be built from it"
            if values.whole
            else "no valid sample in the pieces looked at: most of it is empty"
        )
    if not raster.to_pixel:
        found.append("without georeference: give its size on the ground as dtm.extent_m")
    if not raster.vertical.known:
        found.append("without vertical scale: give dtm.height_range_m or dtm.height_scale")
    if raster.vertical.known and raster.vertical.scale < 0.0:
        found.append(
            f"a scale of {raster.vertical.scale:g}: the larger a number, the lower its ground, as "
            "of depths; if they are heights, give dtm.height_scale"
        )
    coarse = posting is not None and posting > COARSE_POSTING
    if posting and coarse:
        found.append(
            f"a posting of {_metres(posting)} is too coarse for a rover: the ground between the "
            "samples would be invented"
        )
    quantum = raster.quantum
    dtype = np.dtype(raster.dataset.dtypes[raster.band - 1])
    stairs = quantum is not None and (dtype.itemsize == 1 or quantum >= FELT)
    if quantum and stairs and raster.vertical.known and not coarse:
        if not destaired:
            found.append(
                f"{dtype}: heights come in stairs of {_metres(quantum)}, which a wheel feels; "
                "dtm.destair smooths them"
            )
        if quantum > _BURIED * values.difference > 0.0:
            found.append(
                f"a step is {_times(quantum / values.difference)} times the RMS difference of "
                f"neighbouring samples, {_metres(values.difference)}: how rough the ground is "
                "below it is not known; it may come out several times too rough, or with "
                "dtm.destair too smooth; a fractal layer's hurst and deviation_1m_m say how rough"
            )
    found += values.suspects
    if raster.vertical.known and not values.suspects:
        found += odd_heights(values.heights, raster.body)
    if raster.vertical.odd_unit:
        found.append(
            f"unit {raster.vertical.unit!r} is no length that is known: a recipe must give "
            "dtm.height_scale"
        )
    if values.planar > 0.01:
        found.append(
            f"{100 * values.planar:.1f} % lie in exact planes: gaps between matched points that "
            "were filled by triangles"
        )
    if values.seams:
        shown = ", ".join(values.seams[:4]) + (", …" if len(values.seams) > 4 else "")
        found.append(f"the ground steps along {shown}: seams of images or strips")
    height, row, column = values.spike
    if posting and not coarse and height > _TOWER * posting:
        found.append(
            f"a single sample stands {_metres(height)} above or below all around it: a spike, at "
            f"row {row}, column {column}"
        )
    for line, step in values.stripes.items():
        found.append(
            f"stripes along its {line}s: steps of {_metres(step)} RMS between them go all along, "
            "and will in the ground"
        )
    if raster.dataset.count > 1:
        found.append(f"{raster.dataset.count} bands: dtm.band chooses the one with the heights")
    return found


def _metres(length: float) -> str:
    if length >= 1000.0:
        return f"{length / 1000:.4g} km"
    return f"{length:.3g} m" if length >= 0.5 else f"{length * 100:.2g} cm"
