// What a run comes to, and how far two runs differ (granular/outcome.py, measures.py, timing.py, tie_rules.py).
import { simulateHard } from "./hard.mjs";
import { pairsOf, ROUNDING } from "./scenes.mjs";

export const SAME = 0.01; // of the impact speed
export const SMALL = 0.1; // of a run
const SHIFT = 1e-12;
const OTHERS = ["left", "right", "poisson"]; // rules that take any restitutions

export const isEarly = (run) => ["collapse", "endless", "unfinished"].includes(run.status);
const approach = ({ vIn: [lower, upper] }) => lower - upper;
const isOver = (contact) => !Number.isNaN(contact.end);

// The run without contacts that are rounding beside the fastest of either run.
export function counted(run, other) {
  const fastest = [...run.contacts, ...other.contacts].reduce((most, c) => Math.max(most, approach(c)), 0);
  const mEff = pairsOf(run.scene, 1, 1).map((p) => p.mEff), strength = (c) => Math.max(approach(c), c.impulse / mEff[c.pair]);
  const contacts = run.contacts.filter((c) => strength(c) > ROUNDING * fastest);
  return contacts.length === run.contacts.length ? run : { ...run, contacts };
}

// Number of contacts of a pair, and its separation speed at the end of the last one.
export function pairOutcome(run, c) {
  const log = run.contacts.filter((contact) => contact.pair === c), last = log[log.length - 1];
  return { contacts: log.length, speed: last ? last.vOut[1] - last.vOut[0] : NaN, end: last ? last.end : NaN, last };
}

// Velocity with which each body leaves the last of its contacts that ends, the initial one without contacts.
export function leavingVelocities({ scene, contacts }) {
  const u = [...scene.velocity], latest = u.map(() => -Infinity);
  for (const { pair } of contacts) u[pair] = u[pair + 1] = NaN;
  for (const contact of contacts.filter(isOver)) {
    for (const side of [0, 1]) {
      const i = contact.pair + side;
      if (contact.end >= latest[i]) [u[i], latest[i]] = [contact.vOut[side], contact.end];
    }
  }
  return u;
}

// The largest difference in m/s of a leaving velocity of a ball, or of a separation speed of a pair.
export function largestDifference(one, other) {
  const u = leavingVelocities(one), v = leavingVelocities(other), { mass, gap } = one.scene;
  const balls = mass.map((m, i) => (m === Infinity ? NaN : u[i] - v[i]));
  const pairs = gap.map((_, c) => pairOutcome(one, c).speed - pairOutcome(other, c).speed);
  return [...balls, ...pairs].reduce((most, d) => (Math.abs(d) > most ? Math.abs(d) : most), 0);
}

// D = √(Σ m (Δu)² / Σ m v₀²) of hard spheres against themselves, from gaps shifted by 1e-12 of themselves; without what
// happens just at an end time.
export function predictability(hard, twin) {
  const { scene } = hard, ends = hard.status === "time" && twin.status === "time", before = ends ? hard.time * (1 - 1e-9) : Infinity;
  const [u, v] = [twin, hard].map((run) => leavingVelocities({ ...run, contacts: run.contacts.filter((c) => c.begin < before) }));
  const fall = scene.gravity * (hard.contacts[0]?.begin ?? 0);
  let off = 0, scale = 0;
  scene.mass.forEach((m, i) => {
    if (m === Infinity) return;
    scale += m * (scene.velocity[i] - fall) ** 2;
    if (!Number.isNaN(u[i] - v[i])) off += m * (u[i] - v[i]) ** 2;
  });
  return Math.sqrt(off / scale);
}

export function shifted(scene) {
  const typical = scene.gap.reduce((a, b) => a + b) / scene.gap.length || 1;
  return { ...scene, gap: scene.gap.map((gap, c) => gap + SHIFT * (gap > 0 ? (c % 2 ? -gap : gap) : typical)) };
}

// Hard runs under the other tie rules that come to an end, by rule, where balls touch or collide at once.
export function otherAnswers(hard, eps, ties) {
  const { scene, contacts } = hard;
  const atOnce = contacts.some((c, i) => i > 0 && c.begin === contacts[i - 1].begin && Math.abs(c.pair - contacts[i - 1].pair) === 1);
  if (scene.mass.length < 3 || !(atOnce || scene.gap.includes(0))) return [];
  const names = OTHERS.filter((name) => name !== ties);
  return names.map((name) => [name, simulateHard(scene, eps, { ties: name })]).filter(([, run]) => !isEarly(run));
}

export const counts = (run) => run.scene.gap.map((_, c) => pairOutcome(run, c).contacts);

// Whether two runs cut at one end time differ only by contacts within the lag of soft spheres before it: one duration per
// collision of the busiest pair, small beside the time between its contacts.
export function sameButForTiming(soft, hard, eps, k) {
  if (soft.status !== "time" || hard.status !== "time") return false;
  const busiest = Math.max(...counts(soft), ...counts(hard)), isolated = pairsOf(hard.scene, eps, k).map((p) => p.duration);
  const lasted = soft.contacts.map((c) => (c.ongoing || !isOver(c) ? soft.time : c.end) - c.begin);
  const lag = Math.max(0, ...lasted, ...hard.contacts.map((c) => isolated[c.pair])) * (1 + busiest);
  if (lag * busiest > SMALL * soft.time) return false;
  const early = (run) => counts({ ...run, contacts: run.contacts.filter((c) => c.begin < soft.time - lag) });
  const [a, b, earlyA, earlyB] = [counts(soft), counts(hard), early(soft), early(hard)];
  const onlyLate = a.some((n, c) => n !== b[c]) && a.every((n, c) => Math.max(earlyA[c], earlyB[c]) <= Math.min(n, b[c]));
  return onlyLate && leaveAlike(soft, hard, SAME * Math.max(...hard.contacts.map(approach)));
}

// From all contacts that both runs have, and that are over, balls leave at the same velocities.
function leaveAlike(soft, hard, tolerance) {
  return hard.scene.gap.every((_, c) => {
    const [a, b] = [soft, hard].map((run) => run.contacts.filter((contact) => contact.pair === c));
    return a.every((one, i) => !b[i] || one.ongoing || [0, 1].every((side) => !(Math.abs(one.vOut[side] - b[i].vOut[side]) > tolerance)));
  });
}
