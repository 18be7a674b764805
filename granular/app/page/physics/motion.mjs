// What soft spheres do until the next event: all fly in closed form while nothing is in contact, else all go one step of the
// series, or as far as the first event of any.
import { noteApexes } from "./apex.mjs";
import { gapAfter, rateAtContact, timeToContact } from "./flight.mjs";
import { activate, ACTIVE, BEGIN, direction, DORMANT, END, handOver, judge, OPEN, PART, RESIDUAL, RESTING, softVelocities } from "./pairs.mjs";
import { firstUpCrossing, workspace } from "./roots.mjs";
import { heights } from "./scenes.mjs";
import { ORDER, WIDTH } from "./series.mjs";
import { max, min } from "./numbers.mjs";

const work = workspace(ORDER), clipped = new Float64Array(ORDER + 1);

export function stop(run, why) {
  run.status = why;
}

// For drawing: where a flight or a step starts; `h` is the unit of its time.
function keep(run, h, time) {
  run.pieces.push({ t: run.t, h, end: run.t + time, at: run.series.keep() });
}

// ---- flight: every pair in closed form -------------------------------------------------------------------------------

export function fly(run) {
  const room = run.tEnd - run.t;
  let dt = Infinity;
  run.pairs.forEach((p, c) => {
    if (p.mode === RESTING) return;
    const wait = p.mode === OPEN ? timeToContact(max(0, -p.xi), -p.eta, p.pull) : residualWait(p);
    if (wait >= dt) return;
    dt = wait;
    run.fired = c;
    run.what = p.mode === OPEN || wait < timeToPart(p) ? BEGIN : PART;
  });
  if (dt === Infinity && room === Infinity) return stop(run, "quiet");
  const first = dt <= room ? run.fired : -1;
  dt = min(dt, room);
  handOver(run.pairs, run.series);
  if (run.pieces) keep(run, 1, dt);
  if (run.scene.gravity) passApexes(run, dt);
  run.pairs.forEach((p, c) => {
    if (p.mode === RESTING) return;
    if (c === first && p.mode === OPEN) arrive(p);
    else glide(p, dt);
  });
  bear(run, dt);
  run.t += dt;
  if (first < 0) stop(run, "time");
}

const isFree = (run, i) => [run.pairs[i - 1], run.pairs[i]].every((p) => !p || p.mode === OPEN || p.mode === RESIDUAL);

function passApexes(run, dt) {
  const known = { v: null }, velocityOf = (i) => (known.v ??= softVelocities(run))[i];
  const heightsNow = () => heights(run.scene, run.pairs.map((p) => -p.xi), run.t);
  noteApexes(run, dt, velocityOf, heightsNow, (i) => isFree(run, i));
}

// A pile at rest hands on its weight.
function bear(run, dt) {
  run.pairs.forEach((p, c) => p.mode === RESTING && exchange(run, c, p.k * p.xi * dt));
}

function exchange(run, c, impulse) {
  const pressing = (p) => p && (p.mode === ACTIVE || p.mode === RESTING), { pairs } = run;
  run.impulse += impulse;
  pairs[c].open.impulse += impulse;
  if (pressing(pairs[c - 1]) || pressing(pairs[c + 1])) run.shared += impulse;
}

const timeToPart = (p) => timeToContact(p.xi, p.eta, -p.pull);

// A clipped pair parts, or its φ = kξ + γη rises to zero again: -φ falls like a gap.
function residualWait(p) {
  const phi = p.exact ? 0 : p.k * p.xi + p.gamma * p.eta, rise = p.k * p.eta + p.gamma * p.pull;
  return min(timeToPart(p), timeToContact(max(0, -phi), -rise, p.k * p.pull));
}

function arrive(p) {
  p.eta = -rateAtContact(max(0, -p.xi), -p.eta, p.pull);
  p.xi = 0;
}

function glide(p, dt) {
  p.xi = -gapAfter(-p.xi, -p.eta, p.pull, dt);
  p.eta += p.pull * dt;
  if (dt > 0) p.exact = false;
  if (p.mode === OPEN && p.xi > 0) p.xi = 0;
}

// ---- a step in contact: series, then its first event -----------------------------------------------------------------

export function step(run) {
  const { pairs, series } = run;
  handOver(pairs, series);
  const h = series.longestStep();
  for (let pass = 0; pass < 2 * pairs.length + 3; pass++) {
    series.expand(h);
    if (!judge(run)) break;
    handOver(pairs, series);
  }
  for (let c = 0; c < pairs.length; c++) {
    if (pairs[c].mode === DORMANT && direction(series.x, c) > 0 && !activate(run, c)) return stop(run, "until");
  }
  locate(run);
  const room = (run.tEnd - run.t) / h, late = run.tau > room;
  if (late) run.tau = room;
  if (run.tau > 0) settle(run, h, run.tau);
  if (late) stop(run, "time");
}

// The first event of all pairs on τ in [0, 1], else the end of the step.
function locate(run) {
  const { pairs, series } = run, { x, f } = series;
  run.tau = 1;
  for (let c = 0, row = 0; c < pairs.length && run.tau > 0; c++, row += WIDTH) {
    const p = pairs[c];
    if (p.mode === OPEN) look(run, c, x, row, 1, BEGIN);
    else if (p.mode === ACTIVE && p.gamma === 0) look(run, c, x, row, -1, PART);
    else if (p.mode === ACTIVE) look(run, c, f, row, -1, END);
    else if (p.mode === RESIDUAL) {
      look(run, c, x, row, -1, PART);
      look(run, c, series.phi(c, clipped), 0, 1, BEGIN);
    }
  }
}

function look(run, c, table, row, sign, what) {
  const tau = firstUpCrossing(table, row, run.tau, work, sign);
  if (tau > run.tau) return;
  run.tau = tau;
  run.fired = c;
  run.what = what;
}

function settle(run, h, tau) {
  const { pairs, series } = run;
  if (run.pieces) keep(run, h, h * tau);
  if (run.scene.gravity) passApexes(run, h * tau);
  bear(run, h * tau);
  for (let c = 0; c < pairs.length; c++) {
    const p = pairs[c];
    if (p.mode === ACTIVE) exchange(run, c, series.impulse(c, h, tau));
    if (p.mode === RESTING) continue;
    const rate = series.at("e", c, tau), turn = p.eta > 0 && rate < 0 ? firstUpCrossing(series.e, c * WIDTH, tau, work, -1) : tau;
    if (p.open) p.open.deepest = max(p.open.deepest, series.at("x", c, turn));
    p.xi = series.at("x", c, tau);
    p.eta = rate;
    p.exact = false;
  }
  run.t += h * tau;
}
