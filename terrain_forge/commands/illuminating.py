"""The command that finds where the Sun shines over a period."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from terrain_forge.terminal import SET, Display, say


@click.command()
@click.argument("recipe", metavar="RECIPE|OUT", type=click.Path(path_type=Path))
@click.option(
    "--from", "begin", metavar="TIME", help="When it begins, UTC [default: the recipe's]."
)
@click.option("--to", "end", metavar="TIME", help="When it ends [default: a solar day later].")
@click.option("--step", metavar="LENGTH", help="Such as 30m, 1h, 2d [default: a 48th of it].")
@click.option(
    "--size", type=(float, float), metavar="EAST NORTH", help="Of the map [m; default: the site]."
)
@click.option(
    "--spacing", type=click.FloatRange(0.01), help="Of its nodes [m; default: the DTM's posting]."
)
@click.option(
    "--height", type=click.FloatRange(0.0, 1e4), default=0.0, help="Of who looks, over ground [m]."
)
@click.option(
    "--reach",
    type=click.FloatRange(0.1, 500.0),
    default=100.0,
    show_default=True,
    help="How far is looked [km].",
)
@click.option(
    "--azimuths",
    type=click.IntRange(8, 3600),
    default=360,
    show_default=True,
    help="Directions of the horizon map.",
)
@click.option(
    "-o", "--out", type=click.Path(path_type=Path), help="Folder [default: ./NAME_illumination]."
)
@SET
def illumination(
    recipe: Path, out: Path | None, reach: float, changes: tuple[str, ...], **wishes: Any
) -> None:
    """Find where the Sun shines and the Earth is seen over a period, for RECIPE or a world in OUT.

    Writes GeoTIFFs: hours of sunlight and of the Earth, ground that is never lit, the horizon all
    around, the part of the Sun that is seen at each moment; a table, pictures, and a film of the
    shadows. It looks at the DTM, of a recipe at all of it, not at rocks or drawn detail.
    """
    from terrain_forge.dtm import RasterDtm
    from terrain_forge.illumination import Source, Wish, illuminate
    from terrain_forge.making import plan
    from terrain_forge.model import World
    from terrain_forge.terminal import load_given, located

    wish = Wish(reach=1e3 * reach, **wishes)
    if recipe.is_dir():
        site = World.load(recipe).site
        with Display(("land", "rays", "files")) as display:
            target = out or Path(f"{site.name}_illumination")
            lines = illuminate(site, None, target, wish, progress=display)
    else:
        file = load_given(recipe, changes=changes)
        target = out or Path(f"{file.recipe.name}_illumination")
        with located(file), Display(("plan", "land", "rays", "files")) as display:
            display("plan")
            site = plan(file.recipe, folder=file.folder, progress=display)
            dtm = file.recipe.dtm
            source = Source(dtm=dtm, folder=file.folder) if isinstance(dtm, RasterDtm) else None
            lines = illuminate(site, source, target, wish, progress=display)
    for line in lines:
        say(line)
    say(f"written to {target}")
