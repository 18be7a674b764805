// What a run comes to, read from its contacts, and how far two runs differ (granular/comparison/outcome.py).
import { settledRun } from "./hard.mjs";
import { pairsOf, ROUNDING } from "./scenes.mjs";
import { abs, max, min, sqrt, sum } from "./numbers.mjs";

export const SAME = 0.01; // of the fastest impact
export const INSTANT = 1e-12; // of the time
const SHIFT = 1e-12, PERSISTENCE = 10; // of the gaps; another tie rule, in collisions of the first
const OTHERS = ["left", "right", "poisson"]; // rules that take any restitutions

export const isEarly = (run) => ["collapse", "endless", "unfinished"].includes(run.status);
export const riseIn = (run, i) => (isEarly(run) && run.status !== "collapse" ? NaN : run.apex[i]);
export const approach = ({ vIn: [lower, upper] }) => lower - upper;
export const isOver = (contact) => !Number.isNaN(contact.end);
export const partingOf = ({ vOut: [lower, upper] }) => abs(upper - lower) || 0; // without end: 0
export const largest = (values) => values.reduce((most, x) => (x > most ? x : most), 0);
export const ofPair = (run, c) => run.contacts.filter((contact) => contact.pair === c);
export const counts = (run) => run.scene.gap.map((_, c) => ofPair(run, c).length);

// How long a run lasts; balls that rest do so to its end.
export const lasted = ({ status, time, scene: { tEnd } }) => (status === "resting" && tEnd < Infinity ? tEnd : time);

// The run without contacts that are rounding beside the fastest of either run.
export function counted(run, other) {
  const fastest = largest([...run.contacts, ...other.contacts].map(approach));
  const mEff = pairsOf(run.scene, 1, 1).map((p) => p.mEff), strength = (c) => max(approach(c), c.impulse / mEff[c.pair]);
  const contacts = run.contacts.filter((c) => strength(c) > ROUNDING * fastest);
  return contacts.length === run.contacts.length ? run : { ...run, contacts };
}

// Collisions of a pair in one instant are one, at whose end the instant is over.
function atOnce(run) {
  const log = run.contacts, contacts = [];
  for (let i = 0, j = 0; i < log.length; i = j) {
    const after = [], seen = new Set();
    for (; j < log.length && log[j].begin - log[max(i, j - 1)].begin <= INSTANT * log[j].begin; j++) [after[log[j].pair], after[log[j].pair + 1]] = log[j].vOut;
    for (const one of log.slice(i, j)) {
      if (!seen.has(one.pair)) contacts.push({ ...one, vOut: [after[one.pair], after[one.pair + 1]] });
      seen.add(one.pair);
    }
  }
  return { ...run, contacts };
}

// Both runs with the contacts that count.
export function inBoth(hard, soft) {
  const once = atOnce(hard);
  return [counted(once, soft), counted(soft, once)];
}

// The first contacts of every pair, as many as `most` says.
export function first(run, most) {
  const seen = most.map(() => 0);
  return { ...run, contacts: run.contacts.filter(({ pair }) => seen[pair]++ < most[pair]) };
}

// Velocity with which each body leaves the last of its contacts, and when: the initial one without contacts; NaN where one
// has no end.
function leaving({ scene, contacts }) {
  const u = [...scene.velocity], at = u.map(() => 0), rank = ({ end }) => (Number.isNaN(end) ? Infinity : end);
  for (const { pair, vOut, end } of [...contacts].sort((a, b) => rank(a) - rank(b) || 0)) {
    for (const side of [0, 1]) [u[pair + side], at[pair + side]] = [vOut[side], end];
  }
  return { u, at };
}

export const leavingVelocities = (run) => leaving(run).u;

// Differences in m/s of the leaving velocities of all balls. Balls are compared where their last contacts end, or carried in
// free flight to one time, whichever is less; NaN where a contact has no end.
export function differences(one, other) {
  const { mass, gravity } = one.scene, a = leaving(one), b = leaving(other);
  return mass.map((m, i) => {
    const d = a.u[i] - b.u[i];
    return m === Infinity ? NaN : min(abs(d), abs(d + gravity * (a.at[i] - b.at[i])));
  });
}

// The largest difference in m/s, contact by contact, of the approach and separation speeds of pairs that stick in both hard
// runs. A contact that only one run has counts in full; contacts up to `weight` in both are those of balls that settle.
export function stuckDifference(one, other, weight) {
  return largest(one.scene.gap.map((_, c) => {
    const logs = [one, other].map((run) => [ofPair(run, c), run.sticks]), [[a], [b]] = logs;
    if (!logs.every(([log, sticks]) => sticks > 0 && log.length && partingOf(log.at(-1)) <= sticks)) return 0;
    return largest([...(a.length > b.length ? a : b)].map((_, i) => {
      const [[v, u], [w, z]] = [a[i], b[i]].map((contact) => (contact ? [approach(contact), partingOf(contact)] : [0, 0]));
      return max(v, w) > weight ? max(abs(v - w), abs(u - z)) : 0;
    }));
  }));
}

export function shifted(scene) {
  const typical = sum(scene.gap) / scene.gap.length || 1;
  return { ...scene, gap: scene.gap.map((gap, c) => gap + SHIFT * (gap > 0 ? (c % 2 ? -gap : gap) : typical)) };
}

// How far hard spheres differ from themselves, from gaps shifted by 1e-12 of themselves: D = √(Σ m Δu² / Σ m U²) over all
// balls that collide, and the largest Δu of a ball; without what happens just at an end time.
export function ownDifference(hard, twin, unit) {
  const ends = hard.status === "time" && twin.status === "time", before = ends ? hard.time * (1 - 1e-9) : Infinity;
  const [one, other] = [twin, hard].map((run) => ({ ...run, contacts: run.contacts.filter((c) => c.begin < before) }));
  const balls = differences(one, other), touched = new Set(hard.contacts.flatMap(({ pair }) => [pair, pair + 1]));
  let off = 0, scale = 0;
  hard.scene.mass.forEach((m, i) => {
    if (m === Infinity || !touched.has(i)) return;
    scale += m * unit * unit;
    if (!Number.isNaN(balls[i])) off += m * balls[i] ** 2;
  });
  return { predictable: sqrt(off / scale), shift: largest(balls) / unit };
}

// Hard runs under the other tie rules, by rule, where balls touch or collide at once. Poisson's rule is not defined for balls
// that stick, and is left out where they do.
export function otherAnswers(hard, eps, ties) {
  const { scene, contacts } = hard, maxEvents = PERSISTENCE * (contacts.length + scene.mass.length);
  const met = contacts.some((c, i) => i > 0 && c.begin === contacts[i - 1].begin && abs(c.pair - contacts[i - 1].pair) === 1);
  if (scene.mass.length < 3 || !(met || scene.gap.includes(0))) return [];
  const names = OTHERS.filter((name) => name !== ties && !(name === "poisson" && hard.sticks > 0));
  return names.map((name) => [name, settledRun(scene, eps, { ties: name, maxEvents })]).filter(([name, run]) => !(name === "poisson" && run.status === "collapse"));
}
