// Hard spheres, event-driven, in gaps and their rates: the next event is the smallest (wait, rank), and all pairs move on
// to it. A rate is never the difference of two velocities, so it is exact however small it is (granular/edmd/zoom.py).
// "collapse": infinitely many collisions, or rates below 2^-200 of the impact speed, or more than `maxEvents` when they are below
// 2^-30 of it. "endless": more than that.
import { comesToRest, noteApexes, noteTouch, startApexes } from "./apex.mjs";
import { gapAfter, rateAtContact, timeToContact } from "./flight.mjs";
import { newtonRule, poissonRule, velocityChanges, reflectRule } from "./groups.mjs";
import { heights, isElastic, isNoise, pairsOf } from "./scenes.mjs";
import { abs, max, min } from "./numbers.mjs";

const GROUPS = { newton: newtonRule, poisson: poissonRule, reflect: reflectRule };
const TINY = 2 ** -200, FAINT = 2 ** -20, FAINTER = 2 ** -30, SLUGGISH = 1e-6, MERGED = 1e-4, STUCK = 1e-9; // of the impact speed
const DRAWN = 20000, LATELY = 1000; // flights between events; contacts
const LONGER = 10; // what has collapsed takes more events until it sticks
export const TIES = ["left", "right", "random", "newton", "poisson", "reflect"];

// `sticks`: those that collide at less than so many m/s stick, so that there is no collapse.
export function simulateHard(scene, eps, { ties = "left", seed = 0, maxEvents = 20000, record = false, sticks = 0 } = {}) {
  const run = beginHard(scene, eps, ties, seed, record, maxEvents, sticks);
  while (!run.status) nextCollision(run);
  const { contacts, flights, t: time, status, group } = run, velocity = run.u.map((_, i) => velocityOf(run, i));
  return { scene, contacts, flights, time, velocity, gap: run.pairs.map((p) => p.gap), status, group, sticks, apex: run.apex, run };
}

function beginHard(scene, eps, ties, seed, record, maxEvents, sticks) {
  const pairs = pairsOf(scene, eps, 1).map((p) => ({ ...p, hits: 0 }));
  const falls = scene.mass.map((m) => (m === Infinity ? 0 : 1)), { until, tEnd } = scene;
  const run = {
    scene, elastic: isElastic(pairs), ties, seed, pairs, falls, until, tEnd, maxEvents, sticks, u: [...scene.velocity], t: 0, status: "",
    contacts: [], flights: record ? [] : null, events: 0, follows: false, group: [], ...startApexes(scene),
  };
  keepFlight(run);
  return run;
}

// The run with the contacts up to a later time.
export function goOnHard(hard, end) {
  const { run, status, contacts } = hard;
  if (!["until", "time"].includes(status) || !(end > run.t)) return hard;
  Object.assign(run, { until: null, tEnd: end, status: "", contacts: [], maxEvents: run.events + run.maxEvents });
  while (!run.status) nextCollision(run);
  return { ...hard, contacts: [...contacts, ...run.contacts] };
}

// Hard spheres that end in a collapse are carried on from the start, those that collide ever more slowly sticking.
export function settled(hard, eps, { ties, maxEvents = 20000 }) {
  if (hard.status !== "collapse" || ties in GROUPS) return hard;
  const fastest = hard.contacts.reduce((most, { vIn: [lower, upper] }) => max(most, lower - upper), 0);
  return simulateHard(hard.scene, eps, { ties, maxEvents: LONGER * maxEvents, sticks: STUCK * fastest });
}

export const settledRun = (scene, eps, rule) => settled(simulateHard(scene, eps, rule), eps, rule);

// Past the stop, until every ball has had its apex or lies on the floor, at most `most` events. Weak collisions are plastic
// here: what has all but collapsed moves on with its momentum, or lies on the floor, until it is hit.
export function findTops({ run, status }, most) {
  if (run.scene.gravity === 0 || status === "endless") return;
  Object.assign(run, { until: null, tEnd: Infinity, status: "", contacts: [], maxEvents: run.events + most, follows: true });
  while (!run.status && run.apex.some(Number.isNaN)) nextCollision(run);
}

const waitOf = (p) => timeToContact(p.gap, p.rate, p.pull);

