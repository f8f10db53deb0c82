// Elements, made and filled; text is always text, never markup.

const SVG = "http://www.w3.org/2000/svg";

function made(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true && !name.startsWith("aria-") ? "" : value);
  }
  element.append(...children.flat(Infinity).filter((c) => c !== null && c !== undefined && c !== false));
  return element;
}

export const h = (tag, attributes, ...children) =>
  made(document.createElement(tag), attributes, children);
export const s = (tag, attributes, ...children) =>
  made(document.createElementNS(SVG, tag), attributes, children);
export const $ = (id) => document.getElementById(id);

// Replaces what an element holds; whoever had the focus in it keeps it where it is still there,
// else is taken to the heading of what has changed: never to nowhere.
export function fill(element, ...children) {
  const held = element.contains(document.activeElement) ? document.activeElement : null;
  element.replaceChildren(...children.flat(Infinity).filter(Boolean));
  if (!held || held === element) return;
  const name = (e) => e.dataset.name ?? e.getAttribute("href") ?? `${e.tagName} ${e.textContent}`;
  const again = [...element.querySelectorAll("a, button, input, summary")].find((e) => name(e) === name(held));
  (again ?? heading(element)).focus({ preventScroll: true });
}

// Changes what is shown; whoever loses the focus by it is taken to `next`, else to the heading.
export function keeping(change, next = null) {
  const held = document.activeElement;
  const above = held && heading(held);
  change();
  if (!held || held === document.body || held.getClientRects().length) return;
  (next?.getClientRects().length ? next : above).focus({ preventScroll: true });
}

// The heading of the card that an element is in; of what is in none, the cell's state.
export function heading(element) {
  const found = element.closest("section.card")?.querySelector("h2") ?? $("state");
  found.tabIndex = -1;
  return found;
}

// Changes text only where it differs: a screen reader would read it out again.
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// What stands between back quotes is a command or a name.
export const marked = (text) =>
  (text ?? "").split("`").map((part, k) => (k % 2 ? h("code", {}, part) : part));

export const fixed = (value, digits) =>
  Number.isFinite(value) ? value.toFixed(digits).replace("-", "\u2212") : "\u2013";

export const signed = (value, digits) =>
  (value > 0 ? "+" : "") + fixed(value, digits);

// massage_67 as a person says it.
export function spoken(state) {
  const names = {
    idle: "Idle", capture: "Taking a picture", calibrate: "Finding the leg", verify: "Verifying",
    move_home: "Moving home", paused: "Paused", stopping: "Stopping", fault: "Fault",
  };
  if (state?.startsWith("massage_")) return `Massage at ${state.slice(8)} mm`;
  return names[state] ?? state ?? "Not known";
}

export function tone(state) {
  if (state === "fault") return "bad";
  if (state === "paused" || state === "stopping") return "warn";
  return state === "idle" || !state ? "calm" : "busy";
}

// Every time is told in UTC, as in reports and on the command line.
export const timeOfDay = (iso) => new Date(iso).toISOString().slice(11, 19);
export const clock = (iso) => (iso ? `${timeOfDay(iso)} UTC` : "\u2013");

export function ago(seconds) {
  if (!Number.isFinite(seconds)) return "\u2013";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

// A day and time; the tip has it by this machine's clock.
export function moment(iso, zone = " UTC") {
  if (!iso) return "\u2013";
  const then = new Date(iso);
  return h("time", { datetime: iso, title: then.toString() }, `${then.toISOString().slice(0, 10)} ${timeOfDay(iso)}${zone}`);
}
