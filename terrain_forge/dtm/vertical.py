"""How a raster's numbers become heights above the body's datum."""

from __future__ import annotations

from dataclasses import dataclass
from json import JSONDecoder
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import DataError
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.model import Body

_METRES = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("km", "kilometre", "kilometres", "kilometer", "kilometers"), 1000.0),
    **dict.fromkeys(("dm", "decimetre", "decimeter"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimetres", "centimeter", "centimeters"), 0.01),
    **dict.fromkeys(("mm", "millimetre", "millimetres", "millimeter", "millimeters"), 0.001),
    **dict.fromkeys(("ft", "foot", "feet", "international foot"), 0.3048),
    **dict.fromkeys(("us survey foot", "us survey feet", "ftus"), 1200.0 / 3937.0),
}
_NO_UNIT = "N/A", "NULL", "UNK", "NONE"
_SENTINELS = (-9999.0, -99999.0, -32768.0, -32767.0, 32767.0, 65535.0, 9999.0, 99999.0)
_FEWEST_LEVELS, _REPEATED, _OFF_LEVEL, _COARSER = 3, 0.25, 0.1, 16.0
_DOUBLE = np.dtype(np.float64)
FELT = 0.02
"""Height [m] of stairs that a wheel feels."""
_FARTHEST = 0.05
"""Part of a body's radius beyond which no ground lies; Mars reaches 0.0065 of it."""


@dataclass(frozen=True, kw_only=True)
class Vertical:
    """Height above the datum [m] = value × scale + offset − reference_radius."""

    scale: float
    """Metres per unit."""
    offset: float
    """Height of the value 0 above the datum, or the distance from the centre of a radius product
    [m]."""
    reference_radius: float
    """What is taken off a radius product to make heights of it, at the raster's middle [m]; 0 for
    heights."""
    known: bool
    """Whether the file or the recipe says how its numbers become metres."""
    unit: str
    """The unit that the file declares; empty if none."""
    quantum: float | None = None
    """Step of which heights are multiples, where they are not merely a float's [m]."""
    assumed: bool = False
    """Whether neither the file nor the recipe says in which unit its numbers are."""

    @property
    def odd_unit(self) -> bool:
        """Whether the file declares a unit that is no length that we know."""
        return bool(self.unit) and metres_of(self.unit) is None


def metres_of(unit: str) -> float | None:
    """Metres of a unit of length by its name, None if it is none."""
    return _METRES.get(unit.strip(" <>").lower())


def unit_of(dataset: Any, band: int) -> str:
    """The unit that a raster declares of a band, counted from 0; empty where it declares none.

    Of a PDS3 label GDAL passes on scale and offset alone.
    """
    if dataset.units[band] or "json:PDS" not in dataset.tag_namespaces():
        return dataset.units[band] or ""
    *_, text = "".join(dataset.tags(ns="json:PDS").values()).partition('"IMAGE":')
    image, _ = JSONDecoder().raw_decode(text.strip() or "{}")  # what follows is of other objects
    unit = str(image.get("UNIT", "") if isinstance(image, dict) else "").strip("' ")
    return "" if unit.upper() in _NO_UNIT else unit


def read_vertical(dataset: Any, spec: RasterDtm, datum: float, body: Body) -> Vertical:
    """Scale, offset and unit of a raster's band, of the file or, where it tells, of the recipe.

    Numbers around the body's radius are distances from its centre, whether the file says so in its
    offset or its values say so themselves.

    Args:
        dataset: the open rasterio dataset.
        spec: the recipe's wishes.
        datum: radius of the datum at the raster's middle [m].
        body: whose radius the numbers may lie around.

    Raises:
        DataError: for a height range of a raster that does not hold integers, or a scale of 0 or
            that is not finite, as an offset.
    """
    band = spec.band - 1
    dtype = np.dtype(dataset.dtypes[band])
    unit, sample = unit_of(dataset, band), _sample(dataset, spec)
    typical = float(np.median(sample)) if sample.size else 0.0
    if spec.height_range_m is not None:
        low, high = _range(spec, dtype)
        scale, offset, known = (high - low) / float(np.iinfo(dtype).max), low, True
    else:
        metres = metres_of(unit) or _kilometres(typical, dataset, spec, body)
        scale, offset = dataset.scales[band] * metres, dataset.offsets[band] * metres
        declared = (scale, offset) != (1.0, 0.0) or spec.height_scale is not None
        known = declared or dtype.kind != "u" or metres_of(unit) is not None
        scale = scale if spec.height_scale is None else spec.height_scale
        offset = offset if spec.height_offset_m is None else spec.height_offset_m
        _require_scale(spec, scale, offset)
    step = 1.0 if dtype.kind in "iu" else height_step(sample, dtype, scale)
    is_radius = _around(offset, body) or _around(typical * scale + offset, body)
    return Vertical(
        scale=scale,
        offset=offset,
        reference_radius=datum if is_radius else 0.0,
        known=known,
        unit=unit,
        quantum=abs(scale) * step or None,
        assumed=not unit and spec.height_scale is None and spec.height_range_m is None,
    )


def require_no_sentinel(values: NDArray[np.float64], source: str, *, cliff: float) -> None:
    """Refuse numbers that stand for no data though neither file nor recipe says so.

    Such are -9999, -32768 and their like, farther from all other values than these are apart; and
    any other number that occurs several times and stands as far beyond the rest, by a cliff that no
    ground has.

    Args:
        values: numbers of the file.
        source: its name.
        cliff: difference between neighbours that is no ground's [units of the file].

    Raises:
        DataError: naming the value.
    """
    ends = [float(values.min()), float(values.max())] if values.size else []
    for suspect in dict.fromkeys((*_SENTINELS, *ends)):
        found = values == suspect
        if not found.any() or found.all():
            continue
        others = {"where": ~found}
        lowest = values.min(initial=np.inf, **others)
        highest = values.max(initial=-np.inf, **others)
        below = values.max(initial=-np.inf, where=values < suspect)
        above = values.min(initial=np.inf, where=values > suspect)
        gap, width = min(suspect - below, above - suspect), highest - lowest
        listed = suspect in _SENTINELS and gap > max(width, 1.0)
        if listed or (found.sum() > 1 and width > 0.0 and gap > max(width, cliff)):
            raise DataError(
                f"{source} holds {found.sum()} samples of the value {suspect:.10g} beside values "
                f"of {lowest:g} to {highest:g}: if it means no data, give dtm.nodata: "
                f"{suspect:.10g} (dtm.nodata_range for several such); if it is a height, choose a "
                "place away from it by dtm.centre",
                key=("dtm", "nodata"),
            )


def no_ground(heights: NDArray[np.float64], body: Body) -> float:
    """How far heights lie from the datum [m], if no ground of a body lies so far; else 0."""
    farthest = float(np.abs(heights).max(initial=0.0))
    return farthest if farthest > _FARTHEST * body.mean_radius else 0.0


def require_heights(heights: NDArray[np.float64], source: str, body: Body) -> None:
    """Refuse heights that are none: as large as the body itself.

    Raises:
        DataError: with what they reach.
    """
    if farthest := no_ground(heights, body):
        raise DataError(
            f"{source} has heights of {farthest:.4g} m from the datum, {body.name}'s radius is "
            f"{body.mean_radius:.4g} m: if these are no data, give dtm.nodata; if another unit, "
            "dtm.height_scale; if radii, dtm.height_offset_m",
            key=("dtm", "source"),
        )


def _require_scale(spec: RasterDtm, scale: float, offset: float) -> None:
    """Refuse a band's scale [m] and offset [m] that make no heights of its numbers."""
    if scale == 0.0 or not np.isfinite(scale):
        raise DataError(
            f"the band's scale in {spec.name} is {scale:g}, which makes no heights of its numbers: "
            "give dtm.height_scale, metres for each of them",
            key=("dtm", "source"),
        )
    if not np.isfinite(offset):
        raise DataError(
            f"the band's offset in {spec.name} is {offset:g}: give dtm.height_offset_m, the height "
            "of the number 0 in metres",
            key=("dtm", "source"),
        )


def _range(spec: RasterDtm, dtype: np.dtype[Any]) -> tuple[float, float]:
    assert spec.height_range_m is not None
    if dtype.kind not in "iu":
        raise DataError(
            f"the heights of {spec.name} are {dtype}; a height range is for integers, "
            "use height_scale and height_offset_m",
            key=("dtm", "height_range_m"),
        )
    return spec.height_range_m


def _around(value: float, body: Body) -> bool:
    return abs(value / body.mean_radius - 1.0) <= 0.05


def _kilometres(typical: float, dataset: Any, spec: RasterDtm, body: Body) -> float:
    """1000 if the numbers, of no unit, lie around the body's radius in kilometres; else 1."""
    band = spec.band - 1
    value = typical * dataset.scales[band] + dataset.offsets[band]
    known = any((spec.height_scale, spec.height_offset_m, unit_of(dataset, band)))
    return 1000.0 if not known and _around(1000.0 * value, body) else 1.0


def require_known_unit(vertical: Vertical, spec: RasterDtm) -> None:
    """Refuse heights in a unit that is no known length, unless the recipe tells their scale.

    Raises:
        DataError: naming the unit.
    """
    if vertical.odd_unit and spec.height_scale is None and spec.height_range_m is None:
        raise DataError(
            f"the heights of {spec.name} are in {vertical.unit!r}, which is no length that is "
            "known: give dtm.height_scale, metres for each of them (1 if they are metres)",
            key=("dtm", "source"),
        )


def _sample(dataset: Any, spec: RasterDtm) -> NDArray[np.float64]:
    """Values of a few small pieces of the raster, of more where these hold no data."""
    for pieces in (5, 17, 65):
        found = _sampled(dataset, spec, pieces)
        if found.size:
            break
    return found


def height_step(
    values: NDArray[np.float64], dtype: np.dtype[Any] = _DOUBLE, scale: float = 1.0
) -> float:
    """Number of which all values of a raster of floats are multiples, but for an offset; else 0.

    Floats of their own are so coarse where radii are kept in single precision.
    """
    finest = float(np.spacing(np.abs(np.median(values)).astype(dtype))) if values.size else 0.0
    if abs(scale) * finest >= FELT:
        return finest
    levels = np.unique(values)
    if len(levels) < _FEWEST_LEVELS or len(levels) > _REPEATED * values.size:
        return 0.0
    exact = float(np.spacing(np.float32(np.abs(levels).max())))
    step = float(np.diff(levels).min())
    off = (levels - levels[0]) / step % 1.0
    wrong = np.minimum(off, 1.0 - off) > _OFF_LEVEL
    return 0.0 if step < _COARSER * exact or wrong.any() else step


def _sampled(dataset: Any, spec: RasterDtm, pieces: int) -> NDArray[np.float64]:
    """Valid values of so many pieces each way."""
    from rasterio.windows import Window

    size = 8
    values = []
    for across in np.linspace(0.1, 0.9, pieces):
        for down in np.linspace(0.1, 0.9, pieces):
            window = Window(
                int(across * max(dataset.width - size, 0)),
                int(down * max(dataset.height - size, 0)),
                min(size, dataset.width),
                min(size, dataset.height),
            )
            piece = dataset.read(spec.band, window=window).astype(np.float64)
            mask = dataset.read_masks(spec.band, window=window) > 0
            values.append(piece[mask & np.isfinite(piece) & (np.abs(piece) < 1e30)])
    found = np.concatenate(values)
    if spec.nodata is not None:
        found = found[found != spec.nodata]
    if spec.nodata_range is not None:
        low, high = spec.nodata_range
        found = found[(found < low) | (found > high)]
    return found
