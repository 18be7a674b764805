// What a soft pair can be, and what events make of it: open (ξ ≤ 0), active (F > 0), residual (ξ > 0, F clipped at 0),
// dormant (touching at rest beside a force: who wins is read off the series) or at rest (in a pile on the floor).
import { noteTouch } from "./apex.mjs";
import { EXACT, HELD, PUSHES, WIDTH } from "./series.mjs";
import { isNoise, pairsOf, velocities } from "./scenes.mjs";

export const OPEN = 0;
export const ACTIVE = 1;
export const RESIDUAL = 2;
export const DORMANT = 3;
export const RESTING = 4;

export const NOTHING = 0;
export const BEGIN = 1;
export const END = 2;
export const PART = 3;

export const softPairs = (scene, eps, k) => pairsOf(scene, eps, k).map((p) => new SoftPair(p));

class SoftPair {
  constructor({ gap, rate, lower, upper, mEff, k, eps, gamma, pull, duration }) {
    Object.assign(this, { lower, upper, mEff, k, eps, gamma, pull, duration });
    this.inverse = lower + upper;
    this.xi = -gap;
    this.eta = -rate;
    this.mode = OPEN;
    this.exact = false; // φ is exactly 0: a clipped force, or one that has just come back
    this.count = 0;
    this.open = null; // the contact under way
  }
}

export const pushes = (p) => p.mode === ACTIVE || p.mode === DORMANT;
export const recedes = (run, p) => p.xi <= 0 && !pushes(p) && (p.eta <= 0 || isNoise(run, p.eta));
const touches = (p) => p.mode === OPEN && p.xi === 0 && p.eta === 0;

export function handOver(pairs, { state }) {
  const m = pairs.length;
  for (let c = 0; c < m; c++) {
    const p = pairs[c];
    state[c] = p.xi;
    state[m + c] = p.eta;
    state[2 * m + c] = (pushes(p) ? PUSHES : p.mode === RESTING ? HELD : 0) + (p.exact ? EXACT : 0);
  }
}

// An event happens to pair c; false if the run is to stop just before.
export function act(run, c, what) {
  const p = run.pairs[c];
  if (what === BEGIN) {
    if (p.mode === OPEN) {
      p.xi = 0;
      if (p.eta <= 0) return true;
    }
    return activate(run, c);
  }
  if (p.open) endContact(run, c);
  if (what === END) [p.mode, p.exact] = [RESIDUAL, true];
  else [p.mode, p.exact, p.xi] = [OPEN, false, 0];
  return true;
}

// Begin a contact; false if the run is to stop just before.
export function activate(run, c) {
  const p = run.pairs[c], { until } = run;
  if (until && until.pair === c && p.count + 1 === until.nth) return false;
  noteTouch(run, c, run.pairs[0].count + (c === 0));
  p.open = { pair: c, begin: run.t, end: NaN, vIn: pairVelocities(run, c), vOut: [NaN, NaN], impulse: 0, deepest: p.xi };
  run.contacts.push(p.open);
  p.exact = p.mode === RESIDUAL;
  p.mode = ACTIVE;
  wakePile(run, c);
  p.count++;
  return true;
}

// Pair c begins to press on what may be a pile held at rest.
function wakePile({ scene, pairs }, c) {
  if (c < 1 || pairs[c - 1].mode !== RESTING) return;
  pairs[c].pull -= scene.gravity;
  pairs[0].pull = scene.gravity;
  for (const p of pairs.slice(0, c)) p.mode = ACTIVE;
}

function endContact(run, c) {
  const contact = run.pairs[c].open;
  [contact.end, contact.vOut] = [run.t, pairVelocities(run, c)];
  run.pairs[c].open = null;
}

export const softVelocities = ({ scene, pairs }) => velocities(scene, pairs.map((p) => -p.eta));
const pairVelocities = (run, c) => softVelocities(run).slice(c, c + 2);

// Pairs that touch at rest beside a force, or under their own weight, may be pressed: see what the series says.
export function engage(run) {
  const { pairs } = run, last = pairs.length - 1;
  for (let i = 0; i <= 2 * last + 1; i++) {
    const c = i <= last ? i : 2 * last + 1 - i, p = pairs[c];
    if (!touches(p)) continue;
    if (p.pull > 0 || (c > 0 && pushes(pairs[c - 1])) || (c < last && pushes(pairs[c + 1]))) {
      p.mode = DORMANT;
      wakePile(run, c);
    }
  }
}

// Open pairs that the series pulls apart from rest, close those it presses; true if any changed.
export function judge({ pairs, series }) {
  let changed = false;
  for (let c = 0; c < pairs.length; c++) {
    const p = pairs[c];
    if (p.xi !== 0 || p.eta !== 0 || (p.mode !== DORMANT && p.mode !== OPEN)) continue;
    const way = direction(series.x, c), mode = way < 0 ? OPEN : way > 0 ? DORMANT : p.mode;
    changed ||= mode !== p.mode;
    p.mode = mode;
  }
  return changed;
}

// The first coefficient that is not zero; the last may vanish by parity.
export function direction(x, c) {
  for (let i = c * WIDTH + 1; i < (c + 1) * WIDTH; i++) if (x[i] !== 0) return x[i];
  return 0;
}
