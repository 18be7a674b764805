// How far the answer hangs on contact times that are estimates: soft spheres at both ends and in the middle of each.
import { contactsOf } from "./balls.mjs";
import { realBalls } from "./scenes.mjs";
import { simulateSoft } from "./soft.mjs";
import { max, min } from "./numbers.mjs";

// Least and largest height of the top ball in drop heights; `spread` are the factors by which t₁ and t₂ may be wrong.
export function spreadOf(values, spread) {
  const rises = [];
  for (const a of [1 / spread[0], 1, spread[0]]) {
    for (const b of [1 / spread[1], 1, spread[1]]) {
      const { eps, k } = contactsOf({ ...values, t1: a * values.t1, t2: b * values.t2 });
      const { apex } = simulateSoft(realBalls(values), eps, k, { maxSteps: 2000, follow: 1000 });
      rises.push(apex[2] / values.height);
    }
  }
  const known = rises.filter(Number.isFinite);
  return known.length ? [min(...known), max(...known)] : null;
}
