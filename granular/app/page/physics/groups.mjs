// Simultaneous collisions of a touching group, solved as a whole: Newton, Poisson and generalised reflections.
//
// From inverse masses of the bodies and rates of the touching pairs (< 0 approaching) to the impulses p ≥ 0. The Delassus
// matrix is tridiagonal and an M-matrix, so the set of active pairs only grows. Twin of granular/edmd/ties.py.
import { abs, max, min } from "./numbers.mjs";

const noise = (rate) => max(...rate.map(abs)) * 2 ** -46;
const plus = (a, b) => a.map((x, i) => x + b[i]);

export function newtonRule(w, rate, eps) {
  let total = rate.map(() => 0), now = rate;
  for (let pass = 0; pass < 10000 && min(...now) < -noise(rate); pass++) {
    const p = complementary(w, now.map((r, c) => (1 + eps[c]) * r));
    now = after(w, now, p);
    total = plus(total, p);
  }
  return total;
}

export function poissonRule(w, rate, eps) {
  const compression = complementary(w, rate);
  const stopped = after(w, rate, compression).map((r, c) => (compression[c] > 0 ? 0 : r));
  const back = compression.map((p, c) => eps[c] * p);
  return plus(plus(compression, back), complementary(w, after(w, stopped, back)));
}

// For one restitution only.
export function reflectRule(w, rate, [eps]) {
  let total = rate.map(() => 0), now = rate;
  for (let pass = 0; pass < 10000; pass++) {
    const approaching = now.map((r) => r < -noise(rate));
    if (!approaching.some(Boolean)) break;
    const p = solve(w, now.map((r) => -2 * r), approaching);
    now = after(w, now, p);
    total = plus(total, p);
  }
  if (eps === 1) return total;
  const plastic = complementary(w, rate);
  return total.map((p, c) => eps * p + (1 - eps) * plastic[c]);
}

// 0 ≤ p ⟂ W p + q ≥ 0
function complementary(w, q) {
  let active = q.map((x) => x < 0);
  for (;;) {
    const p = solve(w, q.map((x) => -x), active), residual = after(w, q, p);
    const grown = active.map((a, c) => a || residual[c] < -noise(q));
    if (grown.every((a, c) => a === active[c])) return p;
    active = grown;
  }
}

// W p = right on the active pairs, p = 0 elsewhere: elimination along each run of them.
function solve(w, right, active) {
  const m = right.length, p = Array(m).fill(0), pivot = Array(m).fill(0), load = Array(m).fill(0);
  for (let c = 0; c < m; c++) {
    if (!active[c]) continue;
    [pivot[c], load[c]] = [w[c] + w[c + 1], right[c]];
    if (c > 0 && active[c - 1]) {
      const factor = w[c] / pivot[c - 1];
      pivot[c] -= factor * w[c];
      load[c] += factor * load[c - 1];
    }
  }
  for (let c = m - 1; c >= 0; c--) {
    if (active[c]) p[c] = (load[c] + (c + 1 < m && active[c + 1] ? w[c + 1] * p[c + 1] : 0)) / pivot[c];
  }
  return p;
}

function after(w, rate, p) {
  const change = velocityChanges(w, p);
  return rate.map((r, c) => r + (change[c + 1] - change[c]));
}

// What the impulses do to the velocity of each body.
export const velocityChanges = (w, p) => w.map((wi, i) => wi * ((p[i - 1] ?? 0) - (p[i] ?? 0)));
