"""Programs of npm that read our files."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest


def run_node(module: str, script: str, path: Path) -> Any:
    """What a script prints as JSON of a file; skips unless NODE_PATH leads to the module."""
    found = shutil.which("node") and subprocess.run(
        ["node", "-e", f"require({module!r})"], capture_output=True, check=False
    )
    if not found or found.returncode:
        pytest.skip(f"node with {module} is not installed")
    command = ["node", "-e", script, path]
    run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    return json.loads(run.stdout)
