// Marks by hand: a person points at each, the place snaps to the mark nearby, and all go with
// calibrate as picks. By mouse, by touch, or by arrow keys and Enter.

import { act, against, mayAct, onRights, snap } from "./acts.js";
import { $, fixed, h, heading, s } from "./dom.js";
import { about, labels } from "./labels.js";
import { known, on } from "./live.js";

const LEAST = 6; // marks below which no pose can be told
const ZOOM = 4;
const HALF = 64; // px, of the lens

let picks = null; // [[name, [u, v]]] in the order in which they were given; null while not marking
let found = { marks: {}, missing: {} };
let asking = false;
let again = false;
let current = null;
let pointer = null; // [u, v] of the cross-hair
let frame = null;
const loupe = h("div", { class: "loupe", "aria-hidden": "true" }); // beside the picture, never over it
let announce = "";
const changed = [];

export const onMarking = (show) => changed.push(show);
const redraw = () => changed.forEach((show) => show());

onRights(redraw);
// A picture that comes meanwhile is another one: what was picked is not in it.
on("picture", (_, { picture }) => {
  if (picks && picture && key(picture) !== picks.of) finish();
});

const key = (view) => `${view.session}/${view.name}`;
const names = () => Object.keys(known.cell?.leg.marks ?? {});

// Whether picks for the picture that is shown can be sent now.
export const canMark = () =>
  Boolean(known.picture?.earlier === false) && !picks && against("calibrate") === null;

export function startMarking() {
  if (!canMark()) return;
  picks = [];
  picks.of = key(known.picture);
  found = { marks: {}, missing: {} };
  current = names()[0];
  pointer = known.picture.size.map((v) => Math.round(v / 2));
  redraw();
  frame.scrollIntoView({ block: "center" });
  frame.focus();
}

function finish() {
  const within = frame.closest("section").contains(document.activeElement);
  picks = current = pointer = null;
  redraw();
  if (within) ($("mark") ?? heading(frame)).focus();
}

export function watchPicture(element) {
  frame = element;
  const at = (event) => {
    const box = frame.querySelector("img").getBoundingClientRect();
    const [w, tall] = known.picture.size;
    return [((event.clientX - box.left) / box.width) * w - 0.5, ((event.clientY - box.top) / box.height) * tall - 0.5];
  };
  const magnify = () => {
    if (!picks || !pointer) return;
    const [w, tall] = known.picture.size;
    const [u, v] = pointer;
    loupe.style.backgroundImage = `url("${frame.querySelector("img").src}")`;
    loupe.style.backgroundSize = `${w * ZOOM}px ${tall * ZOOM}px`;
    loupe.style.backgroundPosition = `${HALF - (u + 0.5) * ZOOM}px ${HALF - (v + 0.5) * ZOOM}px`;
  };
  changed.push(() => {
    frame.classList.toggle("marking", picks !== null);
    if (picks) {
      frame.setAttribute("tabindex", "0");
      frame.setAttribute("role", "application");
      frame.setAttribute("aria-label", `Picture, marking ${current ?? "nothing"}. Arrow keys move the cross-hair, with Shift by ten pixels; Enter places the mark.`);
    } else for (const name of ["tabindex", "role", "aria-label"]) frame.removeAttribute(name);
    magnify();
  });
  frame.addEventListener("pointermove", (event) => {
    if (!picks) return;
    pointer = at(event);
    magnify();
  });
  frame.addEventListener("click", (event) => {
    if (picks) place(at(event));
  });
  frame.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!picks || (!step && event.key !== "Enter")) return;
    event.preventDefault();
    if (!step) return place(pointer);
    pointer = pointer.map((v, k) => Math.min(Math.max(v + step[k] * (event.shiftKey ? 10 : 1), 0), known.picture.size[k] - 1));
    redraw();
  });
}

async function place(at) {
  if (!current) return;
  const given = at.map((v) => Math.round(v * 10) / 10);
  picks = Object.assign([...picks.filter(([name]) => name !== current), [current, given]], { of: picks.of });
  current = names().find((name) => !picks.some(([n]) => n === name)) ?? null;
  redraw();
  await look();
}

