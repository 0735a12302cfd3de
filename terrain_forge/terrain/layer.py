"""What a displacement layer is, and finding all of them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, RecipeError, Spec, parts
from terrain_forge.model import Site, Window
from terrain_forge.terrain.masks import Mask, mask_weight

LAYERS = "terrain_forge.layers"
Beyond = Callable[[Array, Array, float], Array]
"""Heights to add [m], shape [rows, columns], at east coordinates of columns and north ones of rows
[m] whose nodes lie so far apart [m]: waves that such nodes cannot show are left out."""


@dataclass(frozen=True, kw_only=True)
class Layer(Spec):
    """One step of the ground: a spec with the relief that it adds.

    A subclass has a field `kind` (a Literal with its default) and must have `relief`. It is
    found if its module lies in `terrain_forge.terrain.layers` or is named by an entry point of the
    group `terrain_forge.layers`. A field that names a file is marked, as in
    `image: Annotated[str, InputFile(kind="image")]`; `site.image(self.image)` then has what was
    read, and `site.table(…)` a table.
    """

    if TYPE_CHECKING:
        kind: str
        """Name of the layer, as a recipe writes it."""

    mask: Mask | None = None
    """Where the layer applies; without it, everywhere."""

    def check(self, *, site: Site, key: tuple[str | int, ...]) -> None:
        """Refuse, when the site is planned, what it cannot have; `key` is the layer's place.

        Raises:
            RecipeError, DataError: what was found and what is allowed.
        """

    def facts(self, site: Site) -> Iterator[tuple[str, str]]:  # noqa: ARG002
        """What `terrain-forge check` says of it on a planned site: a word, and what it is."""
        yield from ()

    def reach(self, site: Site) -> float:  # noqa: ARG002
        """How far around a node its relief depends on the ground so far [m]."""
        return 0.0

    @abstractmethod
    def relief(
        self, *, site: Site, window: Window, elevation: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Heights to add [m] at the window's nodes, shape [rows, columns], before the mask.

        A pure function of the site's coordinates: a node has the same bits in every window.
        `elevation` is the ground so far [m]; of it only what lies within `reach` may be used.
        """
        raise NotImplementedError

    def beyond(self, site: Site) -> Beyond | None:  # noqa: ARG002
        """What of its relief goes on beyond the site; by default none, and it runs out."""
        return None

    def brightness(self, *, site: Site, window: Window) -> NDArray[np.float64] | None:  # noqa: ARG002
        """Factor on the ground's linear albedo at the window's nodes; None for 1 everywhere."""
        return None

    def masked_relief(
        self, *, site: Site, window: Window, elevation: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The relief where the mask lets it be.

        Raises:
            ValueError: if it is no array of a number for each node.
        """
        added = self.relief(site=site, window=window, elevation=elevation)
        if type(added) is not np.ndarray or added.dtype.kind not in "fiu":
            raise ValueError(f"found {getattr(added, 'dtype', '')} {type(added).__name__}".strip())
        if added.shape != elevation.shape:
            raise ValueError(f"found the shape {list(added.shape)}")
        if self.mask is None:
            return added
        return added * mask_weight(self.mask, site=site, window=window, elevation=elevation)

    def margin(self, site: Site) -> float:
        """How far around a node the layer and its mask look at the ground so far [m]."""
        return max(self.reach(site), self.mask.reach(site) if self.mask else 0.0)


def check_layers(layers: tuple[Layer, ...], site: Site) -> None:
    """Refuse layers that a site cannot have, or two with one name.

    Raises:
        RecipeError, DataError: for the first that is wrong.
    """
    named: dict[str, int] = {}
    for number, layer in enumerate(layers):
        key = ("terrain", "layers", number)
        name = getattr(layer, "name", None)
        if name is not None and named.setdefault(name.lower(), number) != number:
            raise RecipeError(
                f"a layer before is called {name!r} too, case aside", key=(*key, "name")
            )
        if layer.mask is not None:
            layer.mask.check(site=site, key=(*key, "mask"))
        layer.check(site=site, key=key)


@cache
def layer_types() -> tuple[type[Layer], ...]:
    """All kinds of layers that are installed, in the order of their names."""
    return parts(Layer, "terrain_forge.terrain.layers", LAYERS)
