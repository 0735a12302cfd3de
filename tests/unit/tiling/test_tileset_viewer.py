"""The 3D Tiles in viewers that are not ours: 3DTilesRendererJS and CesiumJS, in Chromium.

Wants Chromium, `npm install 3d-tiles-renderer three cesium`, and NODE_PATH to lead to its
node_modules.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import threading
from functools import partial
from html import unescape
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
MODULES = next(
    (
        Path(folder)
        for folder in os.environ.get("NODE_PATH", "").split(os.pathsep)
        if folder and (Path(folder) / "3d-tiles-renderer").is_dir()
    ),
    None,
)
FLAGS = [
    "--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--window-size=600,450", "--virtual-time-budget=60000",
]  # fmt: skip
pytestmark = [
    pytest.mark.consumer,
    pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed"),
    pytest.mark.skipif(MODULES is None, reason="NODE_PATH has no 3d-tiles-renderer"),
]

PAGE = """<!DOCTYPE html><meta charset="utf-8"><body><pre id="told"></pre>
<script type="importmap">{"imports": {
  "three": "/modules/three/build/three.module.js",
  "three/addons/": "/modules/three/examples/jsm/",
  "3d-tiles-renderer/three": "/modules/3d-tiles-renderer/build/index.three.js"}}</script>
<script type="module">
import * as THREE from "three";
import {TilesRenderer} from "3d-tiles-renderer/three";
const given = GIVEN, failed = [];
const renderer = new THREE.WebGLRenderer();
renderer.setSize(600, 450);
document.body.append(renderer.domElement);
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(60, 4 / 3, 0.1, 5000);
camera.up.set(0, 0, 1);
camera.position.set(...given.eye);
camera.lookAt(...given.at);
camera.updateMatrixWorld();
scene.add(new THREE.HemisphereLight(0xffffff, 0x554433, 2));
const tiles = new TilesRenderer("/site/glb/tileset.json");
tiles.errorTarget = given.error;
tiles.addEventListener("load-error", (event) => failed.push(String(event.url || event.error)));
scene.add(tiles.group);
tiles.setCamera(camera);
tiles.setResolutionFromRenderer(camera, renderer);
let still = 0, frames = 0;
function frame() {
  tiles.update();
  renderer.render(scene, camera);
  const {downloading, parsing} = tiles.stats, visible = tiles.visibleTiles.size;
  still = downloading + parsing === 0 && visible ? still + 1 : 0;
  frames++;
  if (still < 20) { setTimeout(frame, 20); return; }
  tiles.group.updateMatrixWorld(true);
  const shown = [...tiles.visibleTiles].map((tile) => tile.content.uri);
  const caster = new THREE.Raycaster(), down = new THREE.Vector3(0, 0, -1);
  const hits = given.places.map(([x, y]) => {
    caster.set(new THREE.Vector3(x, y, 1000), down);
    return caster.intersectObject(tiles.group, true).map((hit) => hit.point.z);
  });
  document.getElementById("told").textContent = JSON.stringify({shown, failed, hits, frames});
}
frame();
</script></body>"""

CESIUM_PAGE = """<!DOCTYPE html><meta charset="utf-8"><body><pre id="told"></pre>
<link rel="stylesheet" href="/modules/cesium/Build/Cesium/Widgets/widgets.css">
<div id="view" style="width: 600px; height: 450px"></div>
<script>window.CESIUM_BASE_URL = "/modules/cesium/Build/Cesium/";</script>
<script src="/modules/cesium/Build/Cesium/Cesium.js"></script>
<script>
const given = GIVEN, failed = [];
const widget = new Cesium.CesiumWidget("view", {
  baseLayer: false, globe: false, skyBox: false, skyAtmosphere: false, useDefaultRenderLoop: false,
});
const {scene, camera} = widget;
const place = Cesium.Transforms.eastNorthUpToFixedFrame(Cesium.Cartesian3.fromDegrees(0, 0));
const there = (point) =>
  Cesium.Matrix4.multiplyByPoint(place, new Cesium.Cartesian3(...point), new Cesium.Cartesian3());
scene.light = new Cesium.DirectionalLight({direction: Cesium.Cartesian3.subtract(
  there([0, 0, 0]), there([1, 1, 2]), new Cesium.Cartesian3())});
