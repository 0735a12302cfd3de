"""What a displacement layer is, and finding all of them."""

from __future__ import annotations

import logging
import pkgutil
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from terrain_forge.site import Site, Window
from terrain_forge.specs import Spec

LAYERS = "terrain_forge.layers"
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Layer(Spec):
    """One step of the ground: a spec with the relief that it adds.

    A subclass has a field `kind` (a Literal with its default) and is found if its module lies in
    `terrain_forge.terrain.layers` or is named by an entry point of the group
    `terrain_forge.layers`.
    """

    def images(self) -> tuple[str, ...]:
        """Image files that the layer reads, as the recipe writes them."""
        return ()

    def relief(
        self, *, site: Site, window: Window, elevation: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Heights to add [m] at the window's nodes, shape [rows, columns].

        A pure function of the site's coordinates: a node has the same bits in every window.
        `elevation` is the ground so far [m]; only the node's own value may be used.
        """
        raise NotImplementedError


@cache
def layer_types() -> tuple[type[Layer], ...]:
    """All kinds of layers that are installed, in the order of their names."""
    from terrain_forge.terrain import layers

    names = [m.name for m in pkgutil.iter_modules(layers.__path__, f"{layers.__name__}.")]
    modules = [import_module(name) for name in names]
    modules += [module for point in entry_points(group=LAYERS) if (module := _load(point))]
    found = [
        member
        for module in modules
        for member in vars(module).values()
        if isinstance(member, type) and issubclass(member, Layer) and member is not Layer
    ]
    return tuple(sorted(set(found), key=lambda layer: layer.__name__))


def _load(point: EntryPoint) -> ModuleType | None:
    try:
        return import_module(point.module)
    except Exception as error:  # whatever a foreign package raises must not break ours
        _log.warning("layer %r (%s) is skipped: %s", point.name, point.value, error)
        return None
