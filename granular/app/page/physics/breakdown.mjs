// The breakdown curve: the error, the very number the verdict goes by, over the gap. A sketch first, in an order that fills
// evenly and without long runs; then those, and more where the number of soft contacts jumps or the curve bends. A
// generator, so that a page can do it in slices of time, one point each.
import { isEarly, ofPair } from "./measures.mjs";
import { bothRuns } from "./outcome.mjs";
import { abs, log10, max } from "./numbers.mjs";

export const SKETCH = 5; // points at once
export const LEAST = 1e-4; // of the fastest impact: smaller errors are drawn as this
const COARSE = 33, FINEST = 0.004, MOST = 220, SHORT = 100, LONG = 2000, EVENTS = 3000; // steps of soft, events of hard spheres

export function* breakdown({ make, eps, k, gaps: [low, high], points }) {
  const a = log10(low), width = log10(high) - a, point = (x, maxSteps) => pointAt(x, make(10 ** x), eps, k, maxSteps);
  const late = [];
  for (const share of evenly(COARSE)) {
    const x = a + share * width, made = point(x, SHORT);
    if (made) insert(points, made);
    else late.push(x);
    yield;
  }
  for (const x of late) {
    insert(points, point(x, LONG));
    yield;
  }
  for (let x = worstInterval(points); x !== null && points.length < MOST; x = worstInterval(points)) {
    insert(points, point(x, LONG));
    yield;
  }
}

// `missing`: which engine did not get to its end. Contacts are those of the last pair.
function pointAt(x, scene, eps, k, maxSteps) {
  const { cut, hard, soft, forever, error } = bothRuns(scene, eps, k, { maxSteps, maxEvents: EVENTS });
  if (isEarly(soft) && maxSteps < LONG) return null;
  const missing = isEarly(soft) ? "soft" : isEarly(hard) || forever ? "hard" : "", known = missing ? NaN : error;
  const contacts = isEarly(cut) ? NaN : ofPair(soft, scene.gap.length - 1).length;
  return { x, error: known, y: log10(max(LEAST, known)), missing, contacts };
}

function insert(points, point) {
  const at = points.findIndex((p) => p.x > point.x);
  points.splice(at < 0 ? points.length : at, 0, point);
}

// 0, 1, ½, ¼, ¾, ⅛, … up to n points with both ends.
function* evenly(n) {
  yield 0;
  yield 1;
  for (let parts = 2; parts < n; parts *= 2) for (let i = 1; i < parts; i += 2) yield i / parts;
}

// The middle of the interval that most needs a point, or null.
function worstInterval(points) {
  let best = null, worst = 0;
  for (let i = 1; i < points.length; i++) {
    const p = points[i - 1], q = points[i], width = q.x - p.x;
    if (width < FINEST || Number.isNaN(p.y + q.y)) continue;
    const jumps = p.contacts !== q.contacts ? width : 0, bends = abs(q.y - p.y) > 0.05 ? 0.3 * width : 0;
    if (jumps + bends > worst) [worst, best] = [jumps + bends, 0.5 * (p.x + q.x)];
  }
  return best;
}
