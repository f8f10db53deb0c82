// What must not be overlooked: a lost line, a fault, a page that cannot act.

import { act, against, lacking, mayAct, onRights } from "./acts.js";
import { $, clock, fill, h, marked, moment, say } from "./dom.js";
import { known, lastWord, on } from "./live.js";

const boxes = { line: h("div"), fault: h("div"), rights: h("div") };
fill($("alerts"), Object.values(boxes));
let announced = "";

on("line", () => {
  const line = document.body.dataset.line;
  const since = lastWord();
  const what = {
    lost: ["No connection to the daemon", known.line?.reason, known.line?.hint],
    cut: ["No connection to this page\u2019s server", "legato web has ended, or this machine is busy", "start it again; this page finds it by itself"],
    silent: ["Nothing is heard", "the page\u2019s server says nothing", "see that legato web runs"],
  }[line];
  fill(boxes.line, what && h("section", { class: "alert lost", "aria-label": "Connection" },
    h("h2", {}, what[0]),
    h("p", {}, since ? `All that is shown below is old: the last was heard at ${clock(since)}. `
      : "The daemon has not been heard yet: what is shown below is from the records. ",
      "The cell may be moving. Use the hardware stop if in doubt.",
      line === "lost" && known.line.stop && against("stop") === null && " Its stop line still answers: Stop and E-stop reach it."),
    h("p", { class: "note" }, marked([what[1], what[2]].filter(Boolean).join("; ")))));
  if (what) urgent(`${what[0]}. ${since ? "What is shown is old." : "Nothing has been heard yet."}`);
  else if (line === "up" && announced.startsWith("No")) urgent("Connected again.");
});

on("fault state line", () => {
  const fault = known.state?.state === "fault" ? known.fault : null;
  if (!fault) {
    if (announced.startsWith("Fault")) urgent("");
    return fill(boxes.fault);
  }
  const evidence = fault.evidence ?? [];
  fill(boxes.fault, h("section", { class: "alert fault", "aria-labelledby": "h-fault" },
    h("h2", { id: "h-fault" }, h("code", {}, fault.cause), ": ", fault.text),
    h("p", {}, h("strong", {}, "What to do: "), marked(fault.hint),
      fault.cause === "marks_not_found" && mayAct() && ". Or reset, and mark by hand under the picture."),
    h("p", { class: "note" }, "Since ", moment(fault.since),
      fault.session && [", in session ", report(fault.session)]),
    evidence.length > 0 && h("details", {},
      h("summary", {}, "Evidence"),
      h("dl", { class: "evidence" }, evidence.map(([name, lines]) =>
        [h("dt", {}, name), h("dd", {}, lines.length === 1 ? lines[0]
          : h("ul", {}, lines.map((line) => h("li", {}, line))))]))),
    document.body.dataset.line === "up" && h("div", { class: "row" }, reset(against("reset")))));
  urgent(`Fault ${fault.cause}: ${fault.text}. What to do: ${fault.hint}`);
});

onRights(() => {
  const no = against("stop") ?? lacking();
  fill(boxes.rights, no && h("p", { class: "alert quiet" }, no));
});

const reset = (no) => h("button", { type: "button", class: "plain first", "aria-disabled": no !== null, title: no ?? "", onclick: () => act("reset") }, "Reset");

export const report = (session, text) =>
  h("a", { href: `/sessions/${session}/report`, target: "_blank", rel: "noopener" }, text ?? session);

function urgent(text) {
  announced = text;
  say($("urgent"), text);
}
