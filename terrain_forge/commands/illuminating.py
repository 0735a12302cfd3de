"""The command that finds where the Sun shines over a period."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import click

from terrain_forge.terminal import FORCE, SET, Command, Display, Number, say

_LENGTH = Number(0.0, 1e6, min_open=True)


@click.command(cls=Command)
@click.argument("recipe", metavar="RECIPE|OUT", type=click.Path(path_type=Path))
@click.option(
    "--from", "begin", metavar="TIME", help="When it begins, UTC [default: the recipe's]."
)
@click.option("--to", "end", metavar="TIME", help="When it ends [default: a solar day later].")
@click.option(
    "--step",
    metavar="LENGTH",
    help="With its unit: 30m, 1h, 2d; each moment is the middle of one [default: a 48th of it].",
)
@click.option(
    "--size", type=(_LENGTH, _LENGTH), metavar="EAST NORTH",
    help="Of the map [m; default: the site].",
)  # fmt: skip
@click.option(
    "--spacing", type=Number(0.01, 1e6), help="Of its nodes [m; default: the DTM's posting]."
)
@click.option("--height", type=Number(0.0, 1e4), default=0.0, help="Of who looks, over ground [m].")
@click.option(
    "--reach",
    type=Number(0.1, 500.0),
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
@FORCE
def illumination(
    recipe: Path,
    out: Path | None,
    reach: float,
    changes: tuple[str, ...],
    force: bool,
    **wishes: Any,
) -> None:
    """Find where the Sun shines and the Earth is seen over a period, for RECIPE or a world in OUT.

    Writes GeoTIFFs: hours of sunlight and of the Earth, ground that is never lit, the horizon all
    around, the part of the Sun that is seen at each moment; a table, pictures, and a film of the
    shadows. It looks at the DTM, of a recipe at all of it and beyond it at the horizon's, not at
    rocks or drawn detail. Of a world there is a film of its day too, with all that is in it.
    """
    from terrain_forge.base import resolved
    from terrain_forge.building import read_manifest, require_apart, require_readable_recipe
    from terrain_forge.dtm import RasterDtm
    from terrain_forge.illumination import Source, Wish, illuminate
    from terrain_forge.making import plan
    from terrain_forge.model import World
    from terrain_forge.recipe import input_paths
    from terrain_forge.terminal import load_given, located
    from terrain_forge.tiling import is_site

    wish = Wish(reach=1e3 * reach, **wishes)
    how: dict[str, Any] = {"force": force, "tell": partial(say, err=True)}
    if recipe.is_dir():
        if is_site(recipe):
            read_manifest(recipe)  # says what to do with it
        world = World.load(recipe)
        require_readable_recipe(world, recipe, exports=False)
        target = out or Path(f"{world.site.name}_illumination")
        require_apart(resolved(target), [recipe])
        with Display(("land", "rays", "files", "view")) as display:
            lines = illuminate(world.site, None, target, wish, world=world, progress=display, **how)
    else:
        file = load_given(recipe, changes=changes)
        target = out or Path(f"{file.recipe.name}_illumination")
        require_apart(resolved(target), [file.path, *input_paths(file.recipe, file.folder)])
        with located(file), Display(("plan", "land", "rays", "files")) as display:
            display("plan")
            site = plan(file.recipe, folder=file.folder, by_night=True, progress=display)
            dtm = file.recipe.dtm
            beyond = None if file.recipe.horizon.reach_m == 0.0 else file.recipe.horizon.dtm
            source = None
            if isinstance(dtm, RasterDtm):
                source = Source(dtm=dtm, folder=file.folder, beyond=beyond)
            lines = illuminate(site, source, target, wish, progress=display, **how)
    for line in lines:
        say(line)
    say(f"written to {target}")
