// The buttons: each is what the table allows in the present state, and says why where it does not.

import { act, against, onRights } from "./acts.js";
import { $, fill, h, keeping } from "./dom.js";
import { believed, known, on } from "./live.js";

const GROUPS = [["run"], ["capture", "calibrate", "verify", "home", "massage"], ["pause", "resume"], ["reset", "reference"], ["end_campaign"]];
const TEXTS = { end_campaign: "End campaign" };
const buttons = {};

fill($("acts"), GROUPS.map((group) => h("span", { class: "group" }, group.map((method) =>
  (buttons[method] = h("button", {
    type: "button", class: method === "run" ? "plain first" : "plain", "data-method": method,
    onclick: () => (method === "reference" ? askWhere() : act(method)),
  }, TEXTS[method] ?? method[0].toUpperCase() + method.slice(1)))))));
buttons.pause.append(" ", h("kbd", {}, "Alt P"));

on("table state line cell", show);
let lacked = ""; // a status comes every second, and mostly says the same
on("status", ({ status }) => {
  const lacks = JSON.stringify([status.lacking, status.campaign?.underway && [status.campaign.id, status.campaign.reason]]);
  if (lacks === lacked) return;
  lacked = lacks;
  show();
});
onRights(show);

function show() {
  for (const [method, button] of Object.entries(buttons)) {
    const no = against(method);
    button.setAttribute("aria-disabled", no !== null);
    button.title = no ?? known.table?.methods[method] ?? "";
  }
  const paused = known.state?.state === "paused";
  keeping(() => {
    buttons.resume.hidden = !paused;
    buttons.pause.hidden = paused;
  }, paused ? buttons.resume : buttons.pause);
  keeping(() => (buttons.end_campaign.parentElement.hidden = !known.status?.campaign?.underway));
  // What cannot be sent is not offered.
  keeping(() => {
    $("acts").hidden = !believed();
    $("no-acts").hidden = believed();
    if (against("reference")) $("reference").hidden = true;
  }, buttons.reference);
}

// Reference needs the pose at which the arm stands; the configured start pose is filled in.
function askWhere() {
  const form = $("reference");
  const no = against("reference");
  if (no) return act("reference");
  if (!form.hidden) return (form.hidden = true);
  const { xyz_mm: [x, y, z], pitch_deg, roll_deg } = known.cell.start;
  const field = (name, text, value) => h("label", {}, text, h("input", { name, type: "number", step: "any", value, required: true }));
  fill(form,
    h("p", { class: "note" }, "Say where the fingertip stands now. The registers are zeroed there; nothing moves. A wrong place makes every later motion wrong."),
    field("x", "X mm", x), field("y", "Y mm", y), field("z", "Z mm", z),
    field("pitch", "Pitch deg", pitch_deg), field("roll", "Roll deg", roll_deg),
    h("button", { class: "plain first" }, "The arm stands here"));
  form.hidden = false;
  form.elements.x.focus();
}

$("reference").addEventListener("submit", async (event) => {
  event.preventDefault();
  const value = (name) => Number(event.target.elements[name].value);
  const xyz_mm = [value("x"), value("y"), value("z")];
  if (await act("reference", { xyz_mm, pitch_deg: value("pitch"), roll_deg: value("roll") })) {
    keeping(() => (event.target.hidden = true), buttons.reference);
  }
});
