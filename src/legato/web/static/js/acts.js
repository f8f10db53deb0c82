// What the person asks for: the token, what it allows, and every request with its answer.

import { $, say } from "./dom.js";
import { believed, known, on } from "./live.js";

const KEY = "legato-token";
const REFUSED_MS = 30000; // for so long a refusal is news
const JOBS = ["run", "capture", "calibrate", "verify", "home", "massage"];

let token = null;
let may = [];
let why = "This page only looks on: open the address with the token that legato web has printed.";
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
  if (answer.ok) may = answer.told.may;
  else if (answer.told) {
    may = [];
    why = `${answer.told.reason}: ${answer.told.hint}`;
  }
  changed.forEach((show) => show());
}

export const mayAct = () => may.length > 0;

// Returns null where a method may be asked for now, else why not.
export function against(method) {
  if (!may.length) return why;
  if (!may.includes(method)) return "This page's key does not allow it.";
  if (method === "stop" || method === "estop") return null;
  if (!believed()) return "There is no connection to the cell.";
  const row = known.table?.answers[known.state?.state]?.[method];
  if (!row) return "The daemon has not said what it allows.";
  const no = row.answer === "accepted" ? known.status?.lacking?.[method] : row;
  return no ? `${no.reason}; ${no.hint}` : null;
}

// Asks, and tells the answer; a click twice gives one session.
export async function act(method, params = {}) {
  const no = against(method);
  if (no) return tell(refused(method, no), true);
  const once = JOBS.includes(method) ? { key: crypto.randomUUID() } : {};
  const answer = await send("POST", `/api/act/${method}`, { ...params, ...once });
  if (!answer.ok) {
    const { reason, hint } = answer.told ?? { reason: "the page's server does not answer" };
    tell(refused(method, `${reason}${hint ? `; ${hint}` : ""}`), true);
  } else tell(carriedOut(method, answer.told));
  return answer.ok;
}

export const snap = (asked) => send("POST", "/api/snap", asked);

function carriedOut(method, told) {
  if (method !== "stop" && method !== "estop") return `${method} accepted`;
  const spent = told.confirmed === null ? null : (told.confirmed - told.received) * 1000;
  return spent === null
    ? `${method} given, not confirmed yet: ${told.reason}; look at the arm`
    : `${method} given, confirmed by the arm's driver after ${Math.max(spent, 0).toFixed(0)} ms`;
}

const refused = (method, why) => why.startsWith(`${method} `)
  ? why[0].toUpperCase() + why.slice(1)
  : `${method} was not carried out: ${why}`;

let forgetting = null;
function tell(text, urgent = false) {
  forget();
  $("said").classList.toggle("no", urgent);
  say($("said"), text);
  if (!urgent) return;
  say($("urgent"), text);
  forgetting = setTimeout(forget, REFUSED_MS);
}

// A refusal is of its moment: it goes with the state or the line, the next act, or in time.
function forget() {
  clearTimeout(forgetting);
  if (!$("said").classList.contains("no")) return;
  if ($("urgent").textContent === $("said").textContent) say($("urgent"), "");
  $("said").classList.remove("no");
  say($("said"), "");
}
on("state line", () => {
  forget();
  if (!believed()) say($("said"), "");
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
