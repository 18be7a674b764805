// The two times that decide: how long a contact lasts, and how soon after its onset the next ball is met.
//
// Of all pairs that one is told whose neighbour above (to the right) is met soonest beside its duration. A gap of v t_c
// makes sure that it comes later; a smaller one is often enough.
import { pairsOf } from "./scenes.mjs";

export function reasonOf({ scene, eps, k, soft }) {
  const found = pairsOf(scene, eps, k).slice(0, -1).flatMap(({ duration }, pair) => {
    const begin = onset(soft, pair, -Infinity), met = onset(soft, pair + 1, begin ?? Infinity);
    return met === undefined ? [] : [{ pair, lasts: duration, arrives: met - begin, isEarly: met - begin < duration }];
  });
  return found.reduce((most, one) => (!most || one.arrives / one.lasts < most.arrives / most.lasts ? one : most), null);
}

const onset = (run, pair, from) => run.contacts.find((one) => one.pair === pair && one.begin >= from)?.begin;

// The gap beyond which two contacts never overlap: Δh = v t_c of the longest contact that is not the last.
export function safeGap({ scene, eps, k }) {
  const durations = pairsOf(scene, eps, k).slice(0, -1).map((p) => p.duration);
  return durations.length ? scene.impact * Math.max(...durations) : NaN;
}
