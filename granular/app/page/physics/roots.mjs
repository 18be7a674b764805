// First up-crossing of a polynomial on [0, θ], certified: found by bounds and signs, never by sampling.
//
// Descartes' rule of signs in the Bernstein basis decides on every interval whether a crossing can be there; Newton's
// method only polishes a root known to be the only one. A hump no higher than the rounding noise of the polynomial
// itself is no event. The same algorithm, line for line, as granular/_engine/roots.py.
import { abs, max } from "./numbers.mjs";

const DEEPEST = 60;

export const workspace = (degree) => Array.from({ length: DEEPEST + 1 }, () => new Float64Array(degree + 2));

// The first τ in [0, θ] where sign·p goes from - to +, or Infinity. Exact zeros at the front are divided out: a root
// just left, written as p[0] = 0, is not found again. The coefficients of p stand in `table` from `offset` on.
export function firstUpCrossing(table, offset, theta, work, sign = 1) {
  const s = work[0], size = s.length - 1;
  let first = 0, power = sign, rise = 0;
  while (first < size - 1 && table[offset + first] === 0) first++;
  if (sign * table[offset + first] > 0) return 0;
  for (let j = first; j < size; j++) {
    const c = table[offset + j] * power;
    s[j - first] = c;
    power *= theta;
    if (c > 0) rise += c;
  }
  return s[0] + rise <= 0 ? Infinity : theta * isolate(work, size - 1 - first);
}

function isolate(work, n) {
  const s = work[0];
  const noise = 4 * (n + 1) * 2 ** -53 * magnitude(s, n);
  let top = 1, left = 0;
  bernstein(s, work[1], n);
  while (top > 0) {
    const b = work[top], width = b[n + 1];
    if (highest(b, n) <= noise) {
      left += width;
      top--;
      continue;
    }
    const changes = signChanges(b, n);
    if (changes === 0 || b[0] > noise || width < 1e-15 * left || top === DEEPEST) return left;
    if (changes === 1 && b[n] > noise) return polish(s, n, left, left + width, left + width * polygonRoot(b, n));
    halve(b, work[++top], n);
  }
  return Infinity;
}

function magnitude(s, n) {
  let m = 0;
  for (let j = 0; j <= n; j++) m = max(m, abs(s[j]));
  return m;
}

function highest(b, n) {
  let m = b[0];
  for (let i = 1; i <= n; i++) if (b[i] > m) m = b[i];
  return m;
}

function signChanges(b, n) {
  let changes = 0, last = 0;
  for (let i = 0; i <= n; i++) {
    if (b[i] === 0) continue;
    if (last * b[i] < 0) changes++;
    last = b[i] > 0 ? 1 : -1;
  }
  return changes;
}

// From the power form on [0, 1] to Bernstein coefficients: divide by binomials, then only add.
function bernstein(s, b, n) {
  let above = 1, below = 1;
  for (let j = 0; j <= n; j++) {
    b[j] = (s[j] * below) / above;
    above *= n - j;
    below *= j + 1;
  }
  for (let k = 1; k <= n; k++) for (let i = n; i >= k; i--) b[i] += b[i - 1];
  b[n + 1] = 1;
}

// De Casteljau: the left half goes to `half`, the right half stays in `b`.
function halve(b, half, n) {
  for (let k = 0; k <= n; k++) {
    half[k] = b[0];
    for (let i = 0; i < n - k; i++) b[i] = 0.5 * (b[i] + b[i + 1]);
  }
  b[n + 1] *= 0.5;
  half[n + 1] = b[n + 1];
}

function polygonRoot(b, n) {
  let i = 0;
  while (b[i + 1] <= 0) i++;
  return (i + b[i] / (b[i] - b[i + 1])) / n;
}

// The one root in [low, high], s(low) ≤ 0 < s(high): Newton from x, kept inside by halving.
function polish(s, n, low, high, x) {
  for (let pass = 0; pass < 100; pass++) {
    let value = s[n], slope = 0;
    for (let j = n - 1; j >= 0; j--) {
      slope = slope * x + value;
      value = value * x + s[j];
    }
    if (value < 0) low = x;
    else high = x;
    const newton = slope > 0 ? x - value / slope : -1;
    if (low <= newton && newton <= high) {
      if (abs(newton - x) <= 1e-9 * x) return newton;
      x = newton;
    } else if (high - low <= 1e-15 * high) return x;
    else x = 0.5 * (low + high);
  }
  return x;
}
