"""From the recipe's `dtm` part to a patch of heights and the site's place on its body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, DataError, Mask, RecipeError, reading, stage_key
from terrain_forge.dtm.denoising import denoised
from terrain_forge.dtm.far import (
    heights_at,
    read_surroundings,
    require_coarser,
    weights_at,
)
from terrain_forge.dtm.interpolation import cubic
from terrain_forge.dtm.landforms import landforms
from terrain_forge.dtm.lattice import patch_pixels
from terrain_forge.dtm.noise_floor import FoundNoise, NoiseFloor, find_noise
from terrain_forge.dtm.noisy_part import find_noisy_part
from terrain_forge.dtm.point_posts import are_points, means_of_points
from terrain_forge.dtm.projection import (
    body_crs,
    geographic_crs,
    local_crs,
    pole_distance,
    transform,
)
from terrain_forge.dtm.quality import planar_posts
from terrain_forge.dtm.raster import Raster, ground_steps, open_raster
from terrain_forge.dtm.reading import read_patch
from terrain_forge.dtm.roughness import body_roughness, fit_roughness
from terrain_forge.dtm.spec import ArrayDtm, FlatDtm, HorizonSpec, Noise, RasterDtm
from terrain_forge.dtm.vertical import height_step, no_ground, require_known_unit
from terrain_forge.model import Body, DtmPatch, FarHeights, Roughness

_NEAR_POLE = 64
"""Samples from a pole within which a map of longitudes is not followed."""
_LASTING = 0.5
"""Of the noise that is found, part that must be there without landforms."""
_FARTHEST = 0.25
"""Part of the body's radius that ground goes on from the border at most."""


@dataclass(frozen=True, kw_only=True)
class Survey:
    """What planning learns from the DTM; the fields are those of `Site`."""

    crs: str
    lonlat: tuple[float, float] | None
    datum_height: float
    slope: tuple[float, float]
    dtm: DtmPatch | None
    roughness: Roughness
    surroundings: tuple[FarHeights, ...]


def survey(
    spec: RasterDtm | FlatDtm | ArrayDtm,
    *,
    body: Body,
    folder: Path,
    heights: Array | None,
    seed: int = 0,
    horizon: HorizonSpec | None = None,
) -> Survey:
    """Read the heights around the site and resolve everything that depends on them.

    Args:
        spec: the recipe's `dtm`.
        body: what it is a part of.
        folder: what its paths are relative to.
        heights: those of a spec of kind `array` [m].
        seed: of the ground that is drawn where a DTM's noise hides it.
        horizon: what lies beyond the site.

    Raises:
        DataError, RecipeError: if the DTM cannot serve as the recipe says.
    """
    horizon = horizon or HorizonSpec()
    _require_near(horizon, body)
    if heights is not None and not isinstance(spec, ArrayDtm):
        raise RecipeError(
            f"`heights` are given, but the recipe's dtm is of kind {spec.kind!r}; only "
            "`kind: array` takes them",
            key=("dtm",),
        )
    if isinstance(spec, FlatDtm):
        crs, lonlat = _place(spec.lonlat_deg, body)
        return Survey(
            crs=crs,
            lonlat=lonlat,
            datum_height=0.0,
            slope=(0.0, 0.0),
            dtm=None,
            roughness=body_roughness(body, "flat site"),
            surroundings=_beyond(horizon, None, crs, spec.size_m, body, folder),
        )
    around: tuple[FarHeights, ...] = ()
    if isinstance(spec, ArrayDtm):
        crs, lonlat = _place(spec.lonlat_deg, body)
        patch, measured = _array_patch(spec, body, heights)
    else:
        crs, lonlat, patch, measured, around = _raster_patch(spec, body, folder, horizon)
    around += _beyond(horizon, patch, crs, spec.size_m, body, folder)
    patch, floor = _without_noise(patch, measured, spec.noise, seed)
    datum_height, slope = _datum(patch, crs, spec.size_m, level=spec.level == "plane")
    return Survey(
        crs=crs,
        lonlat=lonlat,
        datum_height=datum_height,
        slope=slope,
        dtm=patch,
        roughness=fit_roughness(patch.heights, patch.posting, body, measured, floor),
        surroundings=around,
    )


