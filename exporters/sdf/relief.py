"""Normal maps: what the ground's roughness below its grid makes of the light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.seeds import stage_key
from terrain_forge.terrain.layers.fractal import octave_amplitudes
from terrain_forge.terrain.noise import octaves
from terrain_forge.world import World


def normal_map(tile: World) -> NDArray[np.uint8]:
    """Normals relative to the mesh, one per node like its colours, shape [rows, columns, 3].

    The mesh shows the relief down to its grid; this is the next octave of the site's roughness,
    for the eye alone. Red is the tilt to the east, green to the north, 128 is level; rows run
    north. It is addressed by place, so that tiles meet without a seam.
    """
    ground, roughness = tile.ground, tile.site.roughness
    spacing = ground.spacing
    wavelengths = np.array([spacing])
    heights = octaves(
        stage_key(tile.site.seed, "appearance/relief"),
        east=np.append(ground.east, ground.east[-1] + spacing) - 0.5 * spacing,
        north=np.append(ground.north, ground.north[-1] + spacing) - 0.5 * spacing,
        wavelengths=wavelengths,
        amplitudes=octave_amplitudes(roughness.hurst, roughness.deviation, wavelengths),
    )
    along = 0.5 * (heights[1:] + heights[:-1])
    across = 0.5 * (heights[:, 1:] + heights[:, :-1])
    normals = np.empty((*ground.shape, 3))
    normals[..., 0] = -np.diff(along, axis=1) / spacing
    normals[..., 1] = -np.diff(across, axis=0) / spacing
    normals[..., 2] = 1.0
    normals /= np.sqrt(np.einsum("ijk,ijk->ij", normals, normals))[..., None]
    result: NDArray[np.uint8] = np.rint(127.5 + 127.5 * normals).astype(np.uint8)
    return result
