"""What rocks are besides their shape: rigid bodies that can be pushed."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.model import RockField, RockLibrary


def inertias(field: RockField, library: RockLibrary) -> Array:
    """Inertia tensors about the centres of mass in the rocks' own axes [kg m²], [rocks, 3, 3].

    A prototype's tensor is for 1 kg/m³ and grows with the fifth power of size.
    """
    of_shape = np.array([prototype.inertia for prototype in library.prototypes])
    density = field.mass / field.volume
    return of_shape[field.prototype] * (density * portable.power(field.scale, 5.0))[:, None, None]


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and axes of inertia tensors, shape [n, 3, 3].

    Returns:
        Moments in ascending order, shape [n, 3], and quaternions (w, x, y, z) from the principal
        axes to those of the tensors, shape [n, 4].
    """
    from scipy.spatial.transform import Rotation

    moments, axes = np.linalg.eigh(inertia)
    axes[..., 2] *= np.linalg.det(axes)[..., None]  # eigenvectors may come as a mirrored frame
    return moments, np.roll(Rotation.from_matrix(axes).as_quat(), 1, axis=-1)
