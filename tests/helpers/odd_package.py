"""A package whose parts return what they must not, each in a way of its own."""

from __future__ import annotations

POINTS = """[terrain_forge.exporters]
silent = odd_exporter
gone = gone_exporter
liar = liar_exporter
leaver = leaving_exporter
splitter = splitting_exporter
strayer = straying_exporter
ending = ending_exporter
lone = lone_exporter
worded = worded_exporter
weighed = weighed_exporter
truth = liar_exporter
../evil = liar_exporter
a,b = liar_exporter
[terrain_forge.layers]
odd = odd_layer
typo = typo_layer
moved = moved_layer
[terrain_forge.size_laws]
odd = odd_law
[terrain_forge.route_shapes]
odd = odd_shape
[terrain_forge.checks]
odd = odd_check
meddler = meddling_check
[terrain_forge.report_sections]
odd = odd_section
[terrain_forge.instruments]
odd = odd_instruments
[terrain_forge.bodies]
rock = rock_body
[terrain_forge.systems]
fleet = odd_systems
none = odd_layer
[terrain_forge.layer]
misnamed = odd_layer
"""
HEAD = """from dataclasses import dataclass
from typing import Literal
import numpy as np
"""
SPEC = "@dataclass(frozen=True, kw_only=True)\n"
MODULES = {
    "odd_systems/__init__.py": "",
    "odd_systems/broken.yaml": "about: [1,2\n",
    "odd_systems/keyed.yaml": "? [a, b]\n: 1\n",
    "odd_systems/kiss-icp.yaml": "about: x\n",
    "odd_systems/lacking.yaml": "about: x\n",
    "odd_systems/mine.yaml": "about: x\nneeds: []\ncommand: 'run {recording} {output}'\n",
    "gone_exporter.py": "import a_module_that_nobody_has\n",
    "odd_exporter.py": HEAD
    + "from terrain_forge.base import Spec\n"
    + SPEC
    + "class Options(Spec): pass\n"
    + "def export(world, directory, *, options): (directory / 'a').write_text('a')\n",
    "liar_exporter.py": HEAD
    + "from pathlib import Path\nfrom terrain_forge.base import Spec\n"
    + "from terrain_forge.model import ExportReport\n"
    + SPEC
    + "class Options(Spec):\n    file: str = 'b'\n"
    + "def export(world, directory, *, options):\n"
    + "    (directory / 'link').symlink_to(__file__)\n"
    + "    return ExportReport(files=(Path(options.file),), losses=())\n",
    "splitting_exporter.py": HEAD
    + "from terrain_forge.base import Spec\n"
    + "from terrain_forge.model import ExportReport\n"
    + SPEC
    + "class Options(Spec): pass\n"
    + "def export(world, directory, *, options):\n"
    + "    return ExportReport(files=(), losses='none')\n",
    "straying_exporter.py": HEAD
    + "import os\nfrom terrain_forge.base import Spec\n"
    + "from terrain_forge.model import ExportReport\n"
    + "from terrain_forge.validation import Consumer, Reading\n"
    + SPEC
    + "class Options(Spec):\n    what: str = 'write'\n"
    + "def export(world, directory, *, options):\n"
    + "    if options.what == 'link': (directory / 'mine').symlink_to(__file__)\n"
    + "    if options.what == 'go': os.chdir('/')\n"
    + "    if options.what == 'pipe': os.mkfifo(directory / 'mine')\n"
    + "    if options.what == 'bytes': (directory / 'mine\\udcff').write_text('x')\n"
    + "    if options.what == 'write': (directory.parent / 'mine').mkdir()\n"
    + "    if options.what == 'keep': (directory / 'kept').write_text('kept')\n"
    + "    if options.what == 'read': open('/nowhere/mine')\n"
    + "    if options.what == 'lost': open(directory / 'gone' / 'mine', 'w')\n"
    + "    if options.what == 'full': raise OSError(28, 'full')\n"
    + "    if options.what == 'locked': raise OSError(13, 'locked', str(directory / 'a'))\n"
    + "    return ExportReport(files=(), losses=())\n"
    + "def read(sample, folder, options, scratch):\n"
    + "    if options.what == 'log': (folder / 'log').write_text('read')\n"
    + "    if options.what == 'leave': os.chdir('/')\n"
    + "    return Reading(consumer='reader')\n"
    + "CONSUMERS = (Consumer(name='reader', read=read, quick=True),)\n",
    **{
        f"{name}_exporter.py": HEAD
        + "from pathlib import Path\nfrom terrain_forge.base import Spec\n"
        + "from terrain_forge.model import ExportReport\n"
        + "from terrain_forge.validation import Consumer\n"
        + SPEC
        + f"class Options(Spec):\n    {more}\n"
        + "def export(world, directory, *, options):\n"
        + "    return ExportReport(files=(), losses=())\n"
        + last
        for name, more, last in (
            ("lone", "pass", "CONSUMERS = Consumer(name='a', read=export)\n"),
            ("worded", "pass", "def opening(folder, options): return 'do it'\n"),
            ("weighed", "bytes_each = 'many'", ""),
        )
    },
    "odd_instruments.py": "from terrain_forge.sensors import Series\n"
    + "class Base(Series):\n    def streams(self): pass\n"
    + "    def calibration(self): pass\n    def samples(self): pass\n"
    + "class Up(Base): kind, folder = 'up', '../up'\n"
    + "class Eye(Base): kind, folder = 'eye', 'cam'\n"
    + "class True_(Base): kind, folder = 'true', 'state_groundtruth_estimate'\n"
    + "class Fine(Base): kind, folder = 'fine', 'fine'\n",
    "leaving_exporter.py": HEAD
    + "import sys\nfrom terrain_forge.base import Spec\n"
    + SPEC
    + "class Options(Spec): pass\n"
    + "def export(world, directory, *, options): sys.exit(0)\n",
    "ending_exporter.py": "import sys\nsys.exit(0)\n",
    "typo_layer.py": HEAD
    + "from terrain_forge.terrain import Layer\n"
    + SPEC
    + "class Typo(Layer):\n    kind: Literal['typo'] = 'tpyo'\n"
    + "    def relief(self, **_): return 0.0\n",
    "moved_layer.py": "import os\nos.chdir('/')\n",
    "odd_layer.py": HEAD
    + "import os\nfrom terrain_forge.terrain import Layer\n"
    + SPEC
    + "class Odd(Layer):\n    kind: Literal['odd'] = 'odd'\n    what: str = 'nan'\n"
    + "    def reach(self, site): return {'low': -1.0, 'text': '1'}.get(self.what, 0.0)\n"
    + "    def relief(self, *, site, window, elevation):\n"
    + "        if self.what == 'go': os.chdir('/')\n"
    + "        return {'nan': np.full_like(elevation, np.nan), 'none': None,\n"
    + "                'shape': np.ones((2, 2)), 'ok': elevation, 'far': elevation + 1e300,\n"
    + "                'go': elevation,\n"
    + "                'number': 0.1, 'truths': elevation > 0, 'masked': np.ma.array(elevation),\n"
    + "                'place': elevation if self.what != 'place' else elevation.__iadd__(1.0),\n"
    + "                }[self.what] if self.what not in ('exit', 'file') else (\n"
    + "                    exit(0) if self.what == 'exit' else open('/nowhere/mine'))\n"
    + "    def facts(self, site): return 3\n"
    + "    def brightness(self, *, site, window): return np.ones((2, 2))\n",
    "odd_law.py": HEAD
    + "from terrain_forge.rocks import SizeLaw\n"
    + SPEC
    + "class Odd(SizeLaw):\n    kind: Literal['odd'] = 'odd'\n    wrong: str = ''\n"
    + "    def cumulative_number(self, d):\n"
    + "        return np.asarray(d) * np.nan if self.wrong == 'number' else 1e-2 / np.asarray(d)\n"
    + "    def cumulative_area(self, d): return 0.01 * np.exp(-np.asarray(d))\n"
    + "    def cover_variance(self, smallest, largest, area): return 1e-4 / area\n"
    + "    def sample(self, hashes, smallest, largest):\n"
    + "        return None if self.wrong == 'sample' else np.full(len(hashes), smallest)\n"
    + "    def report(self):\n"
    + "        return {'rate': np.inf} if self.wrong == 'report' else {'rate': 1.0}\n",
    "odd_shape.py": HEAD
    + "from terrain_forge.paths import Curve, NamedShape\n"
    + SPEC
    + "class Odd(NamedShape):\n    kind: Literal['odd'] = 'odd'\n    what: str = 'none'\n"
    + "    def outline(self, key):\n"
    + "        if self.what == 'none': return None\n"
    + "        t = np.linspace(0.0, 2.0 * np.pi, 8 if self.what == 'far' else 400)\n"
    + "        position = np.stack([np.sin(t), -np.cos(t)], -1)\n"
    + "        ahead = {'side': t * 0.0, 'wrapped': t % np.pi}.get(self.what, t)\n"
    + "        return Curve(position=position, heading=ahead)\n",
    "odd_check.py": "from terrain_forge.model import at_most\n"
    + "from terrain_forge.validation import Inspection\n"
    + "class Nan(Inspection):\n    kind = 'odd'\n    group = 'ground'\n"
    + "    def checks(self, built):\n"
    + "        yield at_most('odd: figure', float('nan'), 1.0, unit='m')\n"
    + "    def report(self): return {'odd': {'mean': float('nan')}}\n"
    + "class Thief(Nan):\n    kind = 'thief'\n"
    + "    def checks(self, built): return ()\n"
    + "    def report(self): return {'checks': [], 'more': 1}\n"
    + "class None_(Nan):\n    kind = 'none'\n"
    + "    def checks(self, built): return None\n"
    + "    def report(self): return {'kept': 1}\n"
    + "class Leaver(Nan):\n    kind = 'leaver'\n"
    + "    def checks(self, built): exit(0)\n"
    + "    def report(self): return {}\n",
    "meddling_check.py": "print('hello')\n"
    + "from terrain_forge.validation import Inspection\n"
    + "class Meddler(Inspection):\n    kind = 'meddler'\n"
    + "    def checks(self, built):\n"
    + "        if (file := built.directory / 'strayer' / 'kept').exists(): file.write_text('')\n"
    + "        return ()\n"
    + "    def write(self, built, folder):\n"
    + "        if (built.directory / 'spoilt').exists(): (folder / 'report.json').unlink()\n"
    + "        return ()\n",
    "rock_body.py": "import dataclasses\n"
    + "from terrain_forge.model.bodies.mercury import MERCURY\n"
    + "ROCK = dataclasses.replace(MERCURY, name='rock')\n",
    "odd_section.py": "from terrain_forge.report import Block, Section, facts, heading\n"
    + "class Good(Section):\n    kind, title, place = 'good', 'Good', 46\n"
    + "    def blocks(self, built): return (facts([('good', 'kept')]) for _ in range(2))\n"
    + "class Text(Good):\n    kind = title = 'text'\n"
    + "    def blocks(self, built): return ['abc']\n"
    + "class Nothing(Good):\n    kind = title = 'nothing'\n"
    + "    def blocks(self, built): return None\n"
    + "class Single(Good):\n    kind = title = 'single'\n"
    + "    def blocks(self, built):\n        return [facts([('a',)])]\n"
    + "class Number(Good):\n    kind = title = 'number'\n"
    + "    def blocks(self, built):\n        return [facts([('a', 3.5)])]\n"
    + "class Late(Good):\n    kind = title = 'late'\n"
    + "    def blocks(self, built):\n        yield heading('never shown')\n        raise KeyError\n"
    + "class Made(Good):\n    kind = title = 'made'\n"
    + "    def blocks(self, built): return [Block(kind='unheard of')]\n"
    + "class Bare(Good):\n    kind = title = 'bare'\n"
    + "    def blocks(self, built): return [Block(kind='facts')]\n"
    + "class Placed(Good):\n    kind = title = 'placed'\n    place = '46'\n",
}
