"""The command that cuts a world out of a site in tiles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from terrain_forge.base import OutputError
from terrain_forge.building import BuildResult
from terrain_forge.terminal.completion import complete_exporters
from terrain_forge.terminal.display import Display
from terrain_forge.terminal.options import FORCE, OUT, names_of
from terrain_forge.terminal.outcome import finish, tell_build

_STAGES = "rock library", "ground", "rocks", "paths", "writing", "validation", "report page"


def cut_command(cut: Callable[..., BuildResult]) -> click.Command:
    """The command, which calls `cut`."""

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
    @click.option(
        "--only",
        metavar="FORMATS",
        shell_complete=complete_exporters,
        help="Formats to write, such as mjcf,drake [default: the site's].",
    )
    @FORCE
    def command(
        out: Path, centre: str, size: str, into: Path | None, only: str | None, force: bool
    ) -> None:
        """Make a world of its own of a part of the site in tiles that is built in OUT.

        Its ground and rocks are those of the tiles, bit for bit. The site need not be finished.
        """
        place, length = pair("--centre", centre), pair("--size", size)
        into = into or Path(f"{out.resolve().name}-{place[0]:g}-{place[1]:g}")
        with Display(_STAGES) as display:
            result = cut(
                out, into, centre=place, size=length, only=names_of(only), force=force,
                progress=display,
            )  # fmt: skip
        tell_build(result, into, display.elapsed)
        finish(result.passed, into)

    return command


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
