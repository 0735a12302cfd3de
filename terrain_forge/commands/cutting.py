"""The command that cuts a world out of a site in tiles."""

from __future__ import annotations

from pathlib import Path

import click

from terrain_forge.terminal import (
    FORCE,
    ONLY,
    OUT,
    Command,
    Display,
    Number,
    Numbers,
    names_of,
    say,
)

_STAGES = "rock library", "ground", "rocks", "paths", "writing", "validation", "report page"


@click.command("cut", cls=Command)
@OUT
@click.option(
    "--centre", type=Numbers("120,-340"), required=True, metavar="EAST,NORTH",
    help="Its middle in the site's frame [m], such as 120,-340.",
)  # fmt: skip
@click.option(
    "--size", type=Numbers("64,64", Number(0.0, min_open=True)), required=True,
    metavar="EAST,NORTH", help="Its size [m], such as 64,64.",
)  # fmt: skip
@click.option(
    "-o", "--out", "into", type=click.Path(path_type=Path),
    help="Output folder [default: ./NAME-EAST-NORTH].",
)  # fmt: skip
@ONLY
@FORCE
def cut(
    out: Path,
    centre: tuple[float, float],
    size: tuple[float, float],
    into: Path | None,
    only: tuple[str, ...],
    force: bool,
) -> None:
    """Make a world of its own of a part of the site in tiles that is built in OUT.

    Its ground and rocks are those of the tiles, bit for bit. The site need not be finished.
    """
    from terrain_forge import pipeline
    from terrain_forge.base import resolved
    from terrain_forge.terminal import finish, tell_build

    into = into or Path(f"{resolved(out).name}-{centre[0]:g}-{centre[1]:g}")
    with Display(_STAGES) as display:
        result = pipeline.cut(
            out, into, centre=centre, size=size, only=names_of(only), force=force,
            progress=display,
        )  # fmt: skip
    tell_build(result, into, display.elapsed)
    west, south, east, north = result.world.ground.bounds
    found = (west + east) / 2.0, (south + north) / 2.0, east - west, north - south
    spacing = result.world.ground.spacing
    if any(abs(a - b) > 1e-6 * spacing for a, b in zip(found, (*centre, *size), strict=True)):
        say(
            f"  whole cells of {spacing:g} m: {found[2]:g} × {found[3]:g} m around "
            f"{found[0]:g},{found[1]:g}, asked for {size[0]:g} × {size[1]:g} m around "
            f"{centre[0]:g},{centre[1]:g}"
        )
    held = {path.name for path in result.world.trajectories}
    if left := [path.name for path in result.world.site.recipe.paths if path.name not in held]:
        near = "" if held else ", and with them what exports have near paths"
        say(f"  left out     paths that do not lie wholly in it: {', '.join(left)}{near}")
    finish(result.passed, into)
