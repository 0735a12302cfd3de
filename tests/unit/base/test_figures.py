"""What we draw into files does not depend on a user's style."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl

import terrain_forge
from terrain_forge.model.plot import plot_site
from terrain_forge.truth.size_frequency_figure import write_figure
from tests.helpers import worlds

STYLE = {"text.usetex": True, "axes.linewidth": 5.0, "savefig.dpi": 30, "font.size": 3.0}
NOTHING: dict[str, Any] = {
    "populations": [], "lists": [], "together": {}, "area_m2": 1.0, "confidence": 0.95
}  # fmt: skip


def test_a_file_is_the_same_in_every_style(tmp_path: Path) -> None:
    site = worlds.site()
    shown = site._repr_html_()
    write_figure(NOTHING, tmp_path / "plain.png")
    with mpl.rc_context(STYLE):
        write_figure(NOTHING, tmp_path / "styled.png")
        assert site._repr_html_() == shown
        assert mpl.rcParams["savefig.dpi"] == 30
    assert (tmp_path / "styled.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


def test_nor_does_it_depend_on_a_matplotlibrc(tmp_path: Path) -> None:
    styled = tmp_path / "styled"
    styled.write_text("\n".join(f"{name}: {value}" for name, value in STYLE.items()))
    code = f"from {write_figure.__module__} import write_figure; from pathlib import Path; "
    code += f"import matplotlib; draw = lambda name: write_figure({NOTHING!r}, Path(name)); "
    code += "draw('styled.png'); matplotlib.rcdefaults(); draw('plain.png')"
    own = {**os.environ, "MATPLOTLIBRC": str(styled)}
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=own, check=True)
    assert (tmp_path / "styled.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


def test_a_users_axes_keep_the_users_style() -> None:
    from matplotlib.figure import Figure

    with mpl.rc_context({"axes.linewidth": 5.0}):
        axes = plot_site(worlds.site(), Figure().subplots())
    assert axes.spines["left"].get_linewidth() == 5.0


def test_all_that_save_figures_have_our_style() -> None:
    package = Path(terrain_forge.__file__).parent
    for file in package.rglob("*.py"):
        if "savefig(" in (text := file.read_text(encoding="utf-8")):
            assert "@own_style()" in text, file
