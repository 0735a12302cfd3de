"""The command that cuts a world out of a site in tiles."""

from __future__ import annotations

from pathlib import Path

import click

from terrain_forge.base import OutputError
from terrain_forge.terminal import (
    FORCE,
    ONLY,
    OUT,
    Display,
    names_of,
)

_STAGES = "rock library", "ground", "rocks", "paths", "writing", "validation", "report page"


@click.command("cut")
@OUT
@click.option(
    "--centre", required=True, metavar="EAST,NORTH", help="Its middle in the site's frame [m]."
)
@click.option("--size", required=True, metavar="EAST,NORTH", help="Its size [m], such as 64,64")
@click.option(
    "-o", "--out", "into", type=click.Path(path_type=Path),
    help="Output folder [default: ./NAME-EAST-NORTH].",
)  # fmt: skip
@ONLY
@FORCE
def cut(
    out: Path, centre: str, size: str, into: Path | None, only: str | None, force: bool
) -> None:
    """Make a world of its own of a part of the site in tiles that is built in OUT.

    Its ground and rocks are those of the tiles, bit for bit. The site need not be finished.
    """
    from terrain_forge import pipeline
    from terrain_forge.terminal import finish, tell_build

    place, length = pair("--centre", centre), pair("--size", size)
    into = into or Path(f"{out.resolve().name}-{place[0]:g}-{place[1]:g}")
    with Display(_STAGES) as display:
        result = pipeline.cut(
            out, into, centre=place, size=length, only=names_of(only), force=force,
            progress=display,
        )  # fmt: skip
    tell_build(result, into, display.elapsed)
    finish(result.passed, into)


def pair(option: str, text: str) -> tuple[float, float]:
    """Two numbers with a comma between them.

    Raises:
        OutputError: if they are not.
    """
    try:
        east, north = (float(part) for part in text.split(","))
    except ValueError:
        raise OutputError(
            f"{option} {text!r}: two numbers [m] with a comma, such as 64,64"
        ) from None
    return east, north
