"""A period's maps as GeoTIFFs, a table, pictures and a film."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from terrain_forge.base import Array, image_rows, srgb_from_linear
from terrain_forge.illumination.land import Land
from terrain_forge.illumination.period import Light
from terrain_forge.making import light_at
from terrain_forge.model import Site, World
from terrain_forge.scene import render_in_lights
from terrain_forge.sky import Above, true_solar_time, utc_text
from terrain_forge.writers import write_geotiff, write_png

_SIDE = 512
"""Pixels of a picture's longer side, at least."""
_WIDEST = 4096
"""And at most: of a larger map each n-th node is shown."""
_FRAME_MS = 120
_VIEW = 960, 540
"""Width and height of what the preview's eye sees [pixels]."""
_MOST_HORIZON = 8_000_000
"""Values of the horizon map that are written; of more, each n-th azimuth is."""
_NO_PART = 255
"""Of whole numbers, what says that nothing is known."""
_NO_COLOUR = 90.0, 60.0, 60.0
"""Of pictures, likewise."""
_TEXT, _SHADE = (255, 255, 255), (0, 0, 0)


def write_maps(folder: Path, light: Light, land: Land, site: Site, names: list[str]) -> list[str]:
    """Write the GeoTIFFs, nodata where the DTM has holes; returns lines that say what they hold."""
    every = max(1, -(-light.horizon.size // _MOST_HORIZON))
    degrees = np.degrees(light.azimuths)
    maps: list[tuple[str, NDArray[Any], str, list[str], str]] = [
        ("sunlight_hours", light.sunlight, "h", ["hours of the whole Sun in the period"], ""),
        ("earth_hours", light.earth, "h", ["hours of the whole Earth in the period"], ""),
        ("never_lit", light.never, "", ["1 where the Sun never shines, whatever the date"], ""),
        (
            "horizon", np.degrees(np.moveaxis(light.horizon[::every], 0, -1)), "deg",
            [f"height of the horizon {a:.6g} deg from grid north" for a in degrees[::every]],
            f", {len(degrees[::every])} azimuths",
        ),
    ]  # fmt: skip
    if len(light.moments):
        shadows = np.moveaxis(light.moments, 0, -1)
        maps.append(("sun_seen", shadows, "%", names, f", {len(names)} moments"))
    lines = []
    for name, grid, units, told, more in maps:
        nodata = _NO_PART if grid.dtype == np.uint8 else np.nan
        values = np.array(grid, order="C")
        values[light.missing] = nodata
        write_geotiff(
            folder / f"{name}.tif", values, world_ground=land.grid, site=site, units=units,
            nodata=nodata, description=told,
        )  # fmt: skip
        lines.append(f"{name}.tif{more}")
    return lines


def write_table(
    path: Path, moments: list[datetime], above: Above, light: Light, facts: dict[str, Any]
) -> None:
    """Write when what stood where as JSON, and how it was found."""
    azimuths = {n: np.degrees(np.arctan2(v[:, 0], v[:, 1])) % 360.0 for n, v in _two(above)}
    heights = {n: np.degrees(np.arcsin(v[:, 2])) for n, v in _two(above)}
    rows = [
        {
            "time": utc_text(moment),
            "ltst": true_solar_time(float(above.solar_time[n])),
            "ls_deg": round(float(np.degrees(above.season[n])), 4),
            "sun_azimuth_deg": round(float(azimuths["sun"][n]), 4),
            "sun_elevation_deg": round(float(heights["sun"][n]), 4),
            "sun_distance_au": round(float(above.sun_distance[n]), 6),
            "earth_azimuth_deg": round(float(azimuths["earth"][n]), 4),
            "earth_elevation_deg": round(float(heights["earth"][n]), 4),
        }
        for n, moment in enumerate(moments)
    ]
    found = {
        "mean_sunlight_hours": float(light.known_hours.mean()),
        "never_lit_share": light.never_share,
    }
    path.write_text(json.dumps(facts | found | {"moments": rows}, indent=1), encoding="utf-8")


def _two(above: Above) -> list[tuple[str, Array]]:
    return [("sun", above.sun), ("earth", above.earth)]


def write_film(
    path: Path, land: Land, light: Light, above: Above, captions: list[str], most: int
) -> bool:
    """Write the map under the moving Sun, north up, as an animated WebP; not where it is night."""
    chosen = _spread(np.asarray(light.moments.reshape(len(captions), -1).any(axis=1)), most)
    return _write_frames(
        path, [shaded(land, above.sun[n], light.moments[n], captions[n]) for n in chosen]
    )


def write_day(
    path: Path, world: World, moments: list[datetime], above: Above, captions: list[str], most: int
) -> bool:
    """Write what the preview's eye sees under the moving Sun, likewise; not where it is night."""
    chosen = _spread(above.sun[:, 2] > 0.5 * above.sun_diameter, most)
    lights = (light_at(world.site, moments[n]) for n in chosen)
    seen = render_in_lights(world, lights, width=_VIEW[0], height=_VIEW[1])
    pictures = zip(map(Image.fromarray, seen), chosen, strict=True)
    return _write_frames(path, [_captioned(picture, captions[n]) for picture, n in pictures])


def _spread(day: NDArray[np.bool_], most: int) -> list[int]:
    """The moments of day, evenly thinned to the most that may be."""
    lit = np.flatnonzero(day)
    steps = np.linspace(0, len(lit) - 1, most if len(lit) else 0)
    return [int(n) for n in lit[np.unique(steps.round().astype(int))]]


def _write_frames(path: Path, frames: list[Image.Image]) -> bool:
    """Write an animated WebP; returns whether there was a frame."""
    if frames:
        frames[0].save(
            path, format="WEBP", save_all=True, append_images=frames[1:], duration=_FRAME_MS,
            loop=0, quality=85, method=3,
        )  # fmt: skip
    return bool(frames)


def shaded(land: Land, sun: Array, percent: NDArray[np.uint8], caption: str) -> Image.Image:
    """The map in the light of a moment; no Sun is dark blue, what is not known brown."""
    rise_north, rise_east = np.gradient(land.grid.elevation, land.grid.spacing)
    facing = (sun[2] - rise_east * sun[0] - rise_north * sun[1]) / np.sqrt(
        1.0 + rise_east**2 + rise_north**2
    )
    shine = np.maximum(facing, 0.0) * percent / 100.0
    grey = 0.02 + 0.55 * shine / max(float(np.percentile(shine, 98.0)), 1e-6)
    colour = np.stack([grey, grey, grey + 0.03], axis=-1)
    pixels = np.asarray(255.0 * np.clip(srgb_from_linear(colour), 0.0, 1.0))
    pixels[land.missing] = _NO_COLOUR
    return _picture(pixels, caption)


def write_hours(path: Path, light: Light, whole: float) -> None:
    """Write the hours of sunlight as a picture, black for none, white for all.

    What is never lit is blue, and brown where nothing is known.
    """
    part = light.sunlight / max(whole, 1e-9)
    colour = np.repeat(255.0 * np.sqrt(np.clip(part, 0.0, 1.0))[..., None], 3, axis=-1)
    colour[light.never > 0] = (30.0, 60.0, 160.0)
    colour[light.missing] = _NO_COLOUR
    write_png(path, np.asarray(_picture(colour, "")))


def _picture(colour: Array, caption: str) -> Image.Image:
    """A grid of colours, rows running north, as a picture of a size that can be seen."""
    every = -(-max(colour.shape[:2]) // _WIDEST)
    pixels = np.asarray(image_rows(colour))[::every, ::every].round().astype(np.uint8)
    image = Image.fromarray(pixels)
    times = max(1, -(-_SIDE // max(image.size)))
    image = image.resize((times * image.width, times * image.height), Image.Resampling.NEAREST)
    return _captioned(image, caption) if caption else image


def _captioned(image: Image.Image, caption: str) -> Image.Image:
    """A picture with a line at its foot."""
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, image.height - 16, image.width, image.height), fill=_SHADE)
    draw.text((4, image.height - 14), caption, fill=_TEXT)
    return image