def _require_near(horizon: HorizonSpec, body: Body) -> None:
    """Refuse ground that goes on to where the body has long turned it out of sight."""
    most = _FARTHEST * body.mean_radius
    if horizon.reach_m is not None and horizon.reach_m > most:
        raise RecipeError(
            f"{horizon.reach_m:g} m: at most {int(most):d} m, a quarter of the radius of "
            f"{body.name}; without it the ground goes on to the true horizon",
            key=("horizon", "reach_m"),
        )


def _beyond(
    horizon: HorizonSpec,
    patch: DtmPatch | None,
    crs: str,
    size: tuple[float, float],
    body: Body,
    folder: Path,
) -> tuple[FarHeights, ...]:
    """What a second terrain model tells of the ground far around, at the site's height."""
    if horizon.dtm is None or horizon.reach_m == 0.0:
        return ()
    if not crs:
        raise DataError("a second terrain model needs a georeferenced site", key=("horizon", "dtm"))
    spec = RasterDtm(source=horizon.dtm, size_m=size)
    with reading(horizon.dtm, key=("horizon", "dtm")):
        try:
            raster = open_raster(spec, body=body, folder=folder)
        except DataError as error:  # which names the keys of the site's own
            raise DataError(str(error), key=("horizon", "dtm")) from None
        with raster.dataset:
            require_coarser(raster, horizon.dtm)
            levels = read_surroundings(
                raster,
                source=horizon.dtm,
                crs=crs,
                to_pixel=raster.to_pixel,
                size=size,
                reach=horizon.reach_m,
            )
    steps = np.linspace(-0.5, 0.5, 9)
    east, north = np.meshgrid(steps * size[0], steps * size[1])
    if not levels or float(weights_at(levels[0], crs, east, north).min()) < 0.999:
        why, widest = "", max(ground_steps(raster) or (0.0,))
        if raster.goes_round and pole_distance(crs, size) < _NEAR_POLE * widest:
            why = ": it is a map of longitudes, which ends at the pole; take a polar product"
        text = f"{horizon.dtm} does not reach around the site{why}"
        raise DataError(text, key=("horizon", "dtm"))
    own = 0.0
    if patch is not None:
        column, row = patch_pixels(patch, crs, east, north)
        own = float(cubic(patch.heights, column=column, row=row).mean())
    rise = own - float(heights_at(levels[0], crs, east, north).mean())
    return tuple(level.replace(heights=level.heights + np.float32(rise)) for level in levels)


def _without_noise(
    patch: DtmPatch, measured: Mask, noise: Noise, seed: int
) -> tuple[DtmPatch, NoiseFloor | None]:
    """The patch without the noise that the recipe says or lets look for, and what it was."""
    if noise in ("keep", 0.0):
        return patch, None
    given = None if isinstance(noise, str) else noise
    step = height_step(patch.heights[measured])
    found, forms = _noise_beside_forms(patch, measured, given, step)
    floor, patch = found.floor, patch.replace(doubt=found.doubt)
    if floor is None and given is None and not found.doubt:
        noisy, part = find_noisy_part(patch.heights, patch.posting, measured, step=step)
        patch = patch.replace(doubt=noisy, doubtful=part) if noisy else patch
    if floor is None and given is not None:
        kept = (
            f"noise of {given:.2g} m could not be told from the ground, it is kept: that takes "
            "64 × 64 measured posts, and noise that makes up 1 to 200 % of their square differences"
        )
        return patch.replace(repairs=(*patch.repairs, kept)), None
    if floor is None and are_points(patch.heights, measured):
        return _with_means(patch), None
    if floor is None:
        return patch, None
    source = "found in" if given is None else "said to be in"
    told = (
        f"noise of {floor.deviation:.2g} m RMS {source} the DTM, alike over "
        f"{floor.correlation:.2g} posts: filtered; waves up to {floor.longest:.2g} posts, which it "
        "hides, are drawn as the longer ones tell"
    )
    key = stage_key(seed, "dtm/noise")
    heights = forms + denoised(patch.heights - forms, floor, key, measured)
    repairs = (*patch.repairs, told)
    hidden = floor.longest * patch.posting
    denoised_patch = patch.replace(
        heights=heights, repairs=repairs, noise=floor.deviation, hidden=hidden
    )
    return denoised_patch, floor


