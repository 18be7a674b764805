// Soft spheres, event-located: a step is a power series, an event its first root (DESIGN section 6, linear laws).
//
// Per pair: overlap ξ = -gap and its unclipped rate η. A pair is open (ξ ≤ 0), active (F > 0), residual (ξ > 0, F clipped
// at 0) or dormant (touching at rest beside a force: who wins is read off the series). While nothing is in contact all
// gaps fly in closed form; else
//   (n+1) ξ_(n+1) = h η_n,   (n+1) η_(n+1) = h (w_c F_(c-1) - (w_c + w_(c+1)) F_c + w_(c+1) F_(c+1))_n   (+ h pull at n = 0)
// on a step h that leaves (λh)^21/21! = 1e-17.
import { gapAfter, rateAtContact, timeToContact } from "./flight.mjs";
import { provedToRest } from "./rest.mjs";
import { firstUpCrossing, workspace } from "./roots.mjs";
import { pairsOf, velocities } from "./scenes.mjs";

export const ORDER = 20;
const REACH = (51090942171709440000 * 1e-17) ** (1 / 21); // 21!
const [OPEN, ACTIVE, RESIDUAL, DORMANT] = [0, 1, 2, 3];
const [NOTHING, BEGIN, END, PART] = [0, 1, 2, 3];
const work = workspace(ORDER);

export function simulateSoft(scene, eps, k, { record = false, maxSteps = 20000 } = {}) {
  const run = start(scene, eps, k, record, maxSteps);
  launch(run);
  while (!run.status) advance(run);
  const end = { time: run.t, velocity: velocities(scene, run.pairs.map((p) => -p.eta)), status: run.status };
  const begun = run.contacts.length;
  const open = run.pairs.map((p) => p.open).filter((contact) => contact && run.status === "until");
  const patience = run.t + 20 * Math.max(...run.pairs.map((p) => p.duration));
  if (open.length) Object.assign(run, { status: "", until: null });
  while (!run.status && open.some((contact) => !contact.done) && run.t < patience) advance(run);
  const contacts = run.contacts.slice(0, begun).sort((a, b) => a.begin - b.begin || a.pair - b.pair);
  return { scene, contacts, pieces: run.pieces, steps: run.steps, shared: run.shared, impulse: run.impulse, ...end };
}

function start(scene, eps, k, record, maxSteps) {
  const pairs = pairsOf(scene, eps, k).map((p) => new SoftPair(p));
  return {
    scene, pairs, t: 0, until: scene.until, status: "", contacts: [], pieces: record ? [] : null,
    steps: 0, maxSteps, shared: 0, impulse: 0, fired: -1, what: NOTHING, tau: 0,
  };
}

class SoftPair {
  constructor({ gap, rate, lower, upper, k, gamma, pull, duration }) {
    Object.assign(this, { lower, upper, k, gamma, pull, duration });
    this.inverse = lower + upper;
    this.xi = -gap;
    this.eta = -rate;
    this.mode = OPEN;
    this.exact = false; // φ is exactly 0: a clipped force, or one that has just come back
    this.count = 0;
    this.open = null; // the contact under way
    for (const row of ["x", "e", "f", "g"]) this[row] = new Float64Array(ORDER + 1);
  }
}

function launch(run) {
  run.pairs.forEach((p, c) => {
    if (p.xi === 0 && p.eta > 0 && !activate(run, c)) stop(run, "until");
  });
}

const pushes = (p) => p.mode === ACTIVE || p.mode === DORMANT;
const touches = (p) => p.mode === OPEN && p.xi === 0 && p.eta === 0;

function advance(run) {
  if (++run.steps > run.maxSteps) return stop(run, "unfinished");
  engage(run.pairs);
  run.fired = -1;
  run.what = NOTHING;
  if (run.pairs.some(pushes)) step(run);
  else fly(run);
  if (run.status) return;
  if (run.what !== NOTHING) {
    if (!act(run, run.fired, run.what)) stop(run, "until");
  } else if (provedToRest(run)) stop(run, "resting");
  if (!run.status && run.until === "separated" && run.contacts.length && run.pairs.every(recedes)) stop(run, "until");
}

function stop(run, why) {
  run.status = why;
}

const recedes = (p) => !pushes(p) && p.xi <= 0 && p.eta <= 0;

// ---- flight: every pair in closed form -------------------------------------------------------------------------------

