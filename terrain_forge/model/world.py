"""A world and its tiles: what the stages make and exporters, truth and checks take."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from terrain_forge.base import (
    OutputError,
    Record,
    checked,
    from_plain,
    read_arrays,
    read_text,
    require_indices,
    to_plain,
)
from terrain_forge.model.appearance import Appearance, Lighting
from terrain_forge.model.heightfield import Heightfield
from terrain_forge.model.horizon import Horizon
from terrain_forge.model.packages import packages_gone
from terrain_forge.model.plot import html, plot_world
from terrain_forge.model.rocks import RockField, RockLibrary, merge, owned, touches
from terrain_forge.model.rover import Rover
from terrain_forge.model.sensor import sensor_kinds
from terrain_forge.model.site import Site, Window
from terrain_forge.model.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 7
MAX_JSON = 2**30
"""Bytes of a world's JSON."""
_TEXT, _ARRAYS = "world/world.json", "world/arrays.npz"
SHARED_ARRAYS = "world/shared.npz"
"""Where a stored world has the arrays that many worlds have alike."""
_SHARED_PARTS = "world/library/", "world/appearance/detail/"
"""Beginnings of the names of arrays that many worlds have alike."""
ArchiveWriter = Callable[[Path, dict[str, NDArray[Any]]], None]


def write_archive(path: Path, arrays: dict[str, NDArray[Any]]) -> None:
    """Write arrays of a world by their names as an npz."""
    np.savez(path, allow_pickle=False, **arrays)  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True, eq=False)
