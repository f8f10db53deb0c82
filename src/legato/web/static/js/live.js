// The live line: sections of what is known, as they change; and how old they are.

const AGAIN_MS = 700;
const SILENT_MS = 4000; // the server says something every second while it hears the daemon

export const known = {}; // the last of each section
const wanted = []; // [sections, function]
let heardAt = 0;
let heardOn = null;
let open = false;

// Calls `show(known)` whenever one of the sections has changed.
export function on(sections, show) {
  wanted.push([sections.split(" "), show]);
}

export function follow() {
  const socket = new WebSocket(`ws://${location.host}/live`);
  socket.onmessage = ({ data }) => {
    open = true; // only with a first word is what is shown of now
    heardAt = performance.now();
    heardOn = new Date();
    const news = JSON.parse(data);
    Object.assign(known, news);
    for (const [sections, show] of wanted) {
      if (sections.some((name) => name in news)) show(known, news);
    }
    judge();
  };
  socket.onclose = () => {
    open = false;
    judge();
    setTimeout(follow, AGAIN_MS);
  };
}

// Decides how far what is shown can be believed: "up", "lost" (no daemon), "cut" (no server).
export function judge() {
  const silent = performance.now() - heardAt > SILENT_MS;
  let line = "none";
  if (known.line) line = known.line.up ? "up" : "lost";
  if (!open) line = "cut";
  else if (line === "up" && silent) line = "silent";
  if (document.body.dataset.line !== line) {
    document.body.dataset.line = line;
    for (const [sections, show] of wanted) if (sections.includes("line")) show(known, {});
  }
}

// The time at which the daemon was heard last, null where it never was.
export const lastWord = () => (known.line && !known.line.up ? known.line.since : heardOn);

export const believed = () => document.body.dataset.line === "up";

setInterval(judge, 500);