camera.lookAt(there(given.at), new Cesium.Cartesian3(...given.eye.map((x, i) => x - given.at[i])));
async function show() {
  const tiles = await Cesium.Cesium3DTileset.fromUrl("/site/glb/tileset.json", {
    modelMatrix: place, maximumScreenSpaceError: given.error, enablePick: true,
    dynamicScreenSpaceError: false, foveatedScreenSpaceError: false,
  });
  tiles.tileFailed.addEventListener((event) => failed.push(event.url + " " + event.message));
  let shown = [], still = 0, frames = 0;
  tiles.tileVisible.addEventListener((tile) => shown.push(tile.content.url));
  scene.primitives.add(tiles);
  function frame() {
    shown = [];
    widget.resize();
    widget.render();
    still = tiles.tilesLoaded && shown.length ? still + 1 : 0;
    frames++;
    if (still < 20) { setTimeout(frame, 20); return; }
    const hits = given.places.map(([x, y]) => {
      const spot = Cesium.Cartographic.fromCartesian(there([x, y, 0]));
      const height = tiles.getHeight(spot, scene);
      return height === undefined ? [] : [height - spot.height];
    });
    document.getElementById("told").textContent = JSON.stringify({shown, failed, hits, frames});
  }
  frame();
}
show();
</script></body>"""


@pytest.fixture
def view(built, tmp_path):
    """What the viewer shows of the site from a place, and what rays hit in it."""
    given = {"page": ""}

    class Handler(SimpleHTTPRequestHandler):
        def translate_path(self, path):
            top, _, rest = path.strip("/").partition("/")
            return str({"site": built, "modules": MODULES}.get(top, built) / rest)

        def do_GET(self):
            if self.path != "/":
                super().do_GET()
                return
            content = given["page"].encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=partial(server.serve_forever, 0.01), daemon=True).start()

    def show(page=PAGE, **asked):
        given["page"] = page.replace("GIVEN", json.dumps(asked))
        profile, address = tmp_path / "profile", f"http://127.0.0.1:{server.server_port}/"
        command = [BROWSER, *FLAGS, f"--user-data-dir={profile}", "--dump-dom", address]
        run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=180)
        told = re.search(r'<pre id="told">(.*?)</pre>', run.stdout, re.DOTALL)
        assert told, run.stdout + run.stderr
        assert told[1], run.stderr[-3000:]
        return json.loads(unescape(told[1]))

    yield show
    server.shutdown()
    server.server_close()


def levels(told):
    """How many tiles of each level are shown."""
    found = re.findall(r"(full|quarter|sixteenth)\.glb", " ".join(told["shown"]))
    return {level: found.count(level) for level in sorted(set(found))}


def heights(told, places, ground):
    """Lowest hit less the ground's height at each place; each ray must hit something."""
    assert all(told["hits"]), "a ray found a crack"
    lowest = np.array([min(hit) for hit in told["hits"]])
    return lowest - ground.height_at(*np.array(places).T)


def test_from_afar_the_coarse_tiles_are_shown(view, whole):
    random = np.random.default_rng(1)
    places = (random.uniform(-1, 1, (300, 2)) * (24.9, 19.9)).tolist()
    told = view(eye=[0, -900, 900], at=[0, 0, 0], error=6, places=places)
    assert told["failed"] == []
    assert levels(told) == {"sixteenth": 6}
    assert np.abs(heights(told, places, whole.ground)).max() < 0.5


def test_from_near_the_fine_ones_are_shown_where_they_are(view, whole):
    random = np.random.default_rng(2)
    places = (random.uniform(-1, 1, (300, 2)) * (24.9, 19.9)).tolist()
    told = view(eye=[0, 0, 60], at=[0, 1, 0], error=0.01, places=places)
    assert told["failed"] == []
    assert levels(told) == {"full": 6}
    gap = heights(told, places, whole.ground)
    assert np.abs(gap).max() < 1e-3


def test_levels_beside_each_other_have_no_cracks(view, whole):
    """Rays close to the borders of tiles, on both sides, where levels differ."""
    random = np.random.default_rng(3)
    along = random.uniform(-19.9, 19.9, 400)
    off = 10.0 ** random.uniform(-5, -2, 400) * random.choice([-1, 1], 400)
    places = np.concatenate([
        np.stack([np.where(along > 0, -5.0, 15.0) + off, along], -1),
        np.stack([1.2 * along, off], -1),
    ]).tolist()  # fmt: skip
    told = view(eye=[-24, -19, 3], at=[0, 0, 0], error=20, places=places)
    assert told["failed"] == []
    assert len(levels(told)) > 1
    assert np.abs(heights(told, places, whole.ground)).max() < 0.5


@pytest.mark.skipif(
    MODULES is None or not (MODULES / "cesium").is_dir(), reason="NODE_PATH has no cesium"
)
def test_cesium_shows_the_levels_where_they_are(view, whole):
    """CesiumJS on an ellipsoid: levels change with the distance, heights are those of the ground.

    The highest hit counts there, so a rock may be it. Over 32 m the ellipsoid falls by less than
    0.1 mm.
    """
    random = np.random.default_rng(4)
    places = (random.uniform(-1, 1, (200, 2)) * (24.9, 19.9)).tolist()
    far = view(CESIUM_PAGE, eye=[0, -900, 900], at=[0, 0, 0], error=6, places=places)
    assert far["failed"] == []
    assert levels(far) == {"sixteenth": 6}
    near = view(CESIUM_PAGE, eye=[0, -1, 60], at=[0, 0, 0], error=0.01, places=places)
    assert near["failed"] == []
    assert levels(near) == {"full": 6}
    gap = heights(near, places, whole.ground)
    assert gap.min() > -2e-3
    assert np.median(np.abs(gap)) < 2e-3
    assert gap.max() < whole.field.height.max() + 2e-3
