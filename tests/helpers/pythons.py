"""Consumers in Pythons of their own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import pytest

from tests.helpers.places import PROGRAMS


def asked(variable: str, module: str, script: str, *arguments: object, text: str = "") -> Any:
    """What a program prints as JSON in the Python that a variable names, or else in ours.

    Skips the test where that has no such module.
    """
    python = os.environ.get(variable, sys.executable)
    there = subprocess.run([python, "-c", f"import {module}"], capture_output=True, check=False)
    if there.returncode:
        pytest.skip(f"{module} is not installed ({variable})")
    command = [python, str(PROGRAMS / script), *map(str, arguments)]
    run = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout.splitlines()[-1])