function fly(run) {
  const room = run.scene.tEnd - run.t;
  let dt = Infinity;
  run.pairs.forEach((p, c) => {
    const wait = p.mode === OPEN ? timeToContact(Math.max(0, -p.xi), -p.eta, p.pull) : residualWait(p);
    if (wait >= dt) return;
    dt = wait;
    run.fired = c;
    run.what = p.mode === OPEN || wait < timeToPart(p) ? BEGIN : PART;
  });
  if (dt === Infinity && room === Infinity) return stop(run, "quiet");
  const first = dt <= room ? run.fired : -1;
  dt = Math.min(dt, room);
  if (run.pieces) run.pieces.push(flightPiece(run, dt));
  run.pairs.forEach((p, c) => {
    if (c === first && p.mode === OPEN) arrive(p);
    else glide(p, dt);
  });
  run.t += dt;
  if (first < 0) stop(run, "time");
}

const timeToPart = (p) => timeToContact(p.xi, p.eta, -p.pull);

// A clipped pair parts, or its φ = kξ + γη rises to zero again: -φ falls like a gap.
function residualWait(p) {
  const phi = p.exact ? 0 : p.k * p.xi + p.gamma * p.eta, rise = p.k * p.eta + p.gamma * p.pull;
  return Math.min(timeToPart(p), timeToContact(Math.max(0, -phi), -rise, p.k * p.pull));
}

function arrive(p) {
  p.eta = -rateAtContact(Math.max(0, -p.xi), -p.eta, p.pull);
  p.xi = 0;
}

function glide(p, dt) {
  p.xi = -gapAfter(-p.xi, -p.eta, p.pull, dt);
  p.eta += p.pull * dt;
  if (dt > 0) p.exact = false;
  if (p.mode === OPEN && p.xi > 0) p.xi = 0;
}

// ---- a step in contact: series, then its first event -----------------------------------------------------------------

function step(run) {
  const { pairs } = run, h = REACH / fastestRate(pairs);
  for (let pass = 0; pass < 2 * pairs.length + 3; pass++) {
    expand(pairs, h);
    if (!judge(pairs)) break;
  }
  for (let c = 0; c < pairs.length; c++) {
    if (pairs[c].mode === DORMANT && direction(pairs[c].x) > 0 && !activate(run, c)) return stop(run, "until");
  }
  locate(run);
  const room = (run.scene.tEnd - run.t) / h, late = run.tau > room;
  if (late) run.tau = room;
  if (run.tau > 0) settle(run, h, run.tau);
  if (late) stop(run, "time");
}

// λ = ½ (b + √(b² + 4a)), a and b the largest absolute row sums of M⁻¹K and M⁻¹C over the touching pairs.
function fastestRate(pairs) {
  let a = 0, b = 0;
  for (let c = 0; c < pairs.length; c++) {
    const p = pairs[c], below = pairs[c - 1], above = pairs[c + 1];
    if (!pushes(p)) continue;
    let stiff = p.inverse * p.k, damp = p.inverse * p.gamma;
    if (below && pushes(below)) [stiff, damp] = [stiff + p.lower * below.k, damp + p.lower * below.gamma];
    if (above && pushes(above)) [stiff, damp] = [stiff + p.upper * above.k, damp + p.upper * above.gamma];
    a = Math.max(a, stiff);
    b = Math.max(b, damp);
  }
  return 0.5 * (b + Math.sqrt(b * b + 4 * a));
}

function expand(pairs, h) {
  const m = pairs.length;
  for (let c = 0; c < m; c++) {
    const p = pairs[c];
    p.x[0] = p.xi;
    p.e[0] = p.eta;
  }
  for (let n = 0; n <= ORDER; n++) {
    for (let c = 0; c < m; c++) {
      const p = pairs[c], phi = n === 0 && p.exact ? 0 : p.k * p.x[n] + p.gamma * p.e[n];
      p.g[n] = phi;
      p.f[n] = p.mode === ACTIVE || p.mode === DORMANT ? phi : 0;
    }
    if (n < ORDER) expandOne(pairs, n, h / (n + 1));
  }
}

function expandOne(pairs, n, share) {
  const last = pairs.length - 1;
  let below = 0;
  for (let c = 0; c <= last; c++) {
    const p = pairs[c], force = p.f[n], above = c < last ? pairs[c + 1].f[n] : 0;
    const push = p.lower * below - p.inverse * force + p.upper * above;
    p.x[n + 1] = share * p.e[n];
    p.e[n + 1] = share * (n === 0 ? push + p.pull : push);
    below = force;
  }
}

