// What the person asks for: the token, what it allows, and every request with its answer.

import { $, say } from "./dom.js";
import { believed, known, on } from "./live.js";
import { pressing } from "./unstopped.js";

const KEY = "legato-token";
const TOLD_MS = 30000; // for so long an answer is news
const JOBS = ["run", "capture", "calibrate", "verify", "home", "massage"];
const STOPS = ["stop", "estop"];
const HARDWARE = "It cannot stop the cell: use the hardware stop.";

let token = null;
let may = [];
let role = null;
let why = `This page only looks on: open the address with the token that legato web has printed. ${HARDWARE}`;
const changed = [];

export const onRights = (show) => changed.push(show);

// The token comes in the address's fragment, which no server ever sees, and leaves it at once.
export async function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    sessionStorage.setItem(KEY, given);
    history.replaceState(null, "", location.pathname);
  }
  token = sessionStorage.getItem(KEY);
  await askRights();
}

export async function askRights() {
  if (!token) return changed.forEach((show) => show());
  const answer = await send("GET", "/api/me");
  if (answer.ok) {
    ({ may, role } = answer.told);
    why = `The key of legato web is ${role === "observer" ? "an observer\u2019s" : `a ${role}\u2019s`}: this page only looks on. ${HARDWARE} To act, start legato web with an operator\u2019s key.`;
  } else if (answer.told) {
    may = [];
    why = `${answer.told.reason}: ${answer.told.hint}. ${HARDWARE}`;
  }
  changed.forEach((show) => show());
}

export const mayAct = () => may.length > 0;

// Why a page that may stop may nothing else, null where it may.
export const lacking = () => (may.includes("run") ? null
  : `The key of legato web is a ${role}\u2019s: this page may stop the cell and nothing else.`);

// Returns null where a method may be asked for now, else why not.
export function against(method) {
  if (!may.length) return why;
  if (!may.includes(method)) return lacking() ?? "This page\u2019s key does not allow it.";
  if (STOPS.includes(method)) return null;
  if (!believed()) return "There is no connection to the cell.";
  const row = known.table?.answers[known.state?.state]?.[method];
  if (!row) return "The daemon has not said what it allows.";
  const no = row.answer === "accepted" ? known.status?.lacking?.[method] ?? campaigning(method) : row;
  return no ? `${no.reason}; ${no.hint}` : null;
}

// Between its repetitions an idle cell is the campaign's.
function campaigning(method) {
  const campaign = known.status?.campaign;
  if (method === "end_campaign") {
    if (!campaign?.underway) return { reason: "no campaign is under way", hint: "nothing is to be ended" };
    return campaign.reason && { reason: `campaign ${campaign.id} is ending`, hint: campaign.reason };
  }
  if (!campaign?.underway || ![...JOBS, "reference"].includes(method)) return null;
  return { reason: `${method} must wait: campaign ${campaign.id} of ${campaign.by} is under way`, hint: "stop, or end the campaign" };
}

// Asks, and tells the answer; a click twice gives one session.
export async function act(method, params = {}) {
  const answered = STOPS.includes(method) ? pressing(method) : () => false;
  const no = against(method);
  const once = JOBS.includes(method) ? { key: crypto.randomUUID() } : {};
  const answer = no ? { told: { reason: no } } : await send("POST", `/api/act/${method}`, { ...params, ...once });
  if (answer.ok) {
    answered(null);
    tell(method, carriedOut(method, answer.told), answer.told.session);
    return true;
  }
  const { reason, hint } = answer.told ?? { reason: "the page\u2019s server does not answer" };
  const text = `${reason}${hint ? `; ${hint}` : ""}`;
  if (!answered(text)) refuse(method, text);
  return false;
}

export const snap = (asked) => send("POST", "/api/snap", asked);

function carriedOut(method, told) {
  if (method === "end_campaign") return `campaign ${told.id} ends${told.session ? " with the repetition under way" : ""}`;
  if (!STOPS.includes(method)) return `${method} accepted`;
  const spent = told.confirmed === null ? null : (told.confirmed - told.received) * 1000;
  return spent === null
    ? `${method} given, not confirmed yet: ${told.reason}; look at the arm`
    : `${method} given, confirmed by the arm's driver after ${Math.max(spent, 0).toFixed(0)} ms`;
}

let last = null; // what is told: { refused }, or { method, sessions } of what was carried out
let forgetting = null;

function tell(method, text, session = null) {
  forget();
  last = { method, sessions: [session, known.session?.id] };
  put(text);
}

function refuse(method, why) {
  forget();
  last = { refused: true };
  put(why.startsWith(`${method} `) ? why[0].toUpperCase() + why.slice(1) : `${method} was not carried out: ${why}`);
  say($("urgent"), $("said").textContent);
}

function put(text) {
  $("said").classList.toggle("no", Boolean(last.refused));
  say($("said"), text);
  forgetting = setTimeout(forget, TOLD_MS);
}

// An answer is of its moment: it goes with the next act, or in time.
function forget() {
  clearTimeout(forgetting);
  if (last?.refused && $("urgent").textContent === $("said").textContent) say($("urgent"), "");
  last = null;
  $("said").classList.remove("no");
  say($("said"), "");
}

// And with the line; a refusal with the state too, what was carried out with a fault or a session
// that it has not caused.
on("state line", () => (last?.refused || !believed()) && forget());
on("state session", () => {
  if (!last?.sessions) return;
  const fault = known.state?.state === "fault" && last.method !== "estop";
  const begun = known.session?.outcome === null && !last.sessions.includes(known.session.id);
  if (fault || begun) forget();
});

async function send(method, path, body) {
  try {
    const answer = await fetch(path, {
      method,
      headers: { authorization: `Bearer ${token}`, "content-type": "application/json" },
      body: body && JSON.stringify(body),
      cache: "no-store",
    });
    return { ok: answer.ok, told: await answer.json() };
  } catch {
    return { ok: false, told: null };
  }
}
