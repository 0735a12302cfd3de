"""The 3D Tiles in viewers that are not ours: 3DTilesRendererJS and CesiumJS in Chromium.

Wants Chromium, `npm install 3d-tiles-renderer three cesium`, and NODE_PATH to lead to them.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import threading
from base64 import b64decode
from functools import partial
from html import unescape
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
MODULES = [Path(folder) for folder in os.environ.get("NODE_PATH", "").split(os.pathsep) if folder]
FLAGS = [
    "--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--window-size=600,450", "--virtual-time-budget=100000000",
]  # fmt: skip
pytestmark = [
    pytest.mark.consumer,
    pytest.mark.skipif(BROWSER is None, reason="Chromium is not installed"),
]

THREE = """<!DOCTYPE html><meta charset="utf-8"><body><pre id="told"></pre>
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
let still = 0;
function frame() {
  tiles.update();
  renderer.render(scene, camera);
  const {downloading, parsing} = tiles.stats, visible = tiles.visibleTiles.size;
  still = downloading + parsing === 0 && visible ? still + 1 : 0;
  if (still < 20) { setTimeout(frame, 20); return; }
  const picture = renderer.domElement.toDataURL();
  tiles.group.updateMatrixWorld(true);
  const shown = [...tiles.visibleTiles].map((tile) => tile.content.uri);
  const caster = new THREE.Raycaster(), down = new THREE.Vector3(0, 0, -1);
  const hits = given.places.map(([x, y]) => {
    caster.set(new THREE.Vector3(x, y, 1000), down);
    return caster.intersectObject(tiles.group, true).map((hit) => hit.point.z);
  });
  document.getElementById("told").textContent = JSON.stringify({shown, failed, hits, picture});
}
frame();
</script></body>"""
CESIUM = """<!DOCTYPE html><meta charset="utf-8"><body><pre id="told"></pre>
<style>.cesium-widget canvas {width: 600px; height: 450px}</style>
<div id="view" style="width: 600px; height: 450px"></div>
<script>
const failed = [];
for (const kind of ["error", "warn"]) console[kind] = (...texts) => failed.push(texts.join(" "));
const note = (event) => failed.push(String(event.message || event.reason || event.target.src));
window.addEventListener("error", note, true);
window.addEventListener("unhandledrejection", note);
window.CESIUM_BASE_URL = "/modules/cesium/Build/Cesium/";
</script>
<script src="/modules/cesium/Build/Cesium/Cesium.js"></script>
<script type="module">
const C = Cesium, given = GIVEN, ellipsoid = C.Ellipsoid.MARS;
C.Ellipsoid.default = ellipsoid;
const widget = new C.CesiumWidget("view", {
  ellipsoid, globe: false, skyBox: false, skyAtmosphere: false, baseLayer: false,
  useDefaultRenderLoop: false, creditContainer: document.createElement("div")});
widget.resize();
const {scene} = widget, {camera} = scene;
const place = C.Cartesian3.fromDegrees(137.4, -4.6, 0, ellipsoid);
const frame = C.Transforms.eastNorthUpToFixedFrame(place, ellipsoid);
const light = new C.Cartesian3(1, 1, -1);
scene.light = new C.DirectionalLight({
  direction: C.Matrix4.multiplyByPointAsVector(frame, light, light)});
const tiles = await C.Cesium3DTileset.fromUrl("/site/glb/tileset.json", {
  modelMatrix: frame, maximumScreenSpaceError: given.error, enablePick: true});
tiles.tileFailed.addEventListener((told) => failed.push(`${told.url} ${told.message}`));
const shown = new Set();
tiles.tileVisible.addEventListener((tile) => shown.add(tile.content.url));
scene.primitives.add(tiles);
const at = new C.Cartesian3(...given.at), eye = new C.Cartesian3(...given.eye);
const about = C.Matrix4.multiplyByTranslation(frame, at, new C.Matrix4());
camera.lookAtTransform(about, C.Cartesian3.subtract(eye, at, eye));
const above = ([x, y]) => C.Cartographic.fromCartesian(
  C.Matrix4.multiplyByPoint(frame, new C.Cartesian3(x, y, 0), new C.Cartesian3()), ellipsoid);
let still = 0;
function step() {
  shown.clear();
  scene.render();
  still = tiles.tilesLoaded && shown.size ? still + 1 : 0;
  if (still < 20) { setTimeout(step, 20); return; }
  const picture = scene.canvas.toDataURL();
  const heights = given.places.map((place) => tiles.getHeight(above(place), scene));
  const hits = heights.map((height) => height === undefined ? [] : [height]);
  document.getElementById("told").textContent =
    JSON.stringify({shown: [...shown], failed, hits, picture});
}
step();
</script></body>"""
VIEWERS = {"3d-tiles-renderer": THREE, "cesium": CESIUM}


@pytest.fixture(params=VIEWERS)
def view(request, built, tmp_path):
    """What a viewer shows of the site from a place, and what rays hit in it."""
    modules = next((folder for folder in MODULES if (folder / request.param).is_dir()), None)
    if modules is None:
        pytest.skip(f"NODE_PATH has no {request.param}")
    given = {"page": ""}

    class Handler(SimpleHTTPRequestHandler):
        def translate_path(self, path):
            top, _, rest = path.strip("/").partition("/")
            return str((modules if top == "modules" else built) / rest)

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

    def show(**asked):
        given["page"] = VIEWERS[request.param].replace("GIVEN", json.dumps(asked))
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


def drawn(told):
    """The part of the picture that is not black."""
    content = b64decode(told["picture"].partition(",")[2])
    return (np.asarray(Image.open(BytesIO(content)).convert("RGB")) > 0).any(axis=2).mean()


def beside_rocks(whole, rng):
    """Places [m] of the site where no rock is."""
    places = rng.uniform(-1, 1, (300, 2)) * (24.9, 19.9)
    rocks = whole.field
    away = np.linalg.norm(places[:, None] - rocks.position[:, :2], axis=2) > rocks.diameter
    return places[away.all(axis=1)].tolist()


def heights(told, places, ground):
    """Lowest hit less the ground's height at each place; each ray must hit something."""
    assert all(told["hits"]), "a ray found a crack"
    lowest = np.array([min(hit) for hit in told["hits"]])
    return lowest - ground.height_at(*np.array(places).T)


def test_from_afar_the_coarse_tiles_are_shown(view, whole):
    places = beside_rocks(whole, np.random.default_rng(1))
    told = view(eye=[0, -900, 900], at=[0, 0, 0], error=6, places=places)
    assert told["failed"] == []
    assert levels(told) == {"sixteenth": 6}
    assert 0 < drawn(told) < 0.01
    assert np.abs(heights(told, places, whole.ground)).max() < 0.5


def test_from_near_the_fine_ones_are_shown_where_they_are(view, whole):
    places = beside_rocks(whole, np.random.default_rng(2))
    assert len(places) > 100
    told = view(eye=[0, 0, 60], at=[0, 1, 0], error=0.01, places=places)
    assert told["failed"] == []
    assert levels(told) == {"full": 6}
    assert drawn(told) > 0.25
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
