// Reading runs at any time: gaps and forces of soft spheres from their pieces, gaps of hard spheres from their flights.
import { gapAfter } from "./flight.mjs";
import { heights } from "./scenes.mjs";
import { valueAt } from "./soft.mjs";

function lastBefore(list, t) {
  let low = 0, high = list.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (list[middle].t <= t) low = middle;
    else high = middle - 1;
  }
  return list[low];
}

export function softGaps({ pieces }, t) {
  const piece = lastBefore(pieces, t), tau = (Math.min(t, piece.end) - piece.t) / piece.h;
  return piece.x.map((row) => -valueAt(row, tau));
}

export function softForces({ pieces }, t) {
  const piece = lastBefore(pieces, t), tau = (Math.min(t, piece.end) - piece.t) / piece.h;
  return piece.f.map((row) => (row ? Math.max(0, valueAt(row, tau)) : 0));
}

export function softForce({ pieces }, c, t) {
  const piece = lastBefore(pieces, t), row = piece.f[c];
  return row ? Math.max(0, valueAt(row, (Math.min(t, piece.end) - piece.t) / piece.h)) : 0;
}

export function hardGaps({ scene, flights }, t) {
  const flight = lastBefore(flights, t), dt = Math.max(0, t - flight.t);
  return flight.gap.map((gap, c) => {
    const pull = scene.gravity * ((scene.mass[c + 1] === Infinity ? 0 : 1) - (scene.mass[c] === Infinity ? 0 : 1));
    return Math.max(0, gapAfter(gap, flight.rate[c], pull, dt));
  });
}

export const softHeights = (run, t) => heights(run.scene, softGaps(run, t), t);
export const hardHeights = (run, t) => heights(run.scene, hardGaps(run, t), t);

// The span of time worth watching: from the first contact to the last end of one, with a margin.
export function spanOf(...runs) {
  const contacts = runs.flatMap((run) => run.contacts);
  if (!contacts.length) return [0, Math.max(...runs.map((run) => run.time), 1e-3)];
  const begin = Math.min(...contacts.map((c) => c.begin));
  const ends = contacts.map((c) => (Number.isNaN(c.end) ? c.begin : c.end));
  const end = ends.reduce((a, b) => Math.max(a, b), begin), margin = 0.06 * (end - begin) || 1e-4;
  return [Math.max(0, begin - margin), end + 1.5 * margin];
}
