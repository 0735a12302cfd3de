"""What commands take: arguments and options that several of them share."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from terrain_forge.base import OutputError
from terrain_forge.terminal.completion import complete_exporters, complete_keys, complete_recipes

F = TypeVar("F", bound=Callable[..., Any])


class Number(click.FloatRange):
    """A number that is finite, and within bounds where there are some."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number.

        Raises:
            click.BadParameter: if it is none.
        """
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is no finite number", param, ctx)
        return number

    def _describe_range(self) -> str:  # click's help would say "x<=None"
        return "" if self.min is self.max is None else super()._describe_range()


class Numbers(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """As many finite numbers with commas between them as the example has."""

    name = "numbers"

    def __init__(self, example: str, each: Number | None = None) -> None:
        self._example, self._each = example, each or Number()

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """The numbers.

        Raises:
            click.BadParameter: if they are not so many, or one is none.
        """
        parts, count = str(value).split(","), self._example.count(",") + 1
        if len(parts) != count:
            told = f"{count} numbers with commas between them, such as {self._example}"
            self.fail(f"{value!r}: must be {told}", param, ctx)
        return tuple(self._each.convert(part, param, ctx) for part in parts)


OUT = click.argument("out", type=click.Path(path_type=Path))
RECIPE = click.argument("recipe", type=click.Path(path_type=Path), shell_complete=complete_recipes)
SET = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="KEY=VALUE",
    shell_complete=complete_keys,
    help="Change a key of the recipe, such as terrain.spacing_m=0.25; may be given several times.",
)
DRIVES = click.option(
    "--drives",
    type=click.IntRange(1, 10_000),
    metavar="N",
    help="Also drive straight on from N random starts, and tell how many arrive.",
)
FORCE = click.option(
    "--force",
    is_flag=True,
    help="Also remove files of the older world that are not its own or were edited; says which.",
)
SCORING = click.option(
    "--set",
    "changes",
    multiple=True,
    metavar="KEY=VALUE",
    help="How it is scored, such as align=all, third_by=index or stations_m=0.",
)
SEED = click.option("--seed", type=int, help="Use this seed instead of the recipe's.")


ONLY = click.option(
    "--only",
    multiple=True,
    metavar="FORMATS",
    shell_complete=complete_exporters,
    help="Write only these exports, such as sdf,glb: the recipe's, or others with their defaults.",
)
_WORKERS = click.option(
    "--workers",
    type=click.IntRange(0, 4096),
    metavar="N",
    help="Processes that make tiles or worlds, 0 for this one [default: one for each core].",
)
_SCHEDULER = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Dask scheduler whose workers make them, such as tcp://host:8786; or local.",
)


def side_by_side(command: F) -> F:
    """The options of what is done by many processes."""
    return _WORKERS(_SCHEDULER(command))


class Command(click.Command):
    """A command that refuses an empty path, and an option of one value that is given twice."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments.

        Raises:
            click.UsageError: if an option is there twice, of which the last value would count, or a
                path is empty, which would be taken for the current folder.
        """
        values, _, given = self.make_parser(ctx).parse_args(args=list(args))
        for param in self.params:
            told = values.get(str(param.name))
            empty = "" in (told if isinstance(told, list | tuple) else (told,))
            if empty and isinstance(param.type, click.Path) and not ctx.resilient_parsing:
                name = param.opts[-1] if isinstance(param, click.Option) else param.opts[0].upper()
                raise click.UsageError(f"{name} is empty: name a file or folder", ctx)
        for number, param in enumerate(given):
            single = isinstance(param, click.Option) and not (param.multiple or param.is_eager)
            if single and param in given[:number] and not ctx.resilient_parsing:
                raise click.UsageError(f"{param.opts[-1]} is given twice: it takes one value", ctx)
        return super().parse_args(ctx, args)


class InOrder(Command, click.Group):
    """A group that lists its commands in the order of their use."""

    command_class = Command

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The order in which they are defined."""
        del ctx
        return list(self.commands)


def names_of(
    texts: tuple[str, ...], option: str = "--only", example: str = "sdf,mjcf"
) -> tuple[str, ...] | None:
    """The names with commas between them that an option was given, once or several times.

    Raises:
        OutputError: if one is empty.
    """
    if not texts:
        return None
    text = ",".join(texts)
    names = tuple(name.strip() for name in text.split(","))
    if not all(names):
        raise OutputError(f"{option} {text!r}: names with commas between them, such as {example}")
    return names
