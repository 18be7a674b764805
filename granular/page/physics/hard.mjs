// Hard spheres, event-driven: one slot per pair, the next event is the smallest (time, rank), its neighbours are
// predicted anew. Bodies carry the free-fall velocity u, so that v = u - g t between collisions (granular/edmd).
// "collapse": eight dissipative collisions in a row slower than 1e-10 of the impact speed, the digits are used up.
import { gapAfter, rateAtContact, timeToContact } from "./flight.mjs";
import { newtonRule, poissonRule, reflectRule } from "./groups.mjs";
import { pairsOf } from "./scenes.mjs";

const GROUPS = { newton: newtonRule, poisson: poissonRule, reflect: reflectRule };
const DEAD = 1e-10, STREAK = 8;
export const TIES = ["left", "right", "random", "newton", "poisson", "reflect"];

export function simulateHard(scene, eps, { ties = "left", seed = 0, maxEvents = 3000, record = false } = {}) {
  const run = start(scene, eps, ties, seed, record);
  while (!run.status) {
    if (run.contacts.length >= maxEvents) run.status = "endless";
    else advance(run);
    if (run.dead >= STREAK) run.status = "collapse";
  }
  const velocity = run.u.map((u, i) => u - run.falls[i] * scene.gravity * run.t);
  return { scene, contacts: run.contacts, flights: run.flights, time: run.t, velocity, status: run.status };
}

function start(scene, eps, ties, seed, record) {
  const pairs = pairsOf(scene, eps, 1).map((p) => ({ ...p, at: 0, hits: 0, due: Infinity }));
  const falls = scene.mass.map((m) => (m === Infinity ? 0 : 1));
  const run = { scene, eps, ties, seed, pairs, falls, u: [...scene.velocity], t: 0, status: "", contacts: [], flights: record ? [] : null, dead: 0 };
  pairs.forEach((_, c) => predict(run, c));
  keepFlight(run);
  return run;
}

const rateOf = (run, c, t) => run.u[c + 1] - run.u[c] - run.pairs[c].pull * t;

function predict(run, c) {
  const p = run.pairs[c];
  p.due = p.at + timeToContact(p.gap, rateOf(run, c, p.at), p.pull);
}

function advance(run) {
  const { scene, pairs } = run, c = soonest(run), due = pairs[c].due;
  if (due === Infinity || due > scene.tEnd) {
    run.t = due === Infinity && scene.tEnd === Infinity ? run.t : scene.tEnd;
    return void (run.status = scene.tEnd === Infinity ? "quiet" : "time");
  }
  run.t = due;
  const [first, last] = run.ties in GROUPS ? touchingGroup(run, c) : [c, c];
  const acted = first < last ? collideGroup(run, first, last) : collide(run, c);
  if (!acted) return void (run.status = "until");
  keepFlight(run);
  if (scene.until === "separated" && pairs.every((_, i) => rateOf(run, i, run.t) >= 0)) run.status = "until";
}

function soonest(run) {
  let best = 0;
  for (let c = 1; c < run.pairs.length; c++) if (isBefore(run, c, best)) best = c;
  return best;
}

function isBefore(run, c, other) {
  const a = run.pairs[c], b = run.pairs[other];
  if (a.due !== b.due) return a.due < b.due;
  if (run.ties === "right") return c > other;
  if (run.ties !== "random") return c < other;
  return mixed(mixed(mixed(run.seed) ^ c) ^ a.hits) < mixed(mixed(mixed(run.seed) ^ other) ^ b.hits);
}

function mixed(x) {
  x = Math.imul(x ^ (x >> 16), 0x45d9f3b) & 0x7fffffff;
  x = Math.imul(x ^ (x >> 15), 0x2c1b3c6d) & 0x7fffffff;
  return x ^ (x >> 16);
}

const velocityOf = (run, i) => run.u[i] - run.falls[i] * (run.scene.gravity * run.t);
const isStop = ({ scene: { until }, pairs }, c) => until.pair === c && pairs[c].hits + 1 === until.nth;

