// Soft spheres, event-located: a step is a power series, an event its first root (DESIGN section 6, linear laws).
//
// Per pair: overlap ξ = -gap and its unclipped rate η. What moves them is in motion.mjs.
import { comesToRest, startApexes } from "./apex.mjs";
import { fly, step, stop } from "./motion.mjs";
import { act, activate, engage, NOTHING, pushes, recedes, softPairs, softVelocities } from "./pairs.mjs";
import { holdPile, provedToRest } from "./rest.mjs";
import { isElastic } from "./scenes.mjs";
import { Series } from "./series.mjs";

const SETTLING = 3000; // steps

export function simulateSoft(scene, eps, k, { record = false, maxSteps = 20000, follow = 0 } = {}) {
  const run = beginSoft(scene, eps, k, record, maxSteps);
  launch(run);
  while (!run.status) nextStep(run);
  const { status, t: time, steps, shared, impulse, series, pieces } = run, velocity = softVelocities(run), overlap = run.pairs.map((p) => p.xi);
  const found = { scene, overlap, contacts: logOf(run), series, pieces, steps, shared, impulse, time, velocity, status, apex: run.apex, run };
  if (follow > 0) findApexes(found, follow);
  return found;
}

// As they are now: what goes on may end those that are open.
const logOf = ({ contacts }) => [...contacts].sort((a, b) => a.begin - b.begin || a.pair - b.pair).map((contact) => ({ ...contact }));

// The run with the contacts up to a later time.
export function goOnSoft(soft, end) {
  const { run, status } = soft;
  if (!["until", "time"].includes(status) || !(end > run.t)) return soft;
  goOn(run, end, run.steps + run.maxSteps);
  while (!run.status) nextStep(run);
  return { ...soft, contacts: logOf(run), status: run.status === "unfinished" ? "unfinished" : status };
}

// How deep each pair of balls that were found to rest has sunk by a later time.
export function settledDepths({ run }, end) {
  const most = run.steps + SETTLING;
  goOn(run, end, Infinity);
  for (; run.status !== "time" && run.steps < most; nextStep(run)) run.status = "";
  run.status = "resting";
  return run.pairs.map(({ open }) => open?.deepest);
}

// Past the stop, until every ball has had its apex or rests, at most `budget` steps.
export function findApexes({ run }, budget) {
  if (run.scene.gravity === 0 || run.status === "unfinished") return;
  if (run.status !== "resting") goOn(run, Infinity, Infinity);
  const most = run.steps + budget;
  while (!run.status && run.steps < most && run.apex.some(Number.isNaN)) nextStep(run);
  if (run.status === "resting") run.apex.forEach((_, i) => comesToRest(run, i));
}

function goOn(run, tEnd, maxSteps) {
  Object.assign(run, { status: "", until: null, tEnd, maxSteps });
}

function beginSoft(scene, eps, k, record, maxSteps) {
  const pairs = softPairs(scene, eps, k), series = new Series(pairs), { until, tEnd } = scene;
  return {
    scene, elastic: isElastic(pairs), pairs, series, t: 0, until, tEnd, status: "", contacts: [], pieces: record ? [] : null,
    steps: 0, maxSteps, shared: 0, impulse: 0, fired: -1, what: NOTHING, tau: 0, ...startApexes(scene),
  };
}

function launch(run) {
  run.pairs.forEach((p, c) => {
    if (p.xi === 0 && p.eta > 0 && !activate(run, c)) stop(run, "until");
  });
}

function nextStep(run) {
  if (++run.steps > run.maxSteps) return stop(run, "unfinished");
  engage(run);
  run.fired = -1;
  run.what = NOTHING;
  if (run.pairs.some(pushes)) step(run);
  else fly(run);
  if (run.status) return;
  if (run.what !== NOTHING) {
    if (!act(run, run.fired, run.what)) stop(run, "until");
  } else if (provedToRest(run)) stop(run, "resting");
  else holdPile(run);
  if (!run.status && run.until === "separated" && run.contacts.length && run.pairs.every((p) => recedes(run, p))) stop(run, "until");
}
