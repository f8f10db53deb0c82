// The camera's last picture, and over it what was found, what was predicted, and how far apart.

import { report } from "./alerts.js";
import { $, fill, fixed, h, moment, s } from "./dom.js";
import { about, along, labels } from "./labels.js";
import { known, on } from "./live.js";
import { canMark, markingTools, marksLayer, onMarking, startMarking, watchPicture } from "./marking.js";

const LAYERS = { leg: "Leg", marks: "Marks", residuals: "Residuals" };
const shown = { leg: true, marks: true, residuals: true };

fill($("layers"), Object.entries(LAYERS).map(([name, text]) =>
  h("label", { class: "toggle" }, h("input", {
    type: "checkbox", checked: shown[name],
    onchange: (event) => { shown[name] = event.target.checked; draw(); },
  }), text)));

// The names are to be read: larger in a picture that is shown smaller.
const narrow = matchMedia("(max-width: 700px)");
const tall = () => (narrow.matches ? 26 : 15);

const image = h("img", { alt: "" });
const over = s("svg", { "aria-hidden": "true" });
const frame = h("div", { class: "frame" }, image, over);
const tools = h("div");
const text = h("div");
fill($("picture"), frame, tools, text);
watchPicture(frame);

on("picture cell state table line", draw);
on("status", () => canMark() !== offered && draw());
onMarking(draw);
narrow.addEventListener("change", () => draw());
let offered = false; // marking by hand

function draw() {
  const view = known.picture;
  frame.hidden = !view;
  if (!view) return fill(text, h("p", { class: "empty" }, "No picture yet. Send run or capture; pictures come from the records on this machine."));
  const address = `/sessions/${view.session}/${view.name}`;
  if (image.getAttribute("src") !== address) image.src = address;
  image.alt = described(view);
  over.setAttribute("viewBox", `0 0 ${view.size[0]} ${view.size[1]}`);
  frame.classList.toggle("earlier", view.earlier !== false);
  const marking = marksLayer(tall());
  // Pixel centres lie at whole numbers, the drawing's corner at the picture's.
  fill(over, s("g", { transform: "translate(0.5 0.5)" }, marking ?? layers(view.earlier === false ? view.solved : null, view.size)));
  fill(tools, markingTools());
  offered = canMark();
  fill(text, caption(view));
}

function layers(solved, size) {
  if (!solved) return [];
  const path = (points) => points.map((p, k) => `${p && points[k - 1] ? "L" : "M"}${p ? p.join(" ") : ""}`).filter((d) => d.length > 1).join("");
  return [
    shown.leg && s("g", { class: "leg" },
      solved.outline && s("path", { d: `${path(solved.outline)}Z` }),
      solved.faces.map((ring) => s("path", { class: "thin", d: path(ring) })),
      solved.stations.map((st) => [
        s("path", { class: "dash", d: path(st.ring) }),
        st.at && s("circle", { cx: st.at[0], cy: st.at[1], r: 5 }),
      ])),
    shown.marks && Object.values(solved.marks).map((mark) => mark.seen
      ? s("g", { class: "seen" }, cross(mark.seen, 9))
      : mark.predicted && s("g", { class: "missed" }, saltire(mark.predicted, 6))),
    shown.residuals && Object.values(solved.marks).filter((m) => m.seen && m.residual).map((m) =>
      arrow(m.seen, m.residual.map((v) => v * solved.magnified))),
    names(solved, size),
  ];
}

// The names lie over everything else, each where it covers least.
function names(solved, size) {
  const marks = Object.entries(solved.marks);
  const wanted = [
    ...(shown.marks ? marks : []).map(([name, m]) => m.seen ? { text: name, at: m.seen, kind: "seen" }
      : m.predicted && { text: `${name} missing`, at: m.predicted, kind: "missed" }),
    ...(shown.leg ? solved.stations : []).map((st) => st.at && { text: `${st.station_mm} mm`, at: st.at, kind: "leg" }),
  ].filter(Boolean);
  const arrows = shown.residuals ? marks.filter(([, m]) => m.seen && m.residual) : [];
  const taken = [...wanted.map(({ at }) => about(at, 9)),
    ...arrows.flatMap(([, m]) => along(m.seen, m.residual.map((v) => v * solved.magnified)))];
  return labels(wanted, taken, size, tall());
}

const cross = ([u, v], r) => s("path", { d: `M${u - r} ${v}H${u + r}M${u} ${v - r}V${v + r}` });
const saltire = ([u, v], r) => s("path", { d: `M${u - r} ${v - r}L${u + r} ${v + r}M${u - r} ${v + r}L${u + r} ${v - r}` });

function arrow([u, v], [du, dv]) {
  const length = Math.hypot(du, dv);
  if (length < 1) return null;
  const [a, b] = [(du / length) * 7, (dv / length) * 7];
  const [x, y] = [u + du, v + dv];
  return s("path", { class: "residual", d: `M${u} ${v}L${x} ${y}M${x - a - b / 2} ${y - b + a / 2}L${x} ${y}L${x - a + b / 2} ${y - b - a / 2}` });
}

function caption(view) {
  const solved = view.solved;
  const missing = Object.entries(solved?.missing ?? {});
  const from = h("p", { class: "note" }, view.simulated && "Simulated: ", `${view.name.replace("frames/", "")} of session `, report(view.session), ", ", moment(view.started), ". ");
  if (view.earlier === null) return [h("p", { class: "note" }, h("span", { class: "badge warn" }, "From the records"), " No daemon has been heard: what lies there now is not known."), from];
  if (view.earlier) return [h("p", { class: "note" }, h("span", { class: "badge warn" }, "Earlier session"), " Taken before the daemon started: what lies there now is not known."), from];
  from.append(solved
    ? h("span", {}, h("strong", { class: solved.accepted ? "" : "bad" }, solved.accepted ? "Accepted by the picture\u2019s own tests" : "Not accepted"),
      `, residuals ${fixed(solved.rms_px, 3)} px rms, drawn ${solved.magnified} times as long.`)
    : "Not solved: this is the picture as the camera gave it.");
  return [
    from,
    solved && h("p", { class: "legend", "aria-hidden": "true" },
      h("span", { class: "k leg" }, "leg and stations, projected"), h("span", { class: "k seen" }, "marks, seen"), h("span", { class: "k residual" }, "predicted \u2212 seen")),
    missing.length > 0 && h("p", { class: "note" }, "Missing: ", missing.map(([name, why]) => `${name} (${why})`).join("; "), "."),
    solved?.reasons?.length > 0 && h("ul", { class: "bad" }, solved.reasons.map((r) => h("li", {}, r))),
    offered && h("p", {}, h("button", { type: "button", class: "plain", id: "mark", "data-name": "mark", onclick: startMarking }, "Mark by hand")),
  ];
}

function described(view) {
  if (view.earlier !== false) return "A picture of an earlier session.";
  if (!view.solved) return "The camera\u2019s last picture; no leg was found in it.";
  const seen = Object.values(view.solved.marks).filter((m) => m.seen).length;
  return `The camera\u2019s picture of the leg: ${seen} of ${Object.keys(view.solved.marks).length} marks seen, residuals ${fixed(view.solved.rms_px, 3)} px rms.`;
}
