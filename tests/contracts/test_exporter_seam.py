"""What exporters bring: how their folders are read back, by independent code, and opened."""

import ast
import json
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import ModuleType

import pytest

from terrain_forge.base import RecipeError, Stopwatch
from terrain_forge.building import exports_in, write_export, write_files, write_manifest
from terrain_forge.model import Export, ExportReport, Opening, exporter, plain_options, prepare
from terrain_forge.recipe import ExportOrder, ValidateSpec
from terrain_forge.report.section import Built
from terrain_forge.report.sections.summary import Usage
from terrain_forge.tiling import require_tiles
from terrain_forge.validation import BuiltFolder, Consumer, NotRun
from terrain_forge.validation.suite import conformance, consumers, quick_checks
from tests.helpers import worlds
from tests.helpers.places import ROOT, parsed

KINDS = sorted(path.parent.name for path in (ROOT / "exporters").glob("*/writing.py"))
READBACKS = sorted((ROOT / "exporters").glob("*/readback.py"))
PROBES = sorted((ROOT / "exporters").glob("*/probe.py"))


@pytest.mark.parametrize("path", [*READBACKS, *PROBES], ids=lambda p: f"{p.parent.name}-{p.stem}")
def test_what_reads_back_shares_nothing_with_what_wrote(path):
    imported = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ImportFrom):
            imported.append("." * node.level + (node.module or ""))
        elif isinstance(node, ast.Import):
            imported += [name.name for name in node.names]
    assert not [name for name in imported if name.startswith((".", "terrain_forge.exporters"))]


@pytest.mark.parametrize("kind", KINDS)
def test_every_exporter_of_ours_is_read_back_and_says_how_to_open(tmp_path, kind):
    module = exporter(kind)
    (tmp_path / "my place").mkdir()
    (tmp_path / "my place" / "rover.urdf").touch()
    words = module.opening(tmp_path / "my place", module.Options())
    assert isinstance(words, Opening)
    assert "my place" in words.commands
    assert all(isinstance(consumer, Consumer) for consumer in module.CONSUMERS)
    assert any(consumer.full for consumer in module.CONSUMERS)


@pytest.mark.parametrize("kind", KINDS)
def test_the_manifest_tells_who_wrote_a_folder_and_how(small_world, tmp_path, kind):
    module = exporter(kind)
    options = module.Options()
    folder = Path("validation", kind)
    (tmp_path / folder).mkdir(parents=True)
    export = Export(
        folder=folder.as_posix(), kind=kind, options=plain_options(options), losses=("Much.",)
    )
    write_manifest(small_world.site, tmp_path, exports=[export])
    manifest = json.loads((tmp_path / "manifest.json").read_text(encoding="utf-8"))
    (found,) = exports_in(manifest)
    assert found == export
    assert found.opened() == (module, options)


def test_options_that_are_gone_are_told_in_our_words(caplog):
    """As of another version of an exporter's package; once, though asked twice."""
    export = Export(folder="glb", kind="glb", options={"draco": 1})
    with pytest.raises(RecipeError, match="exporter 'glb' refuses its options: draco: unknown key"):
        export.opened()
    assert consumers(export) == consumers(export) == []
    assert caplog.text.count("export glb is not read back: ") == 1


def test_what_is_written_is_recorded_with_its_defaults(small_world, tmp_path):
    module = exporter("geotiff")
    options = module.Options(products=("elevation",))
    order = ExportOrder(folder="maps", kind="geotiff", exporter=module, options=options)
    written = write_export(small_world, tmp_path, order)
    assert (written.folder, written.kind) == ("maps", "geotiff")
    expected = {"products": ["elevation"], "heights": "world", "cloud_optimized": False}
    assert written.options == expected
    assert written.losses


def test_libraries_are_loaded_before_other_threads_run(small_world, tmp_path):
    said = []

    class Apart:
        Options = exporter("geotiff").Options

        @staticmethod
        def prepare(options):
            said.append(("prepare", options, threading.active_count()))

        @staticmethod
        def export(world, directory, *, options):
            said.append(("export", options, threading.active_count()))
            return ExportReport(files=(), losses=())

    before, options = threading.active_count(), Apart.Options()
    order = ExportOrder(folder="mine", kind="apart", exporter=Apart, options=options)
    write_files(small_world, tmp_path, orders=(order,), watch=Stopwatch(lambda *_: None))
    (first, *_, during) = said
    assert first == ("prepare", options, before)
    assert during[2] > before


