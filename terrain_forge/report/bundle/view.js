// The page's 3-D view: opens the GLB that the page holds with three.js and lets it be turned.
// Nothing moves by itself; a picture is drawn when something has changed.
(() => {
  "use strict";
  const view = document.getElementById("view");
  if (!view) return;
  const canvas = view.querySelector("canvas");
  const control = (name) => view.querySelector(`[name="${name}"]`);
  if (!document.createElement("canvas").getContext("webgl2")) return;
  if (!("DecompressionStream" in window)) return;

  // The page's model: a GLB, compressed by zlib, in base 64.
  function unpack() {
    const text = atob(document.getElementById("model").textContent);
    const packed = new Blob([Uint8Array.from(text, (letter) => letter.charCodeAt(0))]);
    return new Response(packed.stream().pipeThrough(new DecompressionStream("deflate")));
  }

  const renderer = new three.WebGLRenderer({ canvas, antialias: true, alpha: true });
  const scene = new three.Scene();
  const camera = new three.PerspectiveCamera(40, 1, 0.1, 1000);
  const turning = new three.OrbitControls(camera, canvas);
  const lines = [];
  let reach = 1;
  let asked = false;

  function draw() {
    asked = false;
    const distance = camera.position.distanceTo(turning.target);
    camera.near = Math.max(0.02, distance / 100);
    camera.far = distance + 4 * reach;
    camera.updateProjectionMatrix();
    renderer.render(scene, camera);
  }

  function redraw() {
    if (!asked) requestAnimationFrame(draw);
    asked = true;
  }

  function fit() {
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !height) return;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    for (const line of lines) line.material.resolution.set(width, height);
    redraw();
  }

  // From behind the start of the path, over the rover.
  function lookAhead(world, { eye, target }) {
    world.localToWorld(turning.target.set(...target));
    world.localToWorld(camera.position.set(...eye));
    turning.update();
    redraw();
  }

  // From the south, low enough to see relief; or straight down.
  function look(above) {
    const distance = (reach * (above ? 2.7 : 2.05)) / Math.min(1, camera.aspect);
    const rise = above ? 1.5707 : 0.6;
    turning.target.set(0, 0, 0);
    camera.position.set(0, Math.sin(rise), Math.cos(rise)).multiplyScalar(distance);
    turning.update();
    redraw();
  }

  // WebGL's own lines are a pixel wide.
  function widen(line) {
    const geometry = new three.LineGeometry().setPositions(line.geometry.attributes.position.array);
    const linewidth = line.userData.driven ? 2 : 4;
    const material = new three.LineMaterial({ color: line.material.color, linewidth });
    lines.push(new three.Line2(geometry, material));
    line.parent.add(lines.at(-1));
    line.removeFromParent();
  }

  // A level surface in this light is as bright as the picture of the ground shows its own.
  function light(gain) {
    const sun = new three.DirectionalLight(0xffffff, (0.8 * gain * Math.PI) / Math.sin(0.5));
    sun.position.set(-1, Math.tan(0.5) * Math.SQRT2, -1);
    scene.add(sun, new three.HemisphereLight(0xffffff, 0x806050, 0.2 * gain * Math.PI));
  }

  function show(gltf) {
    const world = gltf.scene.children[0];
    const part = (name) => world.getObjectByName(name);
    const ground = part("ground").children[0];
    ground.geometry.computeBoundingSphere();
    reach = ground.geometry.boundingSphere.radius;
    const middle = ground.geometry.boundingSphere.center;
    // The world's frame is z up, the view's y up: its root is turned.
    world.position.set(-middle.x, -middle.z, middle.y);
    scene.add(world);
    scene.updateMatrixWorld();
    light(Number(view.dataset.gain));
    for (const line of [...part("lines").children]) widen(line);
    for (const points of part("sweep").children) {
      points.material.size = 3;
      points.material.sizeAttenuation = false;
    }

    for (const name of ["rocks", "lines", "rover", "sweep"]) {
      control(name).addEventListener("change", (event) => {
        part(name).visible = event.target.checked;
        redraw();
      });
    }
    control("ground").addEventListener("change", async (event) => {
      ground.material = await gltf.parser.getDependency("material", Number(event.target.value));
      for (const scale of view.querySelectorAll(".scale"))
        scale.hidden = scale.dataset.of !== event.target.value;
      redraw();
    });
    control("stretch").addEventListener("input", (event) => {
      scene.scale.y = Number(event.target.value);
      view.querySelector("output").textContent = `×${event.target.value}`;
      redraw();
    });
    const ahead = () => lookAhead(world, part("rover").userData);
    control("path").addEventListener("click", ahead);
    control("south").addEventListener("click", () => look(false));
    control("above").addEventListener("click", () => look(true));

    turning.maxPolarAngle = 1.55;
    turning.minDistance = 1;
    turning.maxDistance = 8 * reach;
    turning.zoomToCursor = true;
    turning.addEventListener("change", redraw);
    turning.listenToKeyEvents(canvas);
    view.classList.add("drawn");
    new ResizeObserver(fit).observe(canvas);
    fit();
    ahead();
  }

  // The page scrolls under finger and wheel until the view was touched.
  function wake(awake) {
    turning.enableZoom = awake;
    canvas.style.touchAction = awake ? "none" : "pan-y";
    view.classList.toggle("awake", awake);
  }
  canvas.addEventListener("pointerdown", () => wake(true), { capture: true });
  document.addEventListener("pointerdown", (event) => {
    if (!view.contains(event.target)) wake(false);
  });
  wake(false);

  unpack()
    .arrayBuffer()
    .then((glb) => new three.GLTFLoader().parseAsync(glb, ""))
    .then(show);
})();
