// Past sessions with their reports, and the last events.

import { report } from "./alerts.js";
import { $, clock, day, fill, fixed, h, signed, spoken } from "./dom.js";
import { on } from "./live.js";

const TONES = { done: "good", stopped: "calm", refused: "warn", fault: "bad", interrupted: "bad" };

on("sessions", ({ sessions }) => {
  if (!sessions.length) return fill($("sessions"), h("p", { class: "empty" }, "No session yet."));
  fill($("sessions"), h("table", {},
    h("thead", {}, h("tr", {}, ["Began", "Job", "Outcome", "Why", "Report"].map((t) => h("th", { scope: "col" }, t)))),
    h("tbody", {}, sessions.map((row) => h("tr", {},
      h("td", { class: "num" }, day(row.started)),
      h("td", {}, row.job),
      h("td", {}, h("span", { class: `badge ${row.outcome ? TONES[row.outcome] : "busy"}` }, row.outcome ?? "running")),
      h("td", { class: "why" }, row.reason ?? ""),
      h("td", {}, h("span", { "aria-label": `Report of ${row.id}` }, report(row.id, "open"))))))));
  for (const link of $("sessions").querySelectorAll("a")) {
    link.setAttribute("aria-label", `Open the report of session ${link.pathname.split("/")[2]}`);
  }
});

on("lines", ({ lines }) => {
  fill($("events"), lines.toReversed().map((line) =>
    h("li", { "data-topic": line.topic }, h("time", { datetime: line.wall }, clock(line.wall)), " ", h("span", {}, told(line)))));
});

function told(line) {
  switch (line.topic) {
    case "state":
      return `${spoken(line.state)}${line.cause ? ` (${line.cause})` : ""}`;
    case "progress":
      return `${line.text}${line.total ? `, ${line.done} of ${line.total}` : ""}`;
    case "contact":
      return `Touched at ${fixed(line.station_mm, 0)} mm, ${signed(line.contact_mm, 2)} mm from the prediction`;
    case "fault":
      return `Fault ${line.cause}: ${line.text}`;
    default:
      return `Session ${line.job} ${line.outcome ?? "has begun"}${line.reason ? `: ${line.reason}` : ""}`;
  }
}
