// Arm and leg in three dimensions: drawn when something moves, not otherwise. mm, z up.

import { $, fill, fixed, h } from "./dom.js";
import { known, on } from "./live.js";
import * as THREE from "../vendor/three.js";

const VIEWS = { side: [640, -620, 330], front: [900, 120, 230], above: [131, 9, 980], camera: null };
const TARGET = [105, 5, 150];
const TRAIL = 900;
const WIDE = 34; // deg from top to bottom
const ROOM = 0.9; // width over height below which the view widens

const canvas = h("canvas", { role: "img", tabindex: "0", "aria-label": "Arm and leg in three dimensions" });
const note = h("p", { class: "empty", hidden: true });
fill($("space"), canvas, note);

let renderer = null;
let due = false;
let inSight = true;
let seen = WIDE;
const scene = new THREE.Scene();
const eye = new THREE.PerspectiveCamera(WIDE, 1.5, 10, 4000);
const target = new THREE.Vector3(...TARGET);
eye.up.set(0, 0, 1);
eye.position.set(...VIEWS.side);
const parts = {};
const colours = {};

try {
  renderer = new THREE.WebGLRenderer({ canvas, antialias: !inSoftware(), alpha: true, powerPreference: "low-power" });
} catch {
  canvas.hidden = true;
  note.hidden = false;
  note.textContent = "This browser draws no 3-D (WebGL is off); the figures below say where the arm is.";
}

if (renderer) {
  scene.add(new THREE.HemisphereLight(0xffffff, 0x8890a0, 2.1));
  const sun = new THREE.DirectionalLight(0xffffff, 1.7);
  sun.position.set(300, -500, 800);
  scene.add(sun);
  new ResizeObserver(fit).observe($("space"));
  new IntersectionObserver(([entry]) => {
    inSight = entry.isIntersecting;
    if (inSight) draw();
  }).observe(canvas);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", paint);
  on("cell", build);
  on("leg", layLeg);
  on("arm line leg", pose);
  on("session line", clearTrail);
  views();
  turning();
}

