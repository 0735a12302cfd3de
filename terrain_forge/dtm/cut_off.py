"""Rasters that are cut off, of those formats of which GDAL tells no error."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np


def is_cut_off(dataset: Any, path: Path) -> bool:
    """Whether a file is too short, of those formats of which GDAL reads zeros beyond its end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        match dataset.driver:
            case "ENVI":
                return path.stat().st_size < _needed(dataset)
            case "netCDF":
                return _ends_early(path)
            case "TGA":
                return not _is_whole_picture(path)
    return False


def _needed(dataset: Any) -> int:
    """Bytes that an ENVI file has at least."""
    header = dataset.tags(ns="ENVI")
    if header.get("file_compression", "0") != "0":
        return 0
    before = str(header.get("header_offset", "0"))
    samples = int(dataset.width * dataset.height)
    sizes = (int(np.dtype(kind).itemsize) for kind in dataset.dtypes)
    return (int(before) if before.isdecimal() else 0) + samples * sum(sizes)


def _ends_early(path: Path) -> bool:
    """Whether a classic netCDF file has less than its header says; kinds that scipy lacks pass."""
    from scipy.io import netcdf_file

    try:
        netcdf_file(path, mmap=True).close()
    except ValueError as error:
        return any(words in str(error) for words in ("must be a divisor", "cannot reshape array"))
    except (TypeError, LookupError, ArithmeticError, AttributeError, MemoryError, OSError):
        return False
    return False


def _is_whole_picture(path: Path) -> bool:
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.load()
    except Image.DecompressionBombError:
        return True
    except (OSError, ValueError, SyntaxError):
        return False
    return True
