// Where the names of points stand in a picture: inside it, and over no other name, mark or arrow.

import { s } from "./dom.js";

const AROUND = [[1, 0.6], [1, -0.6], [-1, 0.6], [-1, -0.6], [1, 0], [-1, 0], [0, 1], [0, -1]];
const FAR = [12, 22, 34]; // px of the picture, from the point to the text's edge
const WIDE = 0.62; // of a bold character, in its height
const EDGE = 4;

// Returns the text elements of [{ text, at: [u, v], kind }] for a picture of a size, its letters
// `tall` px. `taken` are boxes [left, top, right, bottom] that are better not covered.
export function labels(wanted, taken, size, tall) {
  const boxes = taken.map((box) => [box, 1]);
  return wanted.map(({ text, at, kind }) => {
    const wide = text.length * tall * WIDE;
    const free = FAR.flatMap((far) => AROUND.map((way) => {
      const box = inside(beside(at, way, far, wide, tall), size);
      const covers = boxes.reduce((sum, [other, weight]) => sum + weight * shared(box, other), 0);
      return { box, price: covers + 0.4 * far };
    }));
    const { box } = free.reduce((best, one) => (one.price < best.price ? one : best));
    boxes.push([box, 4]); // a name over a name can be read by nobody
    return s("text", { class: `of-${kind}`, x: box[0], y: box[3] - 0.22 * tall }, text);
  });
}

function beside([u, v], [a, b], far, wide, tall) {
  const x = u + a * far + ((a - 1) / 2) * wide;
  const y = v + b * far + ((b - 1) / 2) * tall;
  return [x, y, x + wide, y + tall];
}

function inside([x, y, right, bottom], [w, h]) {
  const du = Math.max(EDGE - x, 0) + Math.min(w - EDGE - right, 0);
  const dv = Math.max(EDGE - y, 0) + Math.min(h - EDGE - bottom, 0);
  return [x + du, y + dv, right + du, bottom + dv];
}

const shared = (a, b) =>
  Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));

// The box about a point, and the boxes along an arrow.
export const about = ([u, v], r) => [u - r, v - r, u + r, v + r];
export const along = ([u, v], [du, dv]) =>
  [0, 0.25, 0.5, 0.75, 1].map((t) => about([u + t * du, v + t * dv], 6));