// Where no graphics card helps, smooth edges would cost more than they are worth.
function inSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const told = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = told ? gl.getParameter(told.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

function views() {
  const names = { side: "Side", front: "Front", above: "Above", camera: "Camera" };
  fill($("views"), Object.entries(names).map(([name, text]) =>
    h("button", { type: "button", class: "small", onclick: () => look(name) }, text)));
}

function look(name) {
  seen = name === "camera" ? known.cell?.camera.height_deg ?? WIDE : WIDE;
  const at = VIEWS[name];
  target.set(...TARGET);
  eye.up.set(0, 0, 1);
  if (at) eye.position.set(...at);
  else {
    const m = known.cell?.camera.world_from_camera;
    if (!m) return;
    eye.position.set(m[0][3], m[1][3], m[2][3]);
    target.set(m[0][3] + 170 * m[0][2], m[1][3] + 170 * m[1][2], m[2][3] + 170 * m[2][2]);
  }
  fit();
}

const material = (name, more = {}) => (colours[name] ??= new THREE.MeshLambertMaterial({ ...more }));
const wire = (name) => (colours[name] ??= new THREE.LineBasicMaterial());

function build({ cell }) {
  for (const part of Object.values(parts)) scene.remove(part);
  const { arm, leg } = cell;
  const rod = (name, from, to) => new THREE.Mesh(new THREE.CylinderGeometry(to, from, 1, 28), material(name));
  const ball = (name, r) => new THREE.Mesh(new THREE.SphereGeometry(r, 28, 18), material(name));
  const floor = new THREE.Group();
  const grid = new THREE.GridHelper(600, 12);
  grid.material = wire("grid");
  grid.geometry.deleteAttribute("color");
  grid.rotation.x = Math.PI / 2;
  floor.add(grid);
  floor.position.set(130, 0, cell.table_z_mm);
  parts.floor = floor;
  parts.base = rod("body", arm.base_radius_mm, arm.base_radius_mm * 0.82);
  span(parts.base, [0, 0, cell.table_z_mm], [0, 0, arm.shoulder_height_mm]);
  parts.upper = rod("body", arm.forearm_radius_mm, arm.forearm_radius_mm * 0.85);
  parts.fore = rod("body", arm.forearm_radius_mm * 0.85, arm.forearm_radius_mm * 0.65);
  parts.hand = rod("hand", arm.hand_radius_mm * 0.8, arm.hand_radius_mm * 0.6);
  parts.finger = rod("finger", arm.finger_radius_mm, arm.finger_radius_mm * 0.55);
  parts.shoulder = ball("joint", arm.forearm_radius_mm * 1.25);
  parts.elbow = ball("joint", arm.forearm_radius_mm);
  parts.wrist = ball("wrist", arm.hand_radius_mm);
  parts.tip = ball("tip", 4.5);
  parts.leg = new THREE.Group();
  const side = new THREE.Mesh(new THREE.CylinderGeometry(leg.small_radius_mm, leg.big_radius_mm, leg.length_mm, 64), material("leg"));
  side.rotation.z = -Math.PI / 2;
  side.position.x = leg.length_mm / 2;
  parts.leg.add(side);
  const slope = (leg.big_radius_mm - leg.small_radius_mm) / leg.length_mm;
  for (const mm of cell.stations_mm) {
    const dot = ball("station", 3);
    dot.position.set(mm, 0, leg.big_radius_mm - slope * mm);
    parts.leg.add(dot);
  }
  for (const place of Object.values(leg.marks)) {
    const dot = ball("mark", 2);
    dot.position.set(...place);
    parts.leg.add(dot);
  }
  parts.leg.matrixAutoUpdate = false;
  parts.leg.visible = false;
  parts.camera = sight(cell.camera);
  parts.trail = new THREE.Line(new THREE.BufferGeometry(), wire("trail"));
  parts.trail.frustumCulled = false;
  for (const part of Object.values(parts)) scene.add(part);
  paint();
  layLeg(known);
  pose();
}

// The camera as the four edges of what it sees.
function sight({ world_from_camera: m, height_deg, aspect }) {
  const half = Math.tan((height_deg * Math.PI) / 360) * 40;
  const at = (x, y, z) => [0, 1, 2].map((k) => m[k][0] * x + m[k][1] * y + m[k][2] * z + m[k][3]);
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => at(x * half * aspect, y * half, 40));
  const points = corners.flatMap((corner, k) => [at(0, 0, 0), corner, corner, corners[(k + 1) % 4]]);
  const lines = new THREE.BufferGeometry();
  lines.setAttribute("position", new THREE.Float32BufferAttribute(points.flat(), 3));
  return new THREE.LineSegments(lines, wire("sight"));
}

// A leg that the daemon knows nothing of any more is not drawn.
function layLeg({ leg }) {
  if (!parts.leg) return;
  parts.leg.visible = Boolean(leg);
  if (leg) {
    parts.leg.matrix.set(...leg.world_from_object.flat());
    parts.leg.matrixWorldNeedsUpdate = true;
  }
  draw();
}

function pose() {
  if (!parts.upper) return;
  const links = known.arm?.links_mm;
  for (const name of ["upper", "fore", "hand", "finger", "shoulder", "elbow", "wrist", "tip"]) parts[name].visible = Boolean(links);
  const unknown = [!links && "Where the arm stands is not known.", !known.leg && "Where the leg lies is not known."].filter(Boolean).join(" ");
  const at = links ? ` Fingertip at ${links[3].map((v) => fixed(v, 0)).join(", ")} mm.` : "";
  canvas.setAttribute("aria-label", `Arm and leg in three dimensions.${at} ${unknown}`.trim());
  note.hidden = !unknown;
  note.textContent = unknown;
  if (links) {
    const [shoulder, elbow, wrist, tip] = links;
    const { hand_mm, finger_length_mm } = known.cell.arm;
    const share = (hand_mm - finger_length_mm) / hand_mm;
    const knuckle = wrist.map((v, k) => v + share * (tip[k] - v));
    span(parts.upper, shoulder, elbow);
    span(parts.fore, elbow, wrist);
    span(parts.hand, wrist, knuckle);
    span(parts.finger, knuckle, tip);
    parts.shoulder.position.set(...shoulder);
    parts.elbow.position.set(...elbow);
    parts.wrist.position.set(...wrist);
    parts.tip.position.set(...tip);
    parts.tip.scale.setScalar(known.arm.contact ? 1.7 : 1);
    follow(tip);
  }
  draw();
}