function nextCollision(run) {
  const { pairs } = run, waits = pairs.map(waitOf), c = soonest(run, waits), room = run.tEnd - run.t;
  if (run.events >= run.maxEvents) return exhausted(run, c);
  if (waits[c] === Infinity || waits[c] > room) {
    run.status = room === Infinity ? "quiet" : "time";
    return move(run, room);
  }
  const p = pairs[c], w = rateAtContact(p.gap, p.rate, p.pull);
  move(run, waits[c]);
  const isWeak = run.follows ? -w < MERGED * run.scene.impact : p.eps < 1 && -w < run.sticks;
  const [first, last] = isWeak || run.ties in GROUPS ? touchingGroup(run, c, w, isWeak ? -w : Infinity) : [c, c];
  const acted = first < last || isWeak ? collideGroup(run, first, last, isWeak) : collide(run, c, w);
  if (!acted) return void (run.status = "until");
  if (run.until === "separated" && pairs.every((one) => one.rate >= 0 || isNoise(run, one.rate))) run.status = "until";
  else if (!run.elastic) watch(run, c, first < last ? Infinity : -w);
  keepFlight(run);
}

function soonest(run, waits) {
  let best = 0;
  for (let c = 1; c < waits.length; c++) if (isBefore(run, waits, c, best)) best = c;
  return best;
}

function isBefore(run, waits, c, other) {
  if (waits[c] !== waits[other]) return waits[c] < waits[other];
  if (run.ties === "right") return c > other;
  if (run.ties !== "random") return c < other;
  const rank = (i) => mixed(mixed(mixed(run.seed) ^ i) ^ run.pairs[i].hits);
  return rank(c) < rank(other);
}

function mixed(x) {
  x = Math.imul(x ^ (x >> 16), 0x45d9f3b) & 0x7fffffff;
  x = Math.imul(x ^ (x >> 15), 0x2c1b3c6d) & 0x7fffffff;
  return x ^ (x >> 16);
}

function move(run, dt) {
  if (run.scene.gravity) noteApexes(run, dt, (i) => velocityOf(run, i), () => heights(run.scene, run.pairs.map((p) => p.gap), run.t));
  if (dt === Infinity) return;
  for (const p of run.pairs) {
    p.gap = max(0, gapAfter(p.gap, p.rate, p.pull, dt));
    p.rate -= p.pull * dt;
  }
  run.t += dt;
}

const velocityOf = (run, i) => run.u[i] - run.falls[i] * (run.scene.gravity * run.t);
const isStop = ({ until, pairs }, c) => until !== null && until.pair === c && pairs[c].hits + 1 === until.nth;

function collide(run, c, w) {
  const { pairs, u } = run, p = pairs[c], jump = (1 + p.eps) * w;
  if (isStop(run, c)) return false;
  getUp(run, c);
  const vIn = [velocityOf(run, c), velocityOf(run, c + 1)];
  [p.gap, p.rate] = [0, -p.eps * w];
  if (c > 0) pairs[c - 1].rate += p.low * jump;
  if (c + 1 < pairs.length) pairs[c + 1].rate += p.high * jump;
  u[c] += p.low * jump;
  u[c + 1] -= p.high * jump;
  keepContact(run, c, vIn, -jump * p.mEff);
  return true;
}

function keepContact(run, c, vIn, impulse) {
  run.pairs[c].hits++;
  run.events++;
  noteTouch(run, c, run.pairs[0].hits);
  const vOut = [velocityOf(run, c), velocityOf(run, c + 1)];
  run.contacts.push({ pair: c, begin: run.t, end: run.t, vIn, vOut, impulse });
}

function touchingGroup(run, c, w, fastest) {
  const touches = (i) => run.pairs[i]?.gap === 0 && abs(run.pairs[i].rate) <= fastest;
  run.pairs[c].rate = w;
  let [first, last] = [c, c];
  while (touches(first - 1)) first--;
  while (touches(last + 1)) last++;
  return [first, last];
}