def _noise_beside_forms(
    patch: DtmPatch, measured: Mask, given: float | None, step: float
) -> tuple[FoundNoise, Array]:
    """The noise of the patch, and the landforms that stand out of it [m].

    They are no noise, but forms of one size have the spectrum of some: noise is what is found
    without them too, and not much less. A figure that is given needs no such proof.
    """
    found = find_noise(patch.heights, patch.posting, measured, given, step=step)
    none = np.zeros(patch.heights.shape)
    if found.floor is None:
        return found, none
    forms = landforms(patch.heights, measured)
    rest = find_noise(patch.heights - forms, patch.posting, measured, given, step=step)
    if given is not None:
        return (found, none) if rest.floor is None else (rest, forms)
    if rest.floor is None or rest.floor.deviation < _LASTING * found.floor.deviation:
        return FoundNoise(doubt=found.floor.deviation), forms
    return rest, forms


def _with_means(patch: DtmPatch) -> DtmPatch:
    """The patch with the means of its pixels for heights of points."""
    heights = means_of_points(patch.heights)
    away = float(np.std(heights - patch.heights))
    told = (
        "posts are heights of points, not means of their pixels: means are made of them, "
        f"{away:.2g} m RMS away; if they are means with noise, give it as dtm.noise"
    )
    return patch.replace(heights=heights, repairs=(*patch.repairs, told))


def _place(
    lonlat_deg: tuple[float, float] | None, body: Body
) -> tuple[str, tuple[float, float] | None]:
    if lonlat_deg is None:
        return "", None
    lon, lat = np.radians(lonlat_deg)
    return local_crs(body_crs(body.mean_radius), *lonlat_deg), (float(lon), float(lat))


def _array_patch(spec: ArrayDtm, body: Body, heights: Array | None) -> tuple[DtmPatch, Mask]:
    if heights is None:
        raise RecipeError(
            "`kind: array` takes its heights from plan(recipe, heights=…)", key=("dtm",)
        )
    if np.ma.is_masked(heights):
        raise RecipeError("heights that are masked: a number for each post", key=("dtm",))
    values = np.asarray(heights, np.float64)
    if values.ndim != 2 or min(values.shape) < 2 or not np.isfinite(values).all():
        raise RecipeError(f"heights of shape {values.shape}: a finite 2-D array", key=("dtm",))
    if farthest := no_ground(values, body):
        raise RecipeError(
            f"heights of {farthest:.4g} m from the datum, {body.name}'s radius is "
            f"{body.mean_radius:.4g} m: metres above the datum",
            key=("dtm",),
        )
    extent = tuple((n - 1) * spec.posting_m for n in values.shape[::-1])
    if any(size > have * (1 + 1e-9) for size, have in zip(spec.size_m, extent, strict=True)):
        raise RecipeError(
            f"size {spec.size_m} m is larger than the array, {extent} m", key=("dtm", "size_m")
        )
    rows, columns = values.shape
    step = 1.0 / spec.posting_m
    to_pixel = (step, 0.0, (columns - 1) / 2, 0.0, step, (rows - 1) / 2)
    planar = planar_posts(values)
    patch = DtmPatch(
        heights=values,
        to_pixel=to_pixel,
        crs="",
        wrap=(0.0, 0.0),
        posting=spec.posting_m,
        filled=0,
        planar_fraction=float(planar.mean()),
    )
    return patch, ~planar