function collide(run, c) {
  const { pairs, u } = run, p = pairs[c];
  if (isStop(run, c)) return false;
  const w = rateAtContact(p.gap, rateOf(run, c, p.at), p.pull), jump = (1 + run.eps) * w;
  const vIn = [velocityOf(run, c), velocityOf(run, c + 1)];
  watch(run, -w);
  if (c > 0) carry(run, c - 1);
  if (c + 1 < pairs.length) carry(run, c + 1);
  u[c] += p.low * jump;
  u[c + 1] -= p.high * jump;
  [p.gap, p.at] = [0, run.t];
  keepContact(run, c, vIn);
  for (let i = Math.max(c - 1, 0); i <= Math.min(c + 1, pairs.length - 1); i++) predict(run, i);
  return true;
}

function watch(run, speed) {
  run.dead = run.eps < 1 && speed < DEAD * run.scene.impact ? run.dead + 1 : 0;
}

function carry(run, c) {
  const p = run.pairs[c];
  p.gap = Math.max(0, gapAfter(p.gap, rateOf(run, c, p.at), p.pull, run.t - p.at));
  p.at = run.t;
}

function keepContact(run, c, vIn) {
  run.pairs[c].hits++;
  run.contacts.push({ pair: c, begin: run.t, end: run.t, vIn, vOut: [velocityOf(run, c), velocityOf(run, c + 1)] });
}

function touchingGroup(run, c) {
  const touches = (i) => {
    const p = run.pairs[i];
    return p && gapAfter(p.gap, rateOf(run, i, p.at), p.pull, run.t - p.at) <= 0;
  };
  let [first, last] = [c, c];
  while (touches(first - 1)) first--;
  while (touches(last + 1)) last++;
  return [first, last];
}

function collideGroup(run, first, last) {
  const { pairs, u, scene } = run, group = pairs.map((_, c) => c).slice(first, last + 1);
  for (let c = Math.max(first - 1, 0); c <= Math.min(last + 1, pairs.length - 1); c++) carry(run, c);
  const w = scene.mass.slice(first, last + 2).map((m) => 1 / m);
  const p = GROUPS[run.ties](w, group.map((c) => rateOf(run, c, run.t)), run.eps);
  const hit = group.filter((c) => p[c - first] > 0);
  if (hit.some((c) => isStop(run, c))) return false;
  watch(run, Math.max(...group.map((c) => -rateOf(run, c, run.t))));
  const before = hit.map((c) => [velocityOf(run, c), velocityOf(run, c + 1)]);
  for (const c of group) {
    pairs[c].gap = 0;
    u[c] -= p[c - first] / scene.mass[c];
    u[c + 1] += p[c - first] / scene.mass[c + 1];
  }
  dropNoise(run, group);
  hit.forEach((c, i) => keepContact(run, c, before[i]));
  for (let c = Math.max(first - 1, 0); c <= Math.min(last + 1, pairs.length - 1); c++) predict(run, c);
  return true;
}

// Rates that are only rounding are made exactly 0, or their pairs collide again.
function dropNoise(run, group) {
  const { u, scene, pairs } = run, noise = Math.max(...group.map((c) => Math.max(Math.abs(u[c]), Math.abs(u[c + 1])))) * 2 ** -40;
  const isNoise = (c) => Math.abs(rateOf(run, c, run.t)) <= noise;
  for (const c of group) {
    if (scene.mass[c] >= scene.mass[c + 1] && isNoise(c)) u[c + 1] = u[c] + pairs[c].pull * run.t;
  }
  for (const c of [...group].reverse()) {
    if (scene.mass[c] < scene.mass[c + 1] && isNoise(c)) u[c] = u[c + 1] - pairs[c].pull * run.t;
  }
}

// For drawing: gaps and rates right after each event, valid until the next.
function keepFlight(run) {
  if (!run.flights) return;
  const gap = run.pairs.map((p, c) => Math.max(0, gapAfter(p.gap, rateOf(run, c, p.at), p.pull, run.t - p.at)));
  run.flights.push({ t: run.t, gap, rate: run.pairs.map((_, c) => rateOf(run, c, run.t)) });
}
