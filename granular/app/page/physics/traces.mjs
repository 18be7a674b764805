// Reading runs at any time: gaps and forces of soft spheres from their pieces, gaps of hard spheres from their flights.
import { gapAfter } from "./flight.mjs";
import { heights } from "./scenes.mjs";
import { max, min } from "./numbers.mjs";

function lastBefore(list, t) {
  let low = 0, high = list.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (list[middle].t <= t) low = middle;
    else high = middle - 1;
  }
  return list[low];
}

function recalled({ series, pieces }, t) {
  const piece = lastBefore(pieces, t);
  series.recall(piece);
  return (min(t, piece.end) - piece.t) / piece.h;
}

export function softGaps(run, t) {
  const tau = recalled(run, t);
  return run.scene.gap.map((_, c) => -run.series.at("x", c, tau));
}

export function softForce(run, c, t) {
  const tau = recalled(run, t);
  return max(0, run.series.at("f", c, tau));
}

export const softForces = (run, t) => run.scene.gap.map((_, c) => softForce(run, c, t));

export function hardGaps({ flights }, t) {
  const flight = lastBefore(flights, t), dt = max(0, t - flight.t);
  return flight.gap.map((gap, c) => max(0, gapAfter(gap, flight.rate[c], flight.pull[c], dt)));
}

export const softHeights = (run, t) => heights(run.scene, softGaps(run, t), t);
export const hardHeights = (run, t) => heights(run.scene, hardGaps(run, t), t);

export function largestForce({ series, pieces, time }) {
  let most = 1e-300;
  for (const piece of pieces) for (let c = 0; c < series.m && piece.t <= time; c++) most = max(most, series.firstForce(piece, c));
  return most;
}

// Both runs over a span: evenly in time and at the kinks that hard collisions make, as far as they can be told apart.
// Lowest and highest point with it.
export function samplesOf({ soft, hard }, [begin, end]) {
  const n = soft.scene.mass.length > 5 ? 72 : 120, even = Array.from({ length: n + 1 }, (_, i) => begin + (i / n) * (end - begin));
  const finest = (end - begin) / 800, kinks = hard.contacts.map((c) => c.begin).filter((t, i, all) => i === 0 || t - all[i - 1] > finest);
  const times = [...even, ...kinks.slice(0, 50)].sort((a, b) => a - b);
  const rows = { soft: times.map((t) => softHeights(soft, t)), hard: times.map((t) => hardHeights(hard, t)) };
  let low = Infinity, high = -Infinity;
  for (const row of [...rows.soft, ...rows.hard]) {
    for (const y of row) [low, high] = [min(low, y), max(high, y)];
  }
  return { times, ...rows, low, high: max(high, low + 1e-9) };
}

// The span of time worth watching: from the first contact to the last end of one, with a margin.
export function spanOf(...runs) {
  const contacts = runs.flatMap((run) => run.contacts);
  if (!contacts.length) return [0, max(...runs.map((run) => run.time), 1e-3)];
  const begin = min(...contacts.map((c) => c.begin));
  const ends = contacts.map((c) => (Number.isNaN(c.end) ? c.begin : c.end));
  const end = ends.reduce((a, b) => max(a, b), begin), margin = 0.06 * (end - begin) || 1e-4;
  return [max(0, begin - margin), end + 1.5 * margin];
}
