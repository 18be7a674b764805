// A pile of balls rests for good when the energy about its static equilibrium is below what its first contact needs to
// open, F°²/(2 (k + γ²/m_eff)): that energy never grows, so nothing can happen any more. See granular/md/located/rest/proof.py.
//
// A pile below balls that still fly is held in its equilibrium as soon as it moves no more than by rounding, so that it
// needs no steps, and wakes up when it is hit.
import { comesToRest } from "./apex.mjs";
import { ACTIVE, RESTING } from "./pairs.mjs";
import { abs, min, sqrt } from "./numbers.mjs";

const STILL = 1e-13; // of the impact speed

// How many pairs from the floor up press on each other.
function pileOf({ scene, pairs }) {
  if (scene.mass[0] !== Infinity) return 0;
  const top = pairs.findIndex((p) => p.mode !== ACTIVE);
  return top < 0 ? pairs.length : top;
}

// The weight on each pair of a pile of n.
function loads({ scene }, n) {
  const load = Array(n).fill(0);
  for (let c = n - 1; c >= 0; c--) load[c] = (load[c + 1] ?? 0) + scene.mass[c + 1] * scene.gravity;
  return load;
}

export function provedToRest(run) {
  const { scene, pairs } = run, n = pileOf(run);
  if (n < pairs.length) return false;
  let v = 0, energy = 0, hurdle = Infinity;
  loads(run, n).forEach((load, c) => {
    const p = pairs[c];
    v -= p.eta;
    energy += 0.5 * scene.mass[c + 1] * v * v + 0.5 * p.k * (p.xi - load / p.k) ** 2;
    hurdle = min(hurdle, (load * load) / (2 * (p.k + p.gamma * p.gamma * p.inverse)));
  });
  return energy < (1 - 1e-9) * hurdle;
}

export function holdPile(run) {
  const { scene, pairs } = run, first = pairs[0], still = STILL * scene.impact;
  if (scene.gravity === 0 || first.mode !== ACTIVE || abs(first.eta) > still) return;
  const n = pileOf(run), load = loads(run, n), isStill = (p, c) =>
    abs(p.eta) <= still && abs(p.xi - load[c] / p.k) * sqrt(p.k * p.inverse) <= still;
  if (n === pairs.length || !(pairs[n].xi < 0) || !pairs.slice(0, n).every(isStill)) return;
  pairs.slice(0, n).forEach((p, c) => {
    Object.assign(p, { mode: RESTING, xi: load[c] / p.k, eta: 0, pull: 0, exact: false });
    comesToRest(run, c + 1);
  });
  pairs[n].pull += scene.gravity;
}
