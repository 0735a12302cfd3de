"""Memory of a ray engine, which is used until it is given back."""

from __future__ import annotations

from terrain_forge.base import TerrainForgeError


class Held:
    """What a ray engine made; after its `release` nothing reaches it any more."""

    _handle = 0

    @property
    def handle(self) -> int:
        """Its address, for the engine and for kernels.

        Raises:
            TerrainForgeError: after `release`; an engine would read memory of others.
        """
        if not self._handle:
            raise TerrainForgeError(
                "the scene or setting is closed: use it within its `with` block"
            )
        return self._handle
