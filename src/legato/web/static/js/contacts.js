// Contact heights by station: what was touched over what was predicted. How far a touch may lie is
// the server's definition: what the estimate expects, and apart from it what is accepted.

import { $, fill, fixed, h, s, say, signed } from "./dom.js";
import { known, on } from "./live.js";

const WIDE = { w: 640, h: 250, left: 58, right: 18, top: 18, bottom: 40 };
const NARROW = { ...WIDE, w: 350, h: 230, right: 8 };
const BOX = 17; // half the width of a station's band
const narrow = matchMedia("(max-width: 700px)");

on("contacts cell", show);
narrow.addEventListener("change", show);

function show() {
  if (!known.cell) return;
  const { rows = [], bands = null, earlier = false, session = null } = known.contacts ?? {};
  const stations = known.cell.stations_mm.map((mm) => {
    const heights = rows.filter((r) => r.station_mm === mm).map((r) => r.contact_mm);
    const band = bands?.find((b) => b.station_mm === mm);
    return { mm, heights, mean: heights.length ? heights.reduce((a, b) => a + b) / heights.length : null,
      spread: heights.length ? Math.max(...heights) - Math.min(...heights) : null,
      expected: band?.expected_mm ?? null, accepted: band?.accepted_mm ?? known.cell.contact_window_mm };
  });
  say($("contacts-of"), rows.length ? `session ${session}` : "");
  $("contacts").classList.toggle("earlier", earlier !== false);
  if (!rows.length && !bands) return fill($("contacts"), h("p", { class: "empty" }, "Nothing touched yet. Send run; what is expected is drawn as soon as the leg is found."));
  fill($("contacts"), earlier && h("p", { class: "note" }, h("span", { class: "badge warn" }, "Earlier session"), " Touched by a pose that no longer counts."),
    earlier === null && h("p", { class: "note" }, h("span", { class: "badge warn" }, "From the records"), " No daemon has been heard: whether it still counts is not known."),
    chart(stations), legend(stations), table(stations));
}

function chart(stations) {
  const { w, h: tall, left, right, top, bottom } = narrow.matches ? NARROW : WIDE;
  const grain = known.cell.descent_mm / 2;
  const most = Math.max(0.15, ...stations.flatMap((p) => [...p.heights.map((v) => Math.abs(v) + grain), p.expected ?? 0]));
  const step = [0.05, 0.1, 0.2, 0.5, 1, 2, 5].find((d) => most / d <= 3.4) ?? 10;
  const limit = step * Math.ceil((most * 1.08) / step);
  const length = known.cell.leg.length_mm;
  const x = (mm) => left + ((mm + 12) / (length + 24)) * (w - left - right);
  const y = (mm) => top + ((limit - mm) / (2 * limit)) * (tall - top - bottom);
  const levels = [];
  for (let level = -limit; level <= limit + step / 2; level += step) levels.push(Math.round(level / step) * step);
  return s("svg", { class: "chart", viewBox: `0 0 ${w} ${tall}`, role: "img", "aria-label": summary(stations) },
    levels.map((level) => [
      s("line", { class: level === 0 ? "zero" : "grid", x1: left, x2: w - right, y1: y(level), y2: y(level) }),
      s("text", { x: left - 8, y: y(level), dy: "0.34em", "text-anchor": "end" }, signed(level, step < 0.1 ? 2 : 1)),
    ]),
    stations.filter((p) => p.expected !== null).map((p) => {
      const half = Math.max(y(0) - y(p.expected), 1);
      return s("rect", { class: "band", x: x(p.mm) - BOX, width: 2 * BOX, y: y(0) - half, height: 2 * half });
    }),
    accepted(stations[0].accepted, limit, { left, right: w - right, y }),
    stations.map((p) => [
      s("text", { x: x(p.mm), y: tall - bottom + 17, "text-anchor": "middle" }, `${p.mm}`),
      p.heights.map((height, k) => {
        const at = x(p.mm) + 9 * (k - (p.heights.length - 1) / 2);
        return [s("path", { class: "grain", d: `M${at} ${y(height + grain)}V${y(height - grain)}` }),
          s("circle", { class: "touch", cx: at, cy: y(height), r: 4.2 })];
      }),
    ]),
    s("text", { class: "axis", x: (left + w - right) / 2, y: tall - 5, "text-anchor": "middle" }, "station, mm from the big face"),
    s("text", { class: "axis", transform: `translate(13 ${(top + tall - bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, "touched \u2212 predicted, mm"));
}

// The window's two edges; where they lie beyond the scale its ends say so.
function accepted(window, limit, { left, right, y }) {
  const beyond = window > limit;
  return [1, -1].map((sign) => {
    const at = y(sign * Math.min(window, limit));
    const text = `${known.cell.bands.accepted} to ${signed(sign * window, 1)} mm${beyond ? ", beyond this scale" : ""}`;
    return [s("line", { class: "limit", x1: left, x2: right, y1: at, y2: at }),
      s("text", { class: "limit-text", x: right, y: at + (sign > 0 ? -5 : -6), "text-anchor": "end" }, text)];
  });
}

const legend = (stations) => h("p", { class: "legend", "aria-hidden": "true" },
  h("span", { class: "k touch" }, `touched, within the descent\u2019s step of ${known.cell.descent_mm} mm`),
  stations.some((p) => p.expected !== null) && h("span", { class: "k band" }, known.cell.bands.expected),
  h("span", { class: "k limit" }, known.cell.bands.accepted));

function table(stations) {
  return h("table", { class: "figures" },
    h("thead", {}, h("tr", {}, ["Station, mm", "Mean, mm", "Spread, mm", "2 sigma, mm", "Strokes"].map((t) => h("th", { scope: "col" }, t)))),
    h("tbody", {}, stations.map((p) => h("tr", {},
      h("th", { scope: "row" }, `${p.mm}`),
      h("td", {}, p.mean === null ? "\u2013" : signed(p.mean, 2)),
      h("td", {}, p.spread === null ? "\u2013" : fixed(p.spread, 2)),
      h("td", {}, p.expected === null ? "\u2013" : `\u00b1${fixed(p.expected, 2)}`),
      h("td", {}, `${p.heights.length} of ${known.cell.strokes}`)))));
}

function summary(stations) {
  const touched = stations.filter((p) => p.mean !== null);
  if (!touched.length) return "Contact heights: nothing touched yet.";
  return `Contact heights: ${touched.map((p) => `${p.mm} mm ${signed(p.mean, 2)} mm`).join(", ")}.`;
}