// Asks what the picks snap to: one question at a time, again where picks have changed meanwhile.
async function look() {
  again = true;
  if (asking) return;
  asking = true;
  while (again && picks) {
    again = false;
    const answer = await snapped();
    if (!picks) break;
    announce = answer.ok ? "" : `Not snapped: ${answer.told?.reason ?? "the page\u2019s server does not answer"}`;
    if (answer.ok) found = answer.told;
    redraw();
  }
  asking = false;
}

function snapped() {
  const { session, name } = known.picture;
  if (!picks.length) return { ok: true, told: { marks: {}, missing: {} } };
  return snap({ session, name: name.replace("frames/", ""), picks: Object.fromEntries(picks) });
}

function undo() {
  const [name] = picks.at(-1);
  picks = Object.assign(picks.slice(0, -1), { of: picks.of });
  current = name;
  redraw();
  look();
}

async function sendPicks() {
  const given = Object.fromEntries(picks);
  if (await act("calibrate", { picks: given })) finish();
}

// What is drawn over the picture while marking, null while not.
export function marksLayer(tall) {
  if (!picks) return null;
  const places = picks.map(([name, at]) => ({ name, at: found.marks[name] ?? at, mark: found.marks[name] }));
  return [
    picks.map(([name, [u, v]]) => {
      const mark = found.marks[name];
      const [a, b] = mark ?? [u, v];
      return s("g", { class: mark ? "seen" : "missed" },
        mark && s("path", { class: "thin", d: `M${u} ${v}L${a} ${b}` }),
        s("path", { d: `M${a - 9} ${b}H${a + 9}M${a} ${b - 9}V${b + 9}` }));
    }),
    labels(places.map(({ name, at, mark }) => ({ text: mark ? name : `${name}?`, at, kind: mark ? "seen" : "missed" })),
      places.map(({ at }) => about(at, 9)), known.picture.size, tall),
    pointer && s("path", { class: "hair", d: `M${pointer[0] - 14} ${pointer[1]}h10m8 0h10M${pointer[0]} ${pointer[1] - 14}v10m0 8v10` }),
  ];
}

// The list of marks and what can be done with them; the daemon decides whether they suffice.
export function markingTools() {
  if (!picks) return null;
  const snapped = Object.keys(found.marks).length;
  const no = against("calibrate") ?? (snapped < LEAST ? `Mark at least ${LEAST}; ${snapped} have snapped.` : null);
  const button = (text, click, off) => h("button", { type: "button", class: "plain", "data-name": text.split(" ")[0], "aria-disabled": Boolean(off), title: off ?? "", onclick: () => !off && click() }, text);
  return h("section", { class: "byhand", "aria-label": "Marks by hand" },
    loupe,
    h("p", { class: "point" }, current ? ["Point at ", h("strong", {}, current), "."] : "All marks are placed.", " Leave out what cannot be seen."),
    h("div", { class: "chips", role: "group", "aria-label": "Mark to place" }, names().map((name) => {
      const given = picks.some(([n]) => n === name);
      const mark = found.marks[name];
      const why = mark ? `snapped, known to ${fixed(mark[2], 2)} px` : given ? found.missing[name] ?? "looking" : "not placed";
      return h("button", {
        type: "button", class: `chip ${mark ? "good" : given ? "warn" : ""}`, "aria-pressed": name === current, "aria-label": `${name}, ${why}`, title: why,
        onclick: () => { current = name; redraw(); frame.focus(); },
      }, name);
    })),
    h("div", { class: "row" },
      button("Undo", undo, picks.length ? null : "Nothing is placed yet."),
      button(`Send ${snapped} marks`, sendPicks, mayAct() ? no : against("calibrate")),
      button("Leave", finish, null)),
    h("p", { class: "note", role: "status" }, announce || no || `${snapped} marks have snapped.`));
}
