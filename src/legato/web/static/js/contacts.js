// Contact heights by station: what was touched over what was predicted, within its uncertainty.

import { $, fill, fixed, h, s, say, signed } from "./dom.js";
import { known, on } from "./live.js";

const WIDE = { w: 640, h: 250, left: 58, right: 18, top: 14, bottom: 40 };
const NARROW = { ...WIDE, w: 350, h: 230, right: 8 };
const narrow = matchMedia("(max-width: 700px)");
const LIKELY = 1.96; // standard deviations that hold 95 %

on("contacts solved cell", show);
narrow.addEventListener("change", show);

function show() {
  if (!known.cell) return;
  const rows = known.contacts?.rows ?? [];
  const sigma = known.solved?.solved?.sigma_mm ?? {};
  const stations = known.cell.stations_mm.map((mm) => {
    const heights = rows.filter((r) => r.station_mm === mm).map((r) => r.contact_mm);
    const mean = heights.length ? heights.reduce((a, b) => a + b) / heights.length : null;
    return { mm, heights, mean, spread: heights.length ? Math.max(...heights) - Math.min(...heights) : null, sigma: sigma[String(mm)] ?? null };
  });
  say($("contacts-of"), known.contacts?.session ? `session ${known.contacts.session}` : "");
  fill($("contacts"), chart(stations), legend(), table(stations));
}

function chart(stations) {
  const { w, h: tall, left, right, top, bottom } = narrow.matches ? NARROW : WIDE;
  const most = Math.max(0.15, ...stations.flatMap((p) => [...p.heights.map(Math.abs), band(p.sigma ?? 0)]));
  const step = [0.05, 0.1, 0.2, 0.5, 1, 2, 5].find((d) => most / d <= 3.4) ?? 10;
  const limit = step * Math.ceil((most * 1.08) / step);
  const length = known.cell.leg.length_mm;
  const x = (mm) => left + ((mm + 12) / (length + 24)) * (w - left - right);
  const y = (mm) => top + ((limit - mm) / (2 * limit)) * (tall - top - bottom);
  const levels = [];
  for (let level = -limit; level <= limit + step / 2; level += step) levels.push(Math.round(level / step) * step);
  const known95 = stations.filter((p) => p.sigma !== null);
  const edge = (half, sign) => known95.map((p) => `${x(p.mm)} ${y(sign * half(p.sigma))}`);
  const area = (half) => `M${edge(half, 1).join("L")}L${edge(half, -1).reverse().join("L")}Z`;
  const window = known.cell.contact_window_mm;
  return s("svg", { class: "chart", viewBox: `0 0 ${w} ${tall}`, role: "img", "aria-label": summary(stations) },
    levels.map((level) => [
      s("line", { class: level === 0 ? "zero" : "grid", x1: left, x2: w - right, y1: y(level), y2: y(level) }),
      s("text", { x: left - 8, y: y(level), dy: "0.34em", "text-anchor": "end" }, signed(level, step < 0.1 ? 2 : 1)),
    ]),
    known95.length > 1 && [s("path", { class: "step", d: area(band) }), s("path", { class: "band", d: area(pose) })],
    known95.map((p) => s("path", { class: "sigma", d: `M${x(p.mm) - 7} ${y(LIKELY * p.sigma)}h14M${x(p.mm)} ${y(LIKELY * p.sigma)}V${y(-LIKELY * p.sigma)}M${x(p.mm) - 7} ${y(-LIKELY * p.sigma)}h14` })),
    [1, -1].filter(() => window <= limit).map((sign) => s("line", { class: "limit", x1: left, x2: w - right, y1: y(sign * window), y2: y(sign * window) })),
    stations.map((p) => [
      s("text", { x: x(p.mm), y: tall - bottom + 17, "text-anchor": "middle" }, `${p.mm}`),
      p.heights.map((height, k) => s("circle", { class: "touch", cx: x(p.mm) + 9 * (k - (p.heights.length - 1) / 2), cy: y(height), r: 4.2 })),
    ]),
    s("text", { class: "axis", x: (left + w - right) / 2, y: tall - 5, "text-anchor": "middle" }, "station, mm from the big face"),
    s("text", { class: "axis", transform: `translate(13 ${(top + tall - bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, "touched \u2212 predicted, mm"));
}

// What the pose leaves open, and with it the half step that a guarded descent cannot tell.
const pose = (sigma) => LIKELY * sigma;
const band = (sigma) => LIKELY * sigma + known.cell.descent_mm / 2;

const legend = () => h("p", { class: "legend", "aria-hidden": "true" },
  h("span", { class: "k touch" }, "touched"),
  h("span", { class: "k band" }, "predicted, 95 %"),
  h("span", { class: "k step" }, `and the descent\u2019s step of ${known.cell.descent_mm} mm`));

function table(stations) {
  return h("table", { class: "figures" },
    h("thead", {}, h("tr", {}, ["Station, mm", "Mean, mm", "Spread, mm", "95 % of pose, mm", "Strokes"].map((t) => h("th", { scope: "col" }, t)))),
    h("tbody", {}, stations.map((p) => h("tr", {},
      h("th", { scope: "row" }, `${p.mm}`),
      h("td", {}, p.mean === null ? "\u2013" : signed(p.mean, 2)),
      h("td", {}, p.spread === null ? "\u2013" : fixed(p.spread, 2)),
      h("td", {}, p.sigma === null ? "\u2013" : `\u00b1${fixed(pose(p.sigma), 2)}`),
      h("td", {}, `${p.heights.length} of ${known.cell.strokes}`)))));
}

function summary(stations) {
  const touched = stations.filter((p) => p.mean !== null);
  if (!touched.length) return "Contact heights: nothing touched yet.";
  return `Contact heights: ${touched.map((p) => `${p.mm} mm ${signed(p.mean, 2)} mm`).join(", ")}.`;
}