function collideGroup(run, first, last, isPlastic) {
  const { pairs, u, scene } = run, group = pairs.slice(first, last + 1), at = group.map((_, i) => first + i);
  const w = scene.mass.slice(first, last + 2).map((m) => 1 / m);
  const rates = group.map((one) => one.rate), p = isPlastic ? newtonRule(w, rates, rates.map(() => 0)) : GROUPS[run.ties](w, rates, group.map((one) => one.eps));
  const hit = at.filter((c) => p[c - first] > 0);
  if (hit.some((c) => isStop(run, c))) return false;
  getUp(run, last);
  const before = hit.map((c) => [velocityOf(run, c), velocityOf(run, c + 1)]), change = velocityChanges(w, p);
  change.forEach((dv, i) => (u[first + i] += dv));
  group.forEach((one, i) => Object.assign(one, { gap: 0, rate: one.rate + (change[i + 1] - change[i]) }));
  if (first > 0) pairs[first - 1].rate += change[0];
  if (last + 1 < pairs.length) pairs[last + 1].rate -= change[group.length];
  const noise = max(...u.slice(first, last + 2).map(abs)) * 2 ** -40;
  for (const one of group) if (abs(one.rate) <= noise) one.rate = 0; // only rounding, or it collides again
  hit.forEach((c, i) => (run.follows || !isPlastic || rates[c - first] < 0) && keepContact(run, c, before[i], p[c - first]));
  return true;
}

// ---- without end, and at rest ----------------------------------------------------------------------------------------

function watch(run, c, speed) {
  if (run.follows || run.sticks > 0) lieDown(run);
  else if (speed < TINY * run.scene.impact) collapse(run, slowAbout(run, c));
  else if (c === 0 && speed < SLUGGISH * run.scene.impact && run.t + restTime(run) < run.tEnd) collapse(run, [0]);
}

// As many events as there may be, and ever slower ones.
function exhausted(run, c) {
  run.status = "endless";
  if (run.sticks === 0 && run.scene.gravity === 0 && isSlow(run, c, FAINTER)) collapse(run, slowAbout(run, c));
}

const collapse = (run, group) => Object.assign(run, { status: "collapse", group });

const isSlow = ({ pairs, scene: { impact } }, c, share = FAINT) => abs(pairs[c]?.rate) < share * impact;

// The pairs about pair c that have all but stopped, and collided of late.
function slowAbout(run, c) {
  const late = new Set(run.contacts.slice(-LATELY).map(({ pair }) => pair)), isOne = (i) => late.has(i) && isSlow(run, i), group = [c];
  for (let i = c - 1; isOne(i); i--) group.unshift(i);
  for (let i = c + 1; isOne(i); i++) group.push(i);
  return group;
}

// How long the ball that just bounced on the floor takes to come to rest on it, alone: 2u/(g(1-ε)); Infinity if another
// may meet it before. Its neighbour stays above the top of the first arc if it does so at both ends of that time.
function restTime({ pairs }) {
  const [{ rate, pull, eps }, next] = pairs;
  if (!(pull > 0)) return Infinity;
  const end = (2 * rate) / (pull * (1 - eps)), arc = (rate * rate) / (2 * pull);
  if (pairs.some((p, c) => c > 1 && waitOf(p) <= end)) return Infinity;
  if (next && min(next.gap, gapAfter(next.gap, next.rate + rate, next.pull + pull, end)) <= arc) return Infinity;
  return end;
}

// Balls without a gap or a rate to what lies below them lie as well: they do not fall.
function lieDown(run) {
  for (let c = 0; c < run.pairs.length && run.falls[c] === 0; c++) {
    const { gap, rate } = run.pairs[c];
    if (gap !== 0 || rate !== 0) break;
    [run.falls[c + 1], run.u[c + 1]] = [0, 0];
    comesToRest(run, c + 1);
  }
  share(run);
}

// Ball c is hit: it and all below fall again.
function getUp(run, c) {
  if (c === 0 || run.falls[c] === 1) return;
  for (let i = 1; i <= c; i++) [run.falls[i], run.u[i]] = [1, run.scene.gravity * run.t];
  share(run);
}

function share({ pairs, falls, scene: { gravity } }) {
  pairs.forEach((p, c) => (p.pull = gravity * (falls[c + 1] - falls[c])));
}

// For drawing: gaps, rates and what changes them, right after each event, valid until the next.
function keepFlight(run) {
  if (run.flights?.length < DRAWN) run.flights.push({ t: run.t, gap: run.pairs.map((p) => p.gap), rate: run.pairs.map((p) => p.rate), pull: run.pairs.map((p) => p.pull) });
}
