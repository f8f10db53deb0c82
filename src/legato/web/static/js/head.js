// The head of the page, to be read from another room: state, what is done, how far it is.

import { $, ago, clock, fill, h, keeping, say, spoken, tone } from "./dom.js";
import { known, on } from "./live.js";

const LOST = { lost: "No connection", cut: "No connection", silent: "Nothing is heard" };
let told = null;

on("line state status progress session", () => {
  const line = document.body.dataset.line;
  const state = known.state?.state;
  const lost = line in LOST;
  document.body.dataset.tone = lost ? "lost" : tone(state);
  document.body.dataset.state = state ?? "";
  say($("state"), lost ? LOST[line] : state ? spoken(state) : "Not connected");
  say($("doing"), lost ? lastHeard(state) : doing(state));
  hardware(line === "cut" || (line === "lost" && known.line.stop === false));
  document.title = `${lost ? "No connection" : spoken(state)} \u2013 legato${known.status?.simulated ? " (simulated)" : ""}`;
  meter(lost || !known.status?.session ? null : known.progress);
  kind(known.status?.simulated);
  if (state !== told && !lost) {
    told = state;
    say($("polite"), `State: ${spoken(state)}`);
  }
});

function lastHeard(state) {
  const when = document.body.dataset.line === "lost" && known.line.since ? ` at ${clock(known.line.since)}` : "";
  document.body.style.setProperty("--heard", `"as last heard${when}"`);
  return state ? `${spoken(state)} was the last that was heard${when}.` : "Nothing has been heard yet.";
}

// Where no stop of this page can arrive none is offered; its keys try all the same.
function hardware(only) {
  if ($("hardware").hidden === !only) return;
  keeping(() => {
    for (const method of ["stop", "estop"]) $(method).hidden = only;
    $("hardware").hidden = !only;
  });
}

function doing(state) {
  if (known.status?.session) {
    const job = known.session?.id === known.status.session ? known.session.job : "job";
    const by = known.session?.by && known.session.by !== "local" ? ` for ${known.session.by}` : "";
    const { text, done, total } = known.progress ?? {};
    const far = text ?? (total ? `${done ?? 0} of ${total} strokes` : "");
    return `Session ${job}${by}${far ? `: ${far}` : ""}`;
  }
  if (state === "fault") return known.fault?.text ?? "";
  const campaign = known.status?.campaign;
  if (campaign?.underway) {
    const left = campaign.next_in_s / (known.cell?.time_scale ?? 1);
    const next = campaign.next_in_s === null ? "" : `, the next begins by itself in ${ago(left)}`;
    return `Campaign under way: ${repetitions(campaign)}${next}`;
  }
  const lack = known.status?.lacking?.run;
  if (state === "idle" && lack) return `Not ready: ${lack.reason}; ${lack.hint}`;
  const last = known.session;
  if (last?.outcome) return `Last session: ${last.job}, ${last.outcome}${last.reason ? `: ${last.reason}` : ""}`;
  return state ? "Ready" : "Waiting for the first word of the daemon.";
}

export const repetitions = ({ job, done, failed, total }) =>
  `${job}, ${done}${total ? ` of ${total}` : ""} done${failed ? `, ${failed} failed` : ""}`;

function meter(progress) {
  const box = $("meter");
  box.hidden = !progress?.total;
  if (box.hidden) return;
  box.setAttribute("aria-valuemax", progress.total);
  box.setAttribute("aria-valuenow", progress.done ?? 0);
  box.setAttribute("aria-valuetext", `${progress.done ?? 0} of ${progress.total}`);
  box.firstElementChild.style.width = `${(100 * (progress.done ?? 0)) / progress.total}%`;
}

function kind(simulated) {
  if (simulated === undefined) return;
  $("kind").hidden = !simulated;
  document.body.toggleAttribute("data-simulated", simulated);
  if (simulated && !$("kind").textContent) fill($("kind"), h("strong", {}, "Simulated cell"));
}
