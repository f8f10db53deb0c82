// The head of the page, to be read from another room: state, what is done, how far it is.

import { $, ago, clock, fill, h, keeping, say, spoken, tone } from "./dom.js";
import { known, lastWord, on } from "./live.js";

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
  document.title = `${lost ? "No connection" : spoken(state)} \u2013 legato${simulated("", " (simulated)", (name) => ` (simulated ${name})`)}`;
  meter(lost || !known.status?.session ? null : known.progress);
  const chip = simulated("", "Simulated cell", (name) => `Simulated ${name}`);
  $("kind").hidden = !chip;
  if ($("kind").textContent !== chip) fill($("kind"), h("strong", {}, chip));
  if (state !== told && !lost) {
    told = state;
    say($("polite"), `State: ${spoken(state)}`);
  }
});

function lastHeard(state) {
  const when = lastWord() ? ` at ${clock(lastWord())}` : "";
  document.body.style.setProperty("--heard", when ? `"as last heard${when}"` : '"not heard yet"');
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
    const far = text ?? (total ? `stroke ${done} of ${total}` : "");
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

// `done` counts the strokes that were begun: the last of them is under way.
function meter(progress) {
  const box = $("meter");
  box.hidden = !progress?.total;
  if (box.hidden) return;
  box.setAttribute("aria-valuemax", progress.total);
  const ended = Math.max((progress.done ?? 0) - 1, 0);
  box.setAttribute("aria-valuenow", ended);
  box.setAttribute("aria-valuetext", `stroke ${progress.done ?? 0} of ${progress.total}`);
  box.firstElementChild.style.width = `${(100 * ended) / progress.total}%`;
}

// What is simulated of arm and camera: none, both, or one, by its name.
function simulated(none, both, one) {
  const devices = simulatedDevices(known.status);
  return devices.length === 1 ? one(devices[0]) : devices.length ? both : none;
}

export const simulatedDevices = (status) =>
  status?.simulated_devices ?? (status?.simulated ? ["arm", "camera"] : []);
