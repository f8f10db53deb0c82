// Past sessions with their reports, and the last events.

import { report } from "./alerts.js";
import { $, fill, fixed, h, moment, signed, spoken, timeOfDay } from "./dom.js";
import { on } from "./live.js";

const TONES = { done: "good", stopped: "calm", refused: "warn", fault: "bad", interrupted: "bad" };

// What an outcome says by itself, where the daemon gives no reason.
const WHY = { stopped: "a stop was asked for" };

on("sessions", ({ sessions }) => {
  if (!sessions.length) return fill($("sessions"), h("p", { class: "empty" }, "No session yet."));
  fill($("sessions"), h("table", {},
    h("thead", {}, h("tr", {}, ["Began, UTC", "Job", "Outcome", "Report", "Why"].map((t) => h("th", { scope: "col" }, t)))),
    h("tbody", {}, sessions.map((row) => h("tr", {},
      h("td", { class: "num" }, moment(row.started, "")),
      h("td", {}, row.job),
      h("td", {}, h("span", { class: `badge ${row.outcome ? TONES[row.outcome] : "busy"}` }, row.outcome ?? "running")),
      h("td", {}, report(row.id, "open")),
      h("td", { class: "why" }, row.reason ?? WHY[row.outcome] ?? ""))))));
  for (const link of $("sessions").querySelectorAll("a")) {
    link.setAttribute("aria-label", `Open the report of session ${link.pathname.split("/")[2]}`);
  }
});

on("lines", ({ lines }) => {
  fill($("events"), lines.toReversed().map((line) =>
    h("li", { "data-topic": line.topic }, h("time", { datetime: line.wall, title: new Date(line.wall).toString() }, timeOfDay(line.wall)), " ", h("span", {}, told(line)))));
});

function told(line) {
  switch (line.topic) {
    case "state":
      return `${spoken(line.state)}${line.cause ? ` (${line.cause})` : ""}`;
    case "progress":
      return `${line.text}${line.total ? `, stroke ${line.done} of ${line.total}` : ""}`;
    case "contact":
      return `Touched at ${fixed(line.station_mm, 0)} mm, ${signed(line.contact_mm, 2)} mm from the prediction`;
    case "fault":
      return `Fault ${line.cause}: ${line.text}`;
    default:
      return `Session ${line.job} ${line.outcome ?? "has begun"}${line.reason ? `: ${line.reason}` : ""}`;
  }
}
