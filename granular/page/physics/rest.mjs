// A pile of balls rests for good when the energy about its static equilibrium is below what its first contact needs to
// open, F°²/(2 (k + γ²/m_eff)): that energy never grows, so nothing can happen any more. See granular/md/located/resting.py.

export function provedToRest({ scene, pairs }) {
  if (scene.mass[0] !== Infinity || pairs.some((p) => p.mode !== 1)) return false;
  let v = 0, load = 0, energy = 0, hurdle = Infinity;
  pairs.forEach((p, c) => {
    v -= p.eta;
    energy += 0.5 * scene.mass[c + 1] * v * v;
  });
  for (let c = pairs.length - 1; c >= 0; c--) {
    const p = pairs[c];
    load += scene.mass[c + 1] * scene.gravity;
    energy += 0.5 * p.k * (p.xi - load / p.k) ** 2;
    hurdle = Math.min(hurdle, (load * load) / (2 * (p.k + p.gamma * p.gamma * p.inverse)));
  }
  return energy < (1 - 1e-9) * hurdle;
}
