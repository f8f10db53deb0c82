// A stop that was asked for and not carried out: it stays in sight, whatever else is told, until a
// stop is answered or the cell is known to be still.

import { $, clock, fill, h, marked } from "./dom.js";
import { believed, known, on } from "./live.js";

const SLOW_MS = 700; // a stop that is not answered by then must not be waited for
const LAG_MS = 3000; // by so much the state that is shown may be behind a cell that has begun to move
const NAMES = { stop: "Stop", estop: "E-stop" };

let pressed = 0;
let answered = 0;
let failure = null; // { what, why, at }

const still = () => believed() && known.state?.state === "idle";

// Call when a stop is asked for, and what it returns with the answer: null, or why it failed.
// That says whether the failure is shown here.
export function pressing(method) {
  const mine = ++pressed;
  const slow = setTimeout(() => mine > answered && fail(`${NAMES[method]} is not answered yet`, ""), SLOW_MS);
  return (why) => {
    clearTimeout(slow);
    if (why === null) {
      answered = Math.max(answered, mine);
      failure = null;
    } else if (mine > answered) fail(`${NAMES[method]} was not carried out`, why);
    show();
    return failure !== null && !still();
  };
}

function fail(what, why) {
  failure = { what, why, at: new Date() };
  show();
}

on("state line status", () => {
  if (failure && still() && Date.now() - failure.at > LAG_MS) failure = null;
  show();
});

let told = "";
function show() {
  const text = failure && !still() ? `${failure.what}. Use the hardware stop.` : "";
  const more = text && [`Asked for at ${clock(failure.at)}`, failure.why].filter(Boolean).join(": ");
  if (text + more === told) return; // it would be read out again
  told = text + more;
  fill($("unstopped"), text && h("strong", {}, text), more && h("span", {}, marked(more)));
}
