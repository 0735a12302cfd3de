"""Embree's C interface, reached inside the embreex wheel: its Python classes know no instances.

Constants and memory layouts are those of Embree 4.4's public headers (`rtcore_*.h`). The
instruction set is pinned, since Embree repeats itself to the bit over runs and threads but not over
instruction sets.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from itertools import product
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import TerrainForgeError
from terrain_forge.scene.held import Held

_OLDEST, _TOO_NEW = 40400, 50000
_PINNED = b"isa=avx2"

_TRIANGLES, _GRID, _INSTANCES = 0, 2, 122
_INDEX, _VERTEX, _GRIDS, _TRANSFORM = 0, 1, 8, 23
_UINT, _UINT3, _FLOAT3, _FLOAT3X4_ROWS, _GRID_FORMAT = 0x5001, 0x5003, 0x9003, 0x9134, 0xA001
_ROBUST = 4
_VERSION = 0
_LARGEST_GRID = 32767
_MOST_TRIANGULATED = 4_000_000
"""Nodes up to which a ground may take the memory of its triangles, some 130 bytes each."""
_GRID_RECORD = np.dtype(
    [("start", "u4"), ("stride", "u4"), ("columns", "u2"), ("rows", "u2")], align=True
)

_pointer, _uint, _int, _size = (ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_size_t)
_FUNCTIONS: dict[str, tuple[list[type], type | None]] = {
    "rtcNewDevice": ([ctypes.c_char_p], _pointer),
    "rtcGetDeviceProperty": ([_pointer, _int], ctypes.c_ssize_t),
    "rtcGetDeviceError": ([_pointer], _int),
    "rtcGetDeviceLastErrorMessage": ([_pointer], ctypes.c_char_p),
    "rtcNewScene": ([_pointer], _pointer),
    "rtcSetSceneFlags": ([_pointer, _int], None),
    "rtcCommitScene": ([_pointer], None),
    "rtcReleaseScene": ([_pointer], None),
    "rtcNewGeometry": ([_pointer, _int], _pointer),
    "rtcSetSharedGeometryBuffer": (
        [_pointer, _int, _uint, _int, _pointer, _size, _size, _size],
        None,
    ),
    "rtcSetGeometryInstancedScenes": ([_pointer, _pointer, _size], None),
    "rtcCommitGeometry": ([_pointer], None),
    "rtcAttachGeometry": ([_pointer, _pointer], _uint),
    "rtcReleaseGeometry": ([_pointer], None),
}
_TRACERS = ("rtcIntersect8", "rtcOccluded8")


class _QueryArguments(ctypes.Structure):
    _fields_ = (
        ("flags", _uint),
        ("feature_mask", _uint),
        ("context", _pointer),
        ("filter", _pointer),
        ("function", _pointer),
    )


_COHERENT = _QueryArguments(1 << 16, 0xFFFFFFFF, None, None, None)
_INCOHERENT = _QueryArguments(0, 0xFFFFFFFF, None, None, None)
COHERENT = ctypes.addressof(_COHERENT)
"""Address of query arguments for packets whose rays run side by side (cameras, the Sun)."""
INCOHERENT = ctypes.addressof(_INCOHERENT)
"""Address of query arguments for packets of unrelated rays."""


def _missing(what: str) -> TerrainForgeError:
    return TerrainForgeError(
        f"ray tracing: {what}; it needs Embree 4.4 from the package embreex: "
        "pip install 'embreex>=4.4,<5'"
    )


def _library_file() -> Path:
    package = find_spec("embreex")
    if package is None or package.origin is None:
        raise _missing("embreex is not installed")
    home = Path(package.origin).parent
    folders = (home.with_name("embreex.libs"), home / ".dylibs", home)
    patterns = product(folders, ("libembree4*", "embree4*.dll"))
    found = [file for folder, pattern in patterns for file in sorted(folder.glob(pattern))]
    if not found:
        raise _missing(f"no Embree library beside {home}")
    return found[0]


@cache
def load_library() -> ctypes.CDLL:
    """Embree, its ray functions made known to compiled kernels.

    Raises:
        TerrainForgeError: where Embree is missing or cannot be loaded.
    """
    file = _library_file()
    try:
        library = ctypes.CDLL(str(file))
        for name, (arguments, result) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.argtypes, function.restype = arguments, result
        for name in _TRACERS:
            address = ctypes.cast(getattr(library, name), _pointer).value
            llvm.add_symbol(name, address)
    except (OSError, AttributeError) as error:
        raise _missing(f"{file.name} cannot be used ({error})") from None
    return library


@cache
def device() -> int:
    """The Embree device that all scenes of this process share.

    Raises:
        TerrainForgeError: where Embree is missing or of another version.
    """
    library = load_library()
    # A processor without AVX2 refuses the pin and gets the best that it has.
    handle = library.rtcNewDevice(_PINNED) or library.rtcNewDevice(None)
    if not handle:
        raise _missing("this processor is not supported")
    version = library.rtcGetDeviceProperty(handle, _VERSION)
    if not _OLDEST <= version < _TOO_NEW:
        raise _missing(f"found Embree {version // 10000}.{version // 100 % 100}")
    return int(handle)


def _raise_error() -> None:
    library = load_library()
    code = library.rtcGetDeviceError(device())
    if code:
        message = library.rtcGetDeviceLastErrorMessage(device()) or b"unknown error"
        raise TerrainForgeError(f"Embree: {message.decode()} (error {code})")


class EmbreeScene(Held):
    """Geometry that rays can be cast at; it owns its buffers and lives until `release`."""

    def __init__(self) -> None:
        library = load_library()
        self._handle = int(library.rtcNewScene(device()))
        library.rtcSetSceneFlags(self.handle, _ROBUST)
        self._kept: list[object] = []

    def add_grid(self, vertices: NDArray[np.float32], *, often: bool = False) -> None:
        """Add a grid of vertices [m], shape [rows, columns, 3].

        Embree cuts the cell (row, column) from (row, column + 1) to (row + 1, column). A scene that
        rays are cast at `often` has the same triangles one by one: where they are not too many they
        are found in four fifths of the time, and take three times as long to make ready.
        """
        rows, columns = vertices.shape[:2]
        if often and rows * columns <= _MOST_TRIANGULATED:
            self.add_triangles(vertices.reshape(-1, 3), _cut(rows, columns))
            return
        if max(rows, columns) > _LARGEST_GRID:
            raise TerrainForgeError(
                f"ray tracing: {columns} × {rows} nodes, at most {_LARGEST_GRID} each way"
            )
        grid = np.array([(0, columns, columns, rows)], dtype=_GRID_RECORD)
        geometry = load_library().rtcNewGeometry(device(), _GRID)
        self._share(geometry, _GRIDS, _GRID_FORMAT, grid)
        self._share(geometry, _VERTEX, _FLOAT3, _padded(vertices.reshape(-1, 3)), rows * columns)
        self._attach(geometry)

    def add_triangles(self, vertices: NDArray[np.floating], faces: NDArray[np.int32]) -> None:
        """Add a mesh: vertices [m], shape [vertices, 3], and corner indices, shape [faces, 3]."""
        geometry = load_library().rtcNewGeometry(device(), _TRIANGLES)
        self._share(geometry, _INDEX, _UINT3, np.ascontiguousarray(faces, np.uint32))
        self._share(geometry, _VERTEX, _FLOAT3, _padded(vertices), len(vertices))
        self._attach(geometry)

    def add_instances(
        self,
        scenes: Sequence[EmbreeScene],
        *,
        which: NDArray[np.int32],
        transforms: NDArray[np.float32],
    ) -> None:
        """Add copies of committed scenes, which are kept until this one is released.

        `which` has each copy's index into them, `transforms` lead to this scene's frame, shape
        [copies, 3, 4].
        """
        if len(which) == 1:  # Embree then takes the first scene, whatever the index says
            scenes, which = [scenes[int(which[0])]], np.zeros(1, np.int32)
        geometry = load_library().rtcNewGeometry(device(), _INSTANCES)
        handles = (_pointer * len(scenes))(*(scene.handle for scene in scenes))
        load_library().rtcSetGeometryInstancedScenes(
            geometry, ctypes.cast(handles, _pointer), len(scenes)
        )
        self._share(geometry, _INDEX, _UINT, np.ascontiguousarray(which, np.uint32))
        rows = np.ascontiguousarray(transforms, np.float32).reshape(-1, 12)
        self._share(geometry, _TRANSFORM, _FLOAT3X4_ROWS, rows)
        self._attach(geometry)

    def commit(self) -> None:
        """Build the tree; the scene can be traced from now on."""
        load_library().rtcCommitScene(self.handle)
        _raise_error()

    def release(self) -> None:
        """Give the memory back."""
        if self._handle:
            load_library().rtcReleaseScene(self._handle)
        self._handle = 0
        self._kept.clear()

    def _share(
        self, geometry: int, slot: int, form: int, array: NDArray[np.generic], count: int = 0
    ) -> None:
        self._kept.append(array)
        load_library().rtcSetSharedGeometryBuffer(
            geometry, slot, 0, form, array.ctypes.data, 0, array.strides[0], count or len(array)
        )

    def _attach(self, geometry: int) -> None:
        library = load_library()
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(self.handle, geometry)
        library.rtcReleaseGeometry(geometry)
        _raise_error()


def _cut(rows: int, columns: int) -> NDArray[np.int32]:
    """Corners of a grid's triangles, shape [triangles, 3]."""
    nodes = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, :-1], nodes[1:, 1:]
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([b, d, c], axis=-1)], axis=2)
    return faces.reshape(-1, 3)


def _padded(vertices: NDArray[np.floating]) -> NDArray[np.float32]:
    """The vertices with one more behind them, since Embree reads four floats at each."""
    padded = np.zeros((len(vertices) + 1, 3), dtype=np.float32)
    padded[:-1] = vertices
    return padded
