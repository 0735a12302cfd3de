"""What was built, how to open it, and what lies where, on the report page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from terrain_forge.dtm import origin
from terrain_forge.model import Opening, World
from terrain_forge.report.blocks import Block, Shown, facts, heading, paragraph, table, thousands
from terrain_forge.report.section import Built, Section

_FOLDERS = {
    "preview.png": "the picture above",
    "world": "the world itself; World.load reads it back",
    "truth": "GeoTIFFs of ground, top surface and rock ids; rocks.csv; size-frequency verification",
    "paths": "trajectories as CSV and in the TUM format",
    "dataset": "the recording",
    "validation": "every check with its figure, the driven path, pictures",
    "manifest.json": "the resolved recipe, versions, SHA-256 of every file",
    "timings.json": "wall times",
}


class Summary(Section):
    """The recipe's essentials and what came of them."""

    kind, title, place = "summary", "What was built", 30

    def blocks(self, built: Built) -> Sequence[Block]:
        """Facts, and the whole recipe as it was resolved, folded away."""
        world = built.world
        site, ground = world.site, world.ground
        dtm: dict[str, Any] = built.recipe.get("dtm", {})
        rows, columns = ground.shape
        listed: list[tuple[str, Shown]] = [
            ("Body", f"{site.body.name.capitalize()}, gravity {site.body.gravity:g} m/s²"),
            ("Place", _place(world)),
            ("Terrain model", _terrain_model(dtm)),
            *((f"Its {key}", said) for key, said in (origin(dtm) or {}).items()),
            *([("Posting of the model", f"{site.dtm.posting:.4g} m")] if site.dtm else []),
            *([("Samples filled in", thousands(site.dtm.filled))] if site.dtm else []),
            (
                "Heights count from",
                f"{site.datum_height:.3f} m above the datum".replace("-", "\u2212"),
            ),
            ("Level plane", _plane(site.slope)),
            ("Ground", f"{columns} × {rows} nodes, {site.spacing:g} m apart"),
            *_roughness(built.validation.get("terrain")),
            ("Beyond the border", world.horizon.told if world.horizon else "nothing"),
            ("Rock shapes", f"{len(world.library.prototypes)}, seed {world.library.seed}"),
            ("Rover", world.rover.name),
            ("Sun", _sun(world)),
        ]
        recipe = json.dumps(built.recipe, indent=1, ensure_ascii=False)
        summary = "The whole recipe, with its defaults"
        return [facts(listed), Block(kind="folded", summary=summary, text=recipe)]


def _roughness(terrain: dict[str, Any] | None) -> Iterator[tuple[str, str]]:
    """The law of the detail, where the report of the ground tells it."""
    if terrain and terrain["hurst"] is not None:
        yield "Roughness", f"H {terrain['hurst']:.2f}, {terrain['deviation_1m_m']:.3g} m at 1 m"


def _terrain_model(dtm: dict[str, Any]) -> str:
    names = (dtm.get(key) for key in ("source", "product", "url", "kind"))
    return str(next(filter(None, names), "made by hand"))


def _place(world: World) -> str:
    site = world.site
    if site.lonlat is None:
        return "not georeferenced"
    longitude, latitude = np.degrees(site.lonlat)
    north, east = "NS"[int(latitude < 0)], "EW"[int(longitude < 0)]
    return f"{abs(latitude):.5f}° {north}, {abs(longitude):.5f}° {east}"


def _plane(slope: tuple[float, float]) -> str:
    east, north = slope
    if east == north == 0.0:
        return "not levelled"
    return f"{np.degrees(np.arctan(np.hypot(east, north))):.2f}° taken away"


def _sun(world: World) -> str:
    azimuth, elevation = np.degrees([world.lighting.sun_azimuth, world.lighting.sun_elevation])
    stands = f"{elevation:.1f}° high, azimuth {azimuth % 360:.1f}°"
    if (season := world.lighting.season) is None:
        return stands
    when = f"{world.lighting.time}, {world.lighting.solar_time} true solar time"
    return f"{stands}; {when}, Ls {np.degrees(season):.1f}°"


class Usage(Section):
    """How to open the exports that lie in a built folder."""

    kind, title, place = "usage", "Open it", 10

    def blocks(self, built: Built) -> Sequence[Block]:
        """Commands for each export, and for Python."""
        opened = [words for export in built.exports if (words := export.opening(built.directory))]
        python = 'from terrain_forge import World\nworld = World.load(".")'
        opened.append(Opening(title="Python", commands=python))
        columns = [
            [heading(words.title), Block(kind="command", text=words.commands)] for words in opened
        ]
        note = paragraph("Run these commands in the folder that holds this page.", "note")
        return [note, Block(kind="pair", columns=columns)]


class Files(Section):
    """What lies in the folder."""

    kind, title, place = "files", "Files", 120

    def blocks(self, built: Built) -> Sequence[Block]:
        """A table of files and folders."""
        entries = built.directory.glob("[!.]*")
        names = [path.name for path in entries if path.suffix not in (".log", ".html")]
        # The manifest is written last and the timings after it, but whoever reads this has them.
        present = sorted({*names, "manifest.json", "timings.json"})
        held = _FOLDERS | {export.folder: f"an export: {export.kind}" for export in built.exports}
        rows: list[list[Shown]] = [[name, held.get(name, "")] for name in present]
        return [table(("File or folder", "What it holds"), rows, figures="ll")]