@pytest.mark.parametrize("kind", ["usd", "rover"])
def test_openusd_is_loaded_by_preparing(kind):
    code = (
        "import sys; from terrain_forge.model import exporter, prepare;"
        f"e = exporter({kind!r}); assert 'pxr' not in sys.modules;"
        "prepare(e, e.Options()); assert 'pxr.Usd' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=100)


def test_an_interrupt_waits_until_an_exporters_code_is_loaded():
    """OpenUSD prints what interrupts its import, and goes on half made."""
    loaded = []

    class Door:
        def __getattr__(self, name):
            signal.raise_signal(signal.SIGINT)
            loaded.append(name)
            return lambda *_: None

    order = ExportOrder(folder="door", kind="door", exporter=Door(), options=None)
    with pytest.raises(KeyboardInterrupt):
        prepare(order.exporter, order.options)
    with pytest.raises(KeyboardInterrupt):
        require_tiles(worlds.site().recipe, [order])
    assert loaded == ["export", "prepare", "export_tile", "join_tiles"]


def test_the_drive_takes_an_mjcf_and_no_other_world_xml(small_world, tmp_path):
    def mjcf(*exports):
        found = [Export(folder=folder, kind=kind, options={}) for folder, kind in exports]
        built = BuiltFolder(
            world=small_world, directory=tmp_path, exports=tuple(found), spec=ValidateSpec()
        )
        return built.mjcf

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "world.xml").touch()
    (tmp_path / "mine" / "scene.xml").touch()
    assert mjcf(("mine", "xyz")) is None
    assert mjcf(("mine", "xyz"), ("sim", "mjcf")) == tmp_path / "sim"


def test_the_exporter_of_the_documentation_works(small_world, tmp_path, monkeypatch):
    text = (ROOT / "docs" / "exporters" / "writing-one.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    module = ModuleType("documented")
    monkeypatch.setitem(sys.modules, "documented", module)
    exec(compile(code, "writing-one.md", "exec", dont_inherit=True), vars(module))
    monkeypatch.setattr("terrain_forge.model.exporting.exporter", lambda name: module)
    options = module.Options()
    order = ExportOrder(folder="mine", kind="xyz", exporter=module, options=options)
    export = write_export(small_world, tmp_path, order)
    (check,) = quick_checks(small_world, tmp_path, [export], points=50)
    assert (check.name, check.passed) == ("mine: ground", True)
    bare = small_world.replace(trajectories=())
    found = {e.aspect: e for e in conformance(bare, tmp_path, [export], points=50)}
    assert found["ground"].status == "pass"
    assert found["masses"].note == "points have none"
    page = str(Usage().blocks(Built(small_world, tmp_path, (export,))))
    assert "CloudCompare mine/points.xyz" in page


def test_a_program_that_is_missing_neither_passes_nor_fails(small_world, tmp_path, monkeypatch):
    def read(sample, folder, options, scratch):
        raise NotRun("it is not installed")

    module = exporter("geotiff")
    monkeypatch.setattr(module, "CONSUMERS", (Consumer(name="mine", read=read, quick=True),))
    export = Export(folder="maps", kind="geotiff", options={})
    assert quick_checks(small_world, tmp_path, [export], points=5) == []
    bare = small_world.replace(trajectories=())
    (entry,) = conformance(bare, tmp_path, [export], points=5)
    assert (entry.status, entry.note, entry.check) == ("not run", "it is not installed", None)


def test_an_opening_that_raises_is_left_out(small_world, tmp_path, monkeypatch, caplog):
    def opening(folder, options):
        raise LookupError("no idea")

    monkeypatch.setattr(exporter("geotiff"), "opening", opening)
    export = Export(folder="maps", kind="geotiff", options={})
    page = str(Usage().blocks(Built(small_world, tmp_path, (export,))))
    assert "Python" in page
    assert "how to open maps is not known: no idea" in caplog.text
