// The head of the page, to be read from another room: state, what is done, how far it is.

import { $, ago, fill, h, say, spoken, tone } from "./dom.js";
import { known, on } from "./live.js";

let told = null;

on("line state status progress session", () => {
  const line = document.body.dataset.line;
  const state = known.state?.state;
  const lost = line === "lost" || line === "cut" || line === "silent";
  document.body.dataset.tone = lost ? "lost" : tone(state);
  document.body.dataset.state = state ?? "";
  say($("state"), state ? spoken(state) : "Not connected");
  say($("doing"), lost ? "was the last that was heard" : doing(state));
  document.title = `${lost ? "No connection" : spoken(state)} \u2013 legato${known.status?.simulated ? " (simulated)" : ""}`;
  meter(lost || !known.status?.session ? null : known.progress);
  kind(known.status?.simulated);
  if (state !== told && !lost) {
    told = state;
    say($("polite"), `State: ${spoken(state)}`);
  }
});

function doing(state) {
  if (known.status?.session) {
    const job = known.session?.id === known.status.session ? known.session.job : "job";
    const by = known.session?.by && known.session.by !== "local" ? ` for ${known.session.by}` : "";
    const text = known.progress?.text;
    return `Session ${job}${by}${text ? `: ${text}` : ""}`;
  }
  if (state === "fault") return known.fault?.text ?? "";
  const campaign = known.status?.campaign;
  if (campaign?.underway) {
    const next = campaign.next_in_s === null ? "" : `, the next begins by itself in ${ago(campaign.next_in_s)}`;
    return `Campaign under way: ${repetitions(campaign)}${next}`;
  }
  const last = known.session;
  if (last?.outcome) return `Last session: ${last.job}, ${last.outcome}${last.reason ? ` (${last.reason})` : ""}`;
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