class World(Record):
    """Everything that exporters, truth, pictures and validation need."""

    site: Site
    """The place."""
    window: Window
    """The part of the site that this world is."""
    ground: Heightfield
    """The bare ground."""
    appearance: Appearance
    """Colours."""
    library: RockLibrary
    """Rock shapes."""
    field: RockField
    """Rocks whose centre lies in the window."""
    neighbours: RockField
    """Rocks of the site whose centre lies outside the window but which reach into it."""
    trajectories: tuple[Trajectory, ...]
    """Paths on the ground."""
    rover: Rover
    """Who drives."""
    lighting: Lighting
    """Sun and sky."""
    unplaced: tuple[int, ...]
    """Rocks of each population that found no free place, counted over the rocks of this window."""
    unsupported: RockField | None = None
    """Rocks whose centre lies in the window that are left out, since the ground falls away beneath
    them however deep they are buried, as they would lie; None for none."""
    horizon: Horizon | None = None
    """What lies beyond the ground's edge; None for nothing."""

    def __post_init__(self) -> None:
        super().__post_init__()
        nodes = (self.window.rows + 1, self.window.columns + 1)
        for what, shape in (
            ("ground", self.ground.shape),
            ("appearance", self.appearance.ground_rgb.shape[:2]),
        ):
            if shape != nodes:
                raise ValueError(f"World: {what} has nodes of shape {shape}, its window {nodes}")
        for rocks in (self.field, self.neighbours):
            require_indices(rocks.population, len(rocks.populations), "a rock's population")
            require_indices(rocks.prototype, len(self.library.prototypes), "a rock's shape")

    @property
    def sun_diameter(self) -> float:
        """Angle that the Sun fills [rad]."""
        return self.lighting.sun_diameter or self.site.body.sun_diameter

    @property
    def unsupported_number(self) -> tuple[int, ...]:
        """How many rocks of each population are left out as unsupported."""
        kinds = len(self.field.populations)
        if self.unsupported is None:
            return (0,) * kinds
        return tuple(np.bincount(self.unsupported.population, minlength=kinds).tolist())

    def __repr__(self) -> str:
        site, (west, south, east, north) = self.site, self.ground.bounds
        paths = ", ".join(path.name for path in self.trajectories) or "none"
        return (
            f"<World {site.name!r}: {site.body.name}, {east - west:g} × {north - south:g} m at "
            f"{site.spacing:g} m, rocks: {len(self.field):,}, paths: {paths}, seed {site.seed}>"
        )

    def _repr_html_(self) -> str:
        west, south, east, north = self.ground.bounds
        return html(repr(self), (east - west, north - south), self.plot)

    @checked
    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the world from above: shaded ground, rocks, paths.

        Args:
            axes: Where to draw; new axes of `matplotlib.pyplot` by default.

        Returns:
            The axes, in metres east and north.
        """
        return plot_world(self, axes)

    @checked
    def tiles(self, *, cells: Annotated[int, Ge(1)] = 1024) -> Iterator[Tile]:
        """The world in tiles of at most `cells` cells each way, row by row from the south-west.

        Tiles share their border nodes; a rock belongs to the tile of its centre.
        """
        whole = self.window
        columns, rows = range(0, whole.columns, cells), range(0, whole.rows, cells)
        if len(columns) * len(rows) == 1:
            yield Tile(number=0, world=self, whole=self)
            return
        for number, (row, column) in enumerate(product(rows, columns)):
            window = Window(
                column=whole.column + column,
                row=whole.row + row,
                columns=min(cells, whole.columns - column),
                rows=min(cells, whole.rows - row),
            )
            yield self.tile(window, number=number)

    def alone(self) -> World:
        """The world without the rocks that only reach into it, which no export has."""
        if not len(self.neighbours):
            return self
        none = np.zeros(len(self.neighbours), np.bool_)
        return self.replace(neighbours=self.neighbours.select(none))

    @checked
    def tile(self, window: Window, *, number: int) -> Tile:
        """The tile of a window of the site that lies in this world."""
        rows, columns = window.nodes_in(self.window)
        ground = self.ground.cut(
            column=columns.start, row=rows.start, columns=window.columns, rows=window.rows
        )
        everyone = merge(self.field, self.neighbours)
        own = owned(everyone, ground, self.ground.bounds) & np.isin(everyone.id, self.field.id)
        near = touches(everyone, ground, self.library) & ~own
        missed = self.unsupported
        if missed is not None:
            missed = missed.select(owned(missed, ground, self.ground.bounds))
        part = self.replace(
            window=window,
            ground=ground,
            appearance=self.appearance.cut((rows, columns)),
            field=everyone.select(own),
            neighbours=everyone.select(near),
            unsupported=missed,
            horizon=None,
        )
        return Tile(number=number, world=part, whole=self)

    @checked
    def save(self, directory: Path, *, write: ArchiveWriter = write_archive) -> list[Path]:
        """Store the world as `directory`/world/: world.json, arrays.npz and shared.npz.

        The last holds what many worlds have alike, such as the rock library.

        Args:
            directory: Where `world` is made.
            write: Writes arrays by their names as an npz.

        Returns:
            The files.
        """
        text = Path(directory) / _TEXT
        text.parent.mkdir(parents=True, exist_ok=True)
        arrays: dict[str, NDArray[Any]] = {}
        # A custom rover is the site's and the world's; its meshes are stored once.
        shared = self.site.custom_rover == self.rover
        stored = self.replace(site=self.site.replace(custom_rover=None)) if shared else self
        plain = {
            "format": FORMAT,
            "shared_rover": shared,
            "world": to_plain(stored, arrays, "world"),
        }
        text.write_text(json.dumps(plain, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        files = [text]
        for name, parts in _apart(arrays).items():
            files.append(Path(directory) / name)
            write(files[-1], parts)
        return files

    @staticmethod
    @checked
    def load(directory: Path | str) -> World:
        """The world of a built folder.

        Raises:
            OutputError: if the folder holds no world of this version.
        """
        sensor_kinds()  # registers them among the records
        text = Path(directory) / _TEXT
        try:
            plain = json.loads(read_text(text, text.name, most=MAX_JSON))
            if plain.get("format") != FORMAT:
                found = plain.get("format")
                raise OutputError(f"{text}: world format {found!r}, this version reads {FORMAT}")
            arrays = read_arrays(Path(directory) / _ARRAYS)
            arrays |= read_arrays(Path(directory) / SHARED_ARRAYS)
            world = from_plain(plain["world"], arrays, World)
            if plain["shared_rover"]:
                world = world.replace(site=world.site.replace(custom_rover=world.rover))
            return world.replace(site=world.site.with_current_keys(text))
        except OutputError:
            raise
        except Exception as error:  # a record stumbles over whatever stands there
            why = " ".join(str(error).split()) or type(error).__name__
            gone = packages_gone(Path(directory))
            hint = f"; install {gone}, with which it was built" if gone else ""
            raise OutputError(
                f"{directory}: holds no readable terrain-forge world ({why}){hint}"
            ) from None


def _apart(arrays: dict[str, NDArray[Any]]) -> dict[str, dict[str, NDArray[Any]]]:
    """The arrays of a stored world by the file that they go into."""
    files: dict[str, dict[str, NDArray[Any]]] = {_ARRAYS: {}, SHARED_ARRAYS: {}}
    for name, array in arrays.items():
        files[SHARED_ARRAYS if name.startswith(_SHARED_PARTS) else _ARRAYS][name] = array
    return files


@dataclass(frozen=True, kw_only=True, eq=False)
class Tile(Record):
    """A part of a world, as a world of its own that knows the whole."""

    number: int
    """Its place among the tiles, from 0."""
    world: World
    """The part."""
    whole: World
    """The world that it is part of."""

    def name(self, kind: str) -> str:
        """What the tile's ground, rocks, … are called in files, such as `ground_003`."""
        return f"{kind}_{self.number:03}"

    @property
    def ground(self) -> Heightfield:
        """The tile's ground."""
        return self.world.ground

    @property
    def field(self) -> RockField:
        """Rocks whose centre lies in the tile."""
        return self.world.field

    @property
    def neighbours(self) -> RockField:
        """Rocks that reach into the tile from beside it."""
        return self.world.neighbours
