// Puts the page together: each panel listens for its own sections.

import { act, against, askRights, onRights, takeToken } from "./acts.js";
import "./alerts.js";
import "./contacts.js";
import { $ } from "./dom.js";
import "./graph.js";
import "./head.js";
import "./lists.js";
import { follow, known, on } from "./live.js";
import "./picture.js";
import "./readings.js";
import "./requests.js";
import "./space.js";

$("stop").addEventListener("click", () => act("stop"));
$("estop").addEventListener("click", () => act("estop"));

// Escape stops wherever the person is, in a field or in the picture too; nothing else takes it.
addEventListener(
  "keydown",
  (event) => {
    if (event.repeat) return;
    if (event.key === "Escape") {
      event.preventDefault();
      act(event.shiftKey ? "estop" : "stop");
    } else if (event.altKey && event.code === "KeyP") {
      event.preventDefault();
      act(known.state?.state === "paused" ? "resume" : "pause");
    }
  },
  { capture: true },
);

function stops() {
  for (const method of ["stop", "estop"]) {
    const no = against(method);
    $(method).setAttribute("aria-disabled", no !== null);
    $(method).title = no ?? "";
  }
}
onRights(stops);
on("line", (_, news) => {
  stops();
  if (news.line?.up) askRights(); // the server may be another one, with another token
});

await takeToken();
follow();
