// The breakdown curve: what both engines say over the gap. Coarse first, in an order that fills evenly; then refined
// where the number of soft contacts jumps or the curve bends. A generator, so that a page can do it in slices of time.
import { simulateHard } from "./hard.mjs";
import { simulateSoft } from "./soft.mjs";

const COARSE = 33, FINEST = 0.004, MOST = 220;

export function* breakdown({ make, observable, eps, k, gaps: [low, high] }) {
  const a = Math.log10(low), width = Math.log10(high) - a, points = [];
  const point = (x) => {
    const scene = make(10 ** x), soft = simulateSoft(scene, eps, k, { maxSteps: 2000 }), hard = simulateHard(scene, eps);
    const done = soft.status !== "unfinished", ended = !["collapse", "endless"].includes(hard.status);
    const at = points.findIndex((p) => p.x > x);
    const made = {
      x, gap: 10 ** x, contacts: done ? soft.contacts.length : NaN,
      soft: done ? observable(soft) : NaN, hard: ended ? observable(hard) : NaN,
    };
    points.splice(at < 0 ? points.length : at, 0, made);
  };
  for (const share of evenly(COARSE)) {
    point(a + share * width);
    yield points;
  }
  while (points.length < MOST) {
    const next = worstInterval(points);
    if (next === null) return points;
    point(next);
    yield points;
  }
  return points;
}

// 0, 1, ½, ¼, ¾, ⅛, … up to n points with both ends.
function* evenly(n) {
  yield 0;
  yield 1;
  for (let parts = 2; parts < n; parts *= 2) for (let i = 1; i < parts; i += 2) yield i / parts;
}

function worstInterval(points) {
  let best = null, worst = 0;
  for (let i = 1; i < points.length; i++) {
    const p = points[i - 1], q = points[i], width = q.x - p.x;
    if (width < FINEST || Number.isNaN(p.soft + q.soft)) continue;
    const jumps = p.contacts !== q.contacts ? width : 0, bends = Math.abs(q.soft - p.soft) > 0.02 ? 0.3 * width : 0;
    if (jumps + bends > worst) [worst, best] = [jumps + bends, 0.5 * (p.x + q.x)];
  }
  return best;
}
