// The graph of states, drawn from the daemon's own table: the run from left to right (on a narrow
// page from top to bottom), what breaks it off beside it, and the ways out of the present state.

import { $, fill, s, spoken } from "./dom.js";
import { believed, known, on } from "./live.js";

const ASIDE = ["paused", "stopping", "fault"];
const WIDE = { w: 104, h: 34, gap: 128, aside: 120 };
const NARROW = { w: 118, h: 30, gap: 44, aside: 196 };
const narrow = matchMedia("(max-width: 700px)");

on("table state line", draw);
narrow.addEventListener("change", draw);

function draw() {
  if (!known.table) return;
  const { states, transitions } = known.table;
  const heard = known.state?.state;
  const present = believed() ? heard : null;
  const { places, size } = narrow.matches ? down(states) : across(states);
  const out = transitions.filter(([from]) => from === present);
  const steps = new Set(run(states, transitions).map(String));
  const picture = s("svg", {
    viewBox: `0 0 ${size[0]} ${size[1]}`, role: "img", class: narrow.matches ? "narrow" : "",
    "aria-label": present ? `States of the cell. Present: ${spoken(present)}. From here: ${out.map(([, to]) => spoken(to)).join(", ")}.`
      : `States of the cell. The present one is not known; the last that was heard: ${spoken(heard)}.`,
  }, heads(),
  transitions.map((way) => {
    const lit = way[0] === present;
    const kind = lit ? "way lit" : steps.has(String(way)) ? "way step" : "way";
    return s("path", { class: kind, d: curve(places[way[0]], places[way[1]]), "marker-end": lit ? "url(#lit)" : steps.has(String(way)) ? "url(#step)" : null });
  }).sort((a, b) => rank(a) - rank(b)),
  states.map((state) => node(state, places[state], state === present ? "present" : state === heard ? "last" : "")));
  fill($("graph"), picture);
}

const rank = (path) => path.classList.length;

// The states of a whole run in their order, as pairs of neighbours that the table has.
function run(states, transitions) {
  const has = new Set(transitions.map(String));
  const line = states.filter((state) => !ASIDE.includes(state));
  return line.slice(1).map((state, k) => [line[k], state]).filter((way) => has.has(String(way)));
}

function across(states) {
  const line = states.filter((state) => !ASIDE.includes(state));
  const places = {};
  line.forEach((state, k) => (places[state] = { x: 62 + k * WIDE.gap, y: 56, ...WIDE, row: 0 }));
  const width = 124 + (line.length - 1) * WIDE.gap;
  const aside = states.filter((state) => ASIDE.includes(state));
  aside.forEach((state, k) => {
    places[state] = { x: (width * (k + 1)) / (aside.length + 1), y: 56 + WIDE.aside, ...WIDE, row: 1 };
  });
  return { places, size: [width, 200] };
}

function down(states) {
  const line = states.filter((state) => !ASIDE.includes(state));
  const places = {};
  line.forEach((state, k) => (places[state] = { x: 90, y: 24 + k * NARROW.gap, ...NARROW, row: 0, down: true }));
  const height = 48 + (line.length - 1) * NARROW.gap;
  const aside = states.filter((state) => ASIDE.includes(state));
  aside.forEach((state, k) => {
    places[state] = { x: 90 + NARROW.aside, y: (height * (k + 1)) / (aside.length + 1), ...NARROW, row: 1, down: true };
  });
  return { places, size: [360, height] };
}

function node(state, { x, y, w, h }, standing) {
  const aside = ASIDE.includes(state);
  return s("g", { class: `node ${standing} ${aside ? `aside ${state}` : ""}`, transform: `translate(${x} ${y})` },
    s("rect", { x: -w / 2, y: -h / 2, width: w, height: h, rx: aside ? h / 2 : 6 }),
    s("text", { "text-anchor": "middle", dy: "0.34em" }, state.replace("_", " ")));
}

// A way between two states: straight to a neighbour, else an arc on its own side.
function curve(a, b) {
  if (a.down) return curveDown(a, b);
  if (a.row !== b.row) return joined(a, b);
  const forth = b.x > a.x;
  if (a.row === 0 && forth && b.x - a.x <= a.gap + 1) return `M${a.x + a.w / 2} ${a.y}L${b.x - b.w / 2 - 3} ${b.y}`;
  if (a.row === 1) {
    const side = forth ? 1 : -1;
    return `M${a.x + (side * a.w) / 2} ${a.y}L${b.x - side * (b.w / 2 + 3)} ${b.y}`;
  }
  const steps = Math.abs(b.x - a.x) / a.gap;
  const lift = (forth ? -1 : 1) * (14 + 4.5 * steps);
  const edge = (forth ? -1 : 1) * (a.h / 2);
  return `M${a.x} ${a.y + edge}C${a.x} ${a.y + edge + lift} ${b.x} ${b.y + edge + lift} ${b.x} ${b.y + edge + Math.sign(edge) * 3}`;
}

function joined(a, b) {
  const falls = b.y > a.y ? 1 : -1;
  const from = a.y + (falls * a.h) / 2;
  const to = b.y - falls * (b.h / 2 + 3);
  const bend = 34 * falls;
  return `M${a.x} ${from}C${a.x} ${from + bend} ${b.x} ${to - bend} ${b.x} ${to}`;
}

function curveDown(a, b) {
  if (a.row !== b.row) {
    const side = b.x > a.x ? 1 : -1;
    const from = a.x + (side * a.w) / 2;
    const to = b.x - side * (b.w / 2 + 3);
    return `M${from} ${a.y}C${from + 26 * side} ${a.y} ${to - 26 * side} ${b.y} ${to} ${b.y}`;
  }
  const forth = b.y > a.y;
  if (a.row === 1 || (forth && b.y - a.y <= a.gap + 1)) {
    const side = forth ? 1 : -1;
    return `M${a.x} ${a.y + (side * a.h) / 2}L${b.x} ${b.y - side * (b.h / 2 + 3)}`;
  }
  const side = forth ? 1 : -1;
  const lift = side * Math.min(6 + (6.5 * Math.abs(b.y - a.y)) / a.gap, 52);
  const edge = (side * a.w) / 2;
  return `M${a.x + edge} ${a.y}C${a.x + edge + lift} ${a.y} ${b.x + edge + lift} ${b.y} ${b.x + edge + side * 3} ${b.y}`;
}

function heads() {
  const head = (id) => s("marker", { id, class: `head-${id}`, viewBox: "0 0 8 8", refX: 6, refY: 4, markerWidth: 6, markerHeight: 6, orient: "auto" },
    s("path", { d: "M0 0.8L7 4L0 7.2z" }));
  return s("defs", {}, head("step"), head("lit"));
}