def _raster_patch(
    spec: RasterDtm, body: Body, folder: Path, horizon: HorizonSpec
) -> tuple[str, tuple[float, float] | None, DtmPatch, Mask, tuple[FarHeights, ...]]:
    raster = open_raster(spec, body=body, folder=folder)
    with raster.dataset:
        require_meaning(raster, spec)
        if raster.crs:
            lon, lat = centre_lonlat(raster, spec)
            crs = local_crs(raster.crs, lon, lat)
            lonlat = (float(np.radians(lon)), float(np.radians(lat)))
            around = _around(raster, spec, crs, raster.to_pixel, horizon)
            return crs, lonlat, *read_patch(raster, spec, crs, raster.to_pixel), around
        if spec.centre.offset_m is None:
            raise DataError(
                f"{spec.name} is not georeferenced: give the centre as offset_m",
                key=("dtm", "centre"),
            )
        a, _, c, _, e, f = raster.to_pixel
        east, north = spec.centre.offset_m
        shifted = (a, 0.0, c + a * east, 0.0, e, f + e * north)
        around = _around(raster, spec, "", shifted, horizon)
        return "", None, *read_patch(raster, spec, "", shifted), around


def _around(
    raster: Raster,
    spec: RasterDtm,
    crs: str,
    to_pixel: tuple[float, ...],
    horizon: HorizonSpec,
) -> tuple[FarHeights, ...]:
    """What the site's own terrain model tells of the ground around."""
    if horizon.reach_m == 0.0:
        return ()
    reach = horizon.reach_m
    return read_surroundings(
        raster, source=spec.name, crs=crs, to_pixel=to_pixel, size=spec.size_m, reach=reach,
        followed=horizon.dtm is not None,
    )  # fmt: skip


def require_meaning(raster: Raster, spec: RasterDtm) -> None:
    """Refuse a terrain model of which it is not known where it lies or how high it is, anywhere.

    Raises:
        DataError: with the key of the recipe that tells it.
    """
    if not raster.to_pixel:
        raise DataError(
            f"{spec.name} has no georeference: give its size on the ground as dtm.extent_m",
            key=("dtm", "source"),
        )
    if not raster.vertical.known:
        dtype = raster.dataset.dtypes[raster.band - 1]
        raise DataError(
            f"the vertical scale of {spec.name} ({dtype}) is unknown: give dtm.height_range_m or "
            "dtm.height_scale",
            key=("dtm", "source"),
        )
    require_known_unit(raster.vertical, spec)


def centre_lonlat(raster: Raster, spec: RasterDtm) -> tuple[float, float]:
    """Longitude and latitude of the site's centre [degrees]."""
    if spec.centre.lonlat_deg is not None:
        return spec.centre.lonlat_deg
    geographic = geographic_crs(raster.crs)
    if spec.centre.crs is not None:
        return _transform_point(raster.crs, geographic, spec.centre.crs)
    middle = local_crs(raster.crs, *_transform_point(raster.crs, geographic, raster.middle))
    return _transform_point(middle, geographic, spec.centre.offset_m or (0.0, 0.0))


def _transform_point(source: str, target: str, point: tuple[float, float]) -> tuple[float, float]:
    x, y = transform(source, target, np.array([point[0]]), np.array([point[1]]))
    return float(x[0]), float(y[0])


def _datum(
    patch: DtmPatch, crs: str, size: tuple[float, float], *, level: bool
) -> tuple[float, tuple[float, float]]:
    """Height of world z = 0 [m] and the plane's rise per metre east and north."""
    steps = np.linspace(-0.5, 0.5, 65)
    east, north = np.meshgrid(steps * size[0], steps * size[1])
    column, row = patch_pixels(patch, crs, east, north)
    heights = cubic(patch.heights, column=column, row=row)
    if not level:
        return float(heights[32, 32]), (0.0, 0.0)
    slope_east = float(np.sum(heights * east) / np.sum(east**2))
    slope_north = float(np.sum(heights * north) / np.sum(north**2))
    return float(heights.mean()), (slope_east, slope_north)
