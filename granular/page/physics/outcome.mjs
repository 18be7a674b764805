// One scene under both engines: what came out, where they part, and the answer in one line (granular/comparison.py).
import { hardHeights, softHeights } from "./traces.mjs";
import { simulateHard } from "./hard.mjs";
import { simulateSoft } from "./soft.mjs";

const SAME = 0.01;

export function compareEngines(scene, eps, k) {
  const soft = simulateSoft(scene, eps, k, { record: true, maxSteps: 6000 });
  const hard = simulateHard(scene, eps, { record: true });
  const pairs = scene.gap.map((_, c) => ({ pair: c, soft: pairOutcome(soft, c), hard: pairOutcome(hard, c) }));
  const report = { scene, eps, k, soft, hard, pairs, error: largestError(pairs, scene.impact) };
  return { ...report, verdict: verdict(report) };
}

// Number of contacts of a pair, and its separation speed at the end of the last one.
export function pairOutcome(run, c) {
  const log = run.contacts.filter((contact) => contact.pair === c), last = log[log.length - 1];
  return { contacts: log.length, speed: last ? last.vOut[1] - last.vOut[0] : NaN, end: last ? last.end : NaN };
}

function largestError(pairs, impact) {
  const off = pairs.map((p) => Math.abs(p.soft.speed - p.hard.speed)).filter((x) => !Number.isNaN(x));
  return Math.max(0, ...off) / impact;
}

// Velocity of each body after its last contact (its first velocity without any), and how high it goes from there.
export function finals(run, heightsAt) {
  return run.scene.mass.map((mass, i) => {
    const log = run.contacts.filter((c) => (c.pair === i || c.pair === i - 1) && !Number.isNaN(c.end));
    if (!log.length || mass === Infinity) return { velocity: run.scene.velocity[i], rise: 0 };
    const last = log.reduce((a, b) => (b.end >= a.end ? b : a)), velocity = last.vOut[last.pair === i ? 0 : 1];
    const { gravity } = run.scene, up = Math.max(0, velocity);
    return { velocity, rise: gravity ? heightsAt(run, last.end)[i] + (up * up) / (2 * gravity) : 0 };
  });
}

export const softFinals = (run) => finals(run, softHeights);
export const hardFinals = (run) => finals(run, hardHeights);

// ε_eff of floor and two balls in closed form: the inverse of v_r′ = ε (1 + ε) v.
export function effectiveRestitution(speed, impact) {
  const x = Math.max(0, speed) / impact;
  return (2 * x) / (1 + Math.sqrt(1 + 4 * x));
}

const contactsIn = (n) => `${n} contact${n === 1 ? "" : "s"}`;
export const pairName = (scene, c) =>
  scene.mass[0] === Infinity ? (c === 0 ? "floor and ball 1" : `balls ${c} and ${c + 1}`) : `balls ${c + 1} and ${c + 2}`;

function verdict({ scene, soft, hard, pairs, error }) {
  if (soft.status === "unfinished") return "No verdict: too stiff to follow in this page; granular compare runs it.";
  if (hard.status === "collapse" || hard.status === "endless") {
    return "No: hard spheres collide ever faster and come to no end (inelastic collapse); soft spheres have "
      + `${contactsIn(soft.contacts.length)} in all.`;
  }
  const wrong = pairs.filter((p) => p.soft.contacts !== p.hard.contacts).pop();
  if (wrong) {
    const name = pairName(scene, wrong.pair), { soft: s, hard: h } = wrong;
    return Number.isNaN(s.speed) || Number.isNaN(h.speed)
      ? `No: ${name} have ${contactsIn(s.contacts)}, not ${h.contacts}.`
      : `No: ${name} have ${contactsIn(s.contacts)}, not ${h.contacts}, and part at ${s.speed.toPrecision(3)} instead of `
        + `${h.speed.toPrecision(3)} m/s.`;
  }
  if (error > SAME) {
    const much = error < 1 ? `${Math.round(100 * error)} % of` : `${error.toPrecision(2)} times`;
    return `No: speeds of separation are off by ${much} the impact speed.`;
  }
  const within = error < 1e-12 ? "to rounding" : `within ${error.toExponential(0).replace("e-", "·10⁻").replace(/\d+$/, sup)}`;
  if (soft.shared > 0) return `Yes, ${within} of the impact speed, though contacts overlap in time.`;
  return `Yes: every contact is binary, and the outcomes agree ${within} of the impact speed.`;
}

const sup = (digits) => [...digits].map((d) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]).join("");
