"""Where compiled kernels are kept."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest


def _run(temporary: Path, code: str) -> subprocess.CompletedProcess[str]:
    """Run Python where numba finds no place of its own, as in a read-only container."""
    own = os.environ | {
        "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator",
        "NUMBA_CACHE_DIR": "",
        "TMPDIR": str(temporary),
    }
    return subprocess.run(
        [sys.executable, "-c", code], env=own, capture_output=True, text=True, check=False
    )


def test_kernels_lie_among_temporary_files_where_no_other_folder_takes_them(tmp_path: Path) -> None:
    tmp_path.chmod(0o2700)  # what is made in it belongs to its group
    found = _run(tmp_path, "from terrain_forge.base.seeds import zigzag; print(zigzag(-2))")
    assert found.stdout == "3\n", found.stderr
    (folder,) = tmp_path.iterdir()
    assert list(folder.rglob("seeds.zigzag*.nbi"))


@pytest.mark.parametrize("mode", [0o755, 0o770])
def test_kernels_that_others_may_have_written_are_not_run(tmp_path: Path, mode: int) -> None:
    (tmp_path / f"terrain-forge-kernels-{os.getuid()}").mkdir()
    (tmp_path / f"terrain-forge-kernels-{os.getuid()}").chmod(mode)
    found = _run(tmp_path, "import terrain_forge.base.kernels")
    assert "is not yours alone): name one in NUMBA_CACHE_DIR" in found.stderr