// The first event of all pairs on τ in [0, 1], else the end of the step.
function locate(run) {
  run.tau = 1;
  for (let c = 0; c < run.pairs.length && run.tau > 0; c++) {
    const p = run.pairs[c];
    if (p.mode === OPEN) look(run, c, p.x, 1, BEGIN);
    else if (p.mode === ACTIVE && p.gamma === 0) look(run, c, p.x, -1, PART);
    else if (p.mode === ACTIVE) look(run, c, p.f, -1, END);
    else if (p.mode === RESIDUAL) {
      look(run, c, p.x, -1, PART);
      look(run, c, p.g, 1, BEGIN);
    }
  }
}

function look(run, c, row, sign, what) {
  const tau = firstUpCrossing(row, run.tau, work, sign);
  if (tau > run.tau) return;
  run.tau = tau;
  run.fired = c;
  run.what = what;
}

function settle(run, h, tau) {
  const { pairs } = run, isActive = (c) => c >= 0 && c < pairs.length && pairs[c].mode === ACTIVE;
  if (run.pieces) run.pieces.push(seriesPiece(run, h, tau));
  for (let c = 0; c < pairs.length; c++) {
    const p = pairs[c];
    if (p.mode === ACTIVE) {
      const impulse = h * integral(p.f, tau);
      run.impulse += impulse;
      if (isActive(c - 1) || isActive(c + 1)) run.shared += impulse;
    }
    p.xi = valueAt(p.x, tau);
    p.eta = valueAt(p.e, tau);
    p.exact = false;
  }
  run.t += h * tau;
}

export function valueAt(row, tau) {
  let total = 0;
  for (let j = row.length - 1; j >= 0; j--) total = total * tau + row[j];
  return total;
}

function integral(row, tau) {
  let total = 0;
  for (let j = ORDER; j >= 0; j--) total = total * tau + row[j] / (j + 1);
  return total * tau;
}

// ---- what events do --------------------------------------------------------------------------------------------------

function act(run, c, what) {
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
function activate(run, c) {
  const p = run.pairs[c], { until } = run;
  if (until && until.pair === c && p.count + 1 === until.nth) return false;
  p.open = { pair: c, begin: run.t, end: NaN, vIn: pairVelocities(run, c), vOut: [NaN, NaN], done: false };
  run.contacts.push(p.open);
  p.exact = p.mode === RESIDUAL;
  p.mode = ACTIVE;
  p.count++;
  return true;
}

function endContact(run, c) {
  const contact = run.pairs[c].open;
  [contact.end, contact.vOut, contact.done] = [run.t, pairVelocities(run, c), true];
  run.pairs[c].open = null;
}

const pairVelocities = (run, c) => velocities(run.scene, run.pairs.map((p) => -p.eta)).slice(c, c + 2);

// Pairs that touch at rest beside a force, or under their own weight, may be pressed: see what the series says.
function engage(pairs) {
  const last = pairs.length - 1;
  for (let i = 0; i <= 2 * last + 1; i++) {
    const c = i <= last ? i : 2 * last + 1 - i, p = pairs[c];
    const pressed = p.pull > 0 || (c > 0 && pushes(pairs[c - 1])) || (c < last && pushes(pairs[c + 1]));
    if (touches(p) && pressed) p.mode = DORMANT;
  }
}

// Open pairs that the series pulls apart from rest, close those it presses; true if any changed.
function judge(pairs) {
  let changed = false;
  for (const p of pairs) {
    if (p.xi !== 0 || p.eta !== 0 || (p.mode !== DORMANT && p.mode !== OPEN)) continue;
    const way = direction(p.x), mode = way < 0 ? OPEN : way > 0 ? DORMANT : p.mode;
    changed ||= mode !== p.mode;
    p.mode = mode;
  }
  return changed;
}

// The first coefficient that is not zero; the last may vanish by parity.
function direction(x) {
  for (let j = 1; j <= ORDER; j++) if (x[j] !== 0) return x[j];
  return 0;
}

// ---- what is kept for drawing ----------------------------------------------------------------------------------------

function seriesPiece(run, h, tau) {
  return {
    t: run.t, h, end: run.t + h * tau, x: run.pairs.map((p) => p.x.slice()),
    f: run.pairs.map((p) => (p.mode === ACTIVE ? p.f.slice() : null)),
  };
}

function flightPiece(run, dt) {
  return {
    t: run.t, h: 1, end: run.t + dt, x: run.pairs.map((p) => [p.xi, p.eta, 0.5 * p.pull]),
    f: run.pairs.map(() => null),
  };
}
