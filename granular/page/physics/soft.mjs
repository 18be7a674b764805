// Soft spheres, event-located: a step is a power series, an event its first root (DESIGN section 6, linear laws).
//
// Per pair: overlap ξ = -gap and its unclipped rate η. While nothing is in contact all gaps fly in closed form; else all
// go one step of the series, or as far as the first event of any.
import { gapAfter, rateAtContact, timeToContact } from "./flight.mjs";
import { act, activate, ACTIVE, BEGIN, direction, DORMANT, END, engage, handOver, judge, NOTHING, OPEN, PART, pushes, recedes, RESIDUAL, softPairs } from "./pairs.mjs";
import { provedToRest } from "./rest.mjs";
import { firstUpCrossing, workspace } from "./roots.mjs";
import { velocities } from "./scenes.mjs";
import { ORDER, Series, WIDTH } from "./series.mjs";

const work = workspace(ORDER), clipped = new Float64Array(ORDER + 1);

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
  const { series, pieces, steps, shared, impulse } = run;
  return { scene, contacts, series, pieces, steps, shared, impulse, ...end };
}

function start(scene, eps, k, record, maxSteps) {
  const pairs = softPairs(scene, eps, k), series = new Series(pairs);
  return {
    scene, pairs, series, t: 0, until: scene.until, status: "", contacts: [], pieces: record ? [] : null,
    steps: 0, maxSteps, shared: 0, impulse: 0, fired: -1, what: NOTHING, tau: 0,
  };
}

function launch(run) {
  run.pairs.forEach((p, c) => {
    if (p.xi === 0 && p.eta > 0 && !activate(run, c)) stop(run, "until");
  });
}

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

// For drawing: where a flight or a step starts; `h` is the unit of its time.
function keep(run, h, time) {
  run.pieces.push({ t: run.t, h, end: run.t + time, at: run.series.keep() });
}

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
  handOver(run.pairs, run.series);
  if (run.pieces) keep(run, 1, dt);
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
  const room = (run.scene.tEnd - run.t) / h, late = run.tau > room;
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
  for (let c = 0; c < pairs.length; c++) {
    const p = pairs[c];
    if (p.mode === ACTIVE) {
      const impulse = series.impulse(c, h, tau);
      run.impulse += impulse;
      if (pairs[c - 1]?.mode === ACTIVE || pairs[c + 1]?.mode === ACTIVE) run.shared += impulse;
    }
    p.xi = series.at("x", c, tau);
    p.eta = series.at("e", c, tau);
    p.exact = false;
  }
  run.t += h * tau;
}