let trail = [];
function follow(tip) {
  const last = trail.at(-1);
  if (last && Math.hypot(...tip.map((v, k) => v - last[k])) < 0.2) return;
  trail = [...trail, tip].slice(-TRAIL);
  drawTrail();
}

function drawTrail() {
  if (!parts.trail) return;
  parts.trail.geometry.dispose();
  parts.trail.geometry = new THREE.BufferGeometry();
  parts.trail.geometry.setAttribute("position", new THREE.Float32BufferAttribute(trail.flat(), 3));
}

// The trail is one session's, of one daemon: a new one begins its own.
let trailOf = {};
function clearTrail() {
  const begun = known.session?.outcome === null ? known.session.id : trailOf.session;
  const boot = known.line?.boot ?? trailOf.boot;
  if (begun === trailOf.session && boot === trailOf.boot) return;
  trailOf = { boot, session: begun };
  trail = [];
  drawTrail();
  draw();
}

// Lays a rod of length one from a to b.
function span(rod, a, b) {
  const along = new THREE.Vector3(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
  const length = along.length();
  rod.position.set((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2);
  rod.scale.set(1, Math.max(length, 0.001), 1);
  if (length > 0) rod.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
}

// Colours come from the page's own sheet, for light and dark alike.
function paint() {
  const sheet = getComputedStyle(document.documentElement);
  for (const [name, one] of Object.entries(colours)) one.color = new THREE.Color(sheet.getPropertyValue(`--space-${name}`).trim() || "#888888");
  draw();
}

function fit() {
  const { clientWidth: width, clientHeight: height } = $("space");
  if (!width || !height) return;
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.setSize(width, height, false);
  eye.aspect = width / height;
  // What is looked at stays in sight on a tall canvas too.
  const half = Math.tan((seen * Math.PI) / 360) * Math.max(1, ROOM / eye.aspect);
  eye.fov = (Math.atan(half) * 360) / Math.PI;
  eye.updateProjectionMatrix();
  draw();
}

function draw() {
  if (due || !renderer || !inSight) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    eye.lookAt(target);
    renderer.render(scene, eye);
  });
}

// Turned by dragging or arrow keys, nearer and farther by + and -.
function turning() {
  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    held = [event.clientX, event.clientY];
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    turn((event.clientX - held[0]) * -0.008, (event.clientY - held[1]) * -0.008);
    held = [event.clientX, event.clientY];
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (held = null));
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (by) turn(...by);
    else if (event.key === "+" || event.key === "-") nearer(event.key === "+" ? 0.9 : 1.1);
    else return;
    event.preventDefault();
  });
}

function turn(round, up) {
  const away = eye.position.clone().sub(target);
  const reach = away.length();
  const heading = Math.atan2(away.y, away.x) + round;
  const height = Math.min(Math.max(Math.asin(away.z / reach) - up, -0.2), 1.55);
  eye.position.set(
    target.x + reach * Math.cos(height) * Math.cos(heading),
    target.y + reach * Math.cos(height) * Math.sin(heading),
    target.z + reach * Math.sin(height));
  draw();
}

function nearer(by) {
  eye.position.sub(target).multiplyScalar(by).add(target);
  draw();
}
