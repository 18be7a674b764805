// Free flight of one gap under constant acceleration -a: a = g above a floor, 0 between two balls. `rate` < 0 closes.
// The branches keep all digits; the textbook root of the quadratic loses half of them after every bounce.
import { sqrt } from "./numbers.mjs";

export function timeToContact(gap, rate, a) {
  if (a === 0) return rate < 0 ? gap / -rate : Infinity;
  const square = rate * rate + 2 * a * gap;
  if (a > 0) {
    const s = sqrt(square);
    if (rate > 0) return (rate + s) / a;
    return s > 0 ? (2 * gap) / (s - rate) : Infinity;
  }
  return rate >= 0 || square < 0 ? Infinity : (2 * gap) / (sqrt(square) - rate);
}

export const gapAfter = (gap, rate, a, dt) => (a === 0 ? gap + rate * dt : gap + dt * (rate - 0.5 * a * dt));

// From the state and not from the rounded time: a very low bounce would otherwise seem to recede.
export function rateAtContact(gap, rate, a) {
  if (a === 0) return rate;
  const square = rate * rate + 2 * a * gap;
  return square > 0 ? -sqrt(square) : 0;
}
