"""Make the three.js bundle of the report page's 3-D view again: `python docs/make_view_bundle.py`.

Needs npm and its registry; only who changes the version or what the view takes from three.js runs
it. The bundle and its licence are kept beside the code, so that a build needs neither.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

THREE, ESBUILD = "0.187.0", "0.28.2"
BUNDLE = Path(__file__).parent.parent / "terrain_forge" / "report" / "bundle"


def main() -> None:
    """Install both packages into a temporary folder, bundle, and keep two files."""
    with tempfile.TemporaryDirectory() as folder:
        packages = [f"three@{THREE}", f"esbuild@{ESBUILD}"]
        subprocess.run(["npm", "install", "--silent", *packages], cwd=folder, check=True)
        entry = shutil.copy(BUNDLE / "three_entry.js", folder)
        options = ["--bundle", "--minify", "--format=iife", "--global-name=three"]
        options += ["--target=es2022", "--charset=utf8", "--legal-comments=inline"]
        output = f"--outfile={BUNDLE / 'three.js'}"
        subprocess.run(["npx", "esbuild", entry, *options, output], cwd=folder, check=True)
        shutil.copy(Path(folder) / "node_modules" / "three" / "LICENSE", BUNDLE / "LICENSE.three")
    print(f"three.js {THREE}: {(BUNDLE / 'three.js').stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
