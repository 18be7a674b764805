// May this scene be event-driven? The answer with its kind: that of granular/comparison/verdict.py, in fewer words. It
// names a sentence and what it speaks of; the words are elsewhere.
import { counts, isEarly, SAME, sameButForTiming, SMALL } from "./measures.mjs";
import { ROUNDING } from "./scenes.mjs";

const PATIENT = 10000; // steps
const UPRIGHT = { left: "lower", right: "upper" };

export const pairName = (scene, c) => {
  if (scene.mass[0] !== Infinity) return { say: "balls", a: c + 1, b: c + 2 };
  return c === 0 ? { say: "floor-ball" } : { say: "balls", a: c, b: c + 1 };
};

export function verdict(report) {
  for (const judge of [unfinished, endless, notUnique, unpredictable, countsDiffer, outcomes]) {
    const found = judge(report);
    if (found) return { kind: found[0], verdict: found[1] };
  }
}

// Nothing is claimed of a run that did not get to its end.
function unfinished({ soft, hard, patience }) {
  if (soft.status === "unfinished") return ["no verdict", { say: patience.maxSteps < PATIENT ? "verdict-wait" : "verdict-stiff" }];
  return isEarly(hard) ? ["no verdict", { say: "verdict-collapse", n: soft.contacts.length }] : null;
}

// A soft contact that fills much of the run, or has no end in sight, while the hard spheres have bounced.
function endless({ scene, pairs, soft, hard }) {
  for (const p of pairs) {
    if (!p.ongoing) continue;
    const lasted = soft.time - p.soft.last.begin, still = Number.isNaN(p.soft.speed);
    const parting = Math.max(Math.abs(hard.velocity[p.pair + 1] - hard.velocity[p.pair]), Math.abs(p.hard.speed) || 0);
    if (parting > SAME * scene.impact && (lasted > SMALL * soft.time || still)) {
      return ["lasting", { say: "verdict-lasting", pair: pairName(scene, p.pair), time: [lasted, "s"] }];
    }
  }
  return null;
}

// Balls that touch or collide at once, where tie rules differ: no hard-sphere answer is the right one.
function notUnique({ scene, rule, tieErrors, predictable }) {
  const [error, worst] = tieErrors.reduce((most, [name, e]) => (e > most[0] ? [e, name] : most), [0, ""]);
  const called = (name) => ({ say: `tie-${scene.gravity ? (UPRIGHT[name] ?? name) : name}` });
  if (error > SAME) return ["not uniquely", { say: "verdict-ties", one: called(rule), other: called(worst), error: [error, "", 2] }];
  return predictable > SAME && scene.gap.includes(0) ? ["not uniquely", { say: "verdict-tie" }] : null;
}

function unpredictable({ predictable, soft }) {
  if (!(predictable > SAME)) return null;
  return ["not ball by ball", { say: "verdict-chaos", share: [(100 * soft.shared) / soft.impulse, "", 2] }];
}

// Pairs with other numbers of contacts, unless only the tie rule or the end time decides that.
function countsDiffer(report) {
  const { scene, pairs, soft, hard, eps, k, error } = report, wrong = pairs.filter((p) => p.hard.contacts !== p.soft.contacts);
  if (!wrong.length) return null;
  if (sameButForTiming(soft, hard, eps, k)) return ["timing", { say: "verdict-timing", n: wrong.length }];
  const p = wrong.reduce((most, one) => (miss(one) >= miss(most) ? one : most));
  const said = { pair: pairName(scene, p.pair), n: p.soft.contacts, hard: p.hard.contacts };
  const many = wrong.length > 1 ? { say: "count-many", n: wrong.length, of: pairs.length } : "";
  if (error > SAME) return ["counts", { say: "verdict-counts", ...said, many, parting: parting(p, report) }];
  if (wrong.every((one) => isUnsettled(report, one.pair))) return ["yes, ties", { say: "verdict-yes-ties", ...said, within: within(error) }];
  return ["counts", { say: "verdict-counts", ...said, many, parting: { say: "parting-same", within: within(error) } }];
}

const miss = (p) => (Number.isNaN(p.soft.speed - p.hard.speed) ? -1 : Math.abs(p.soft.speed - p.hard.speed));

// Whether a pair collides another number of times under another tie rule, or from shifted gaps.
const isUnsettled = ({ hard, twin, ties }, c) => [twin, ...ties.map(([, run]) => run)].some((run) => counts(run)[c] !== counts(hard)[c]);

function parting(p, { scene, error }) {
  if (p.ongoing && Number.isNaN(p.soft.speed)) return { say: "parting-never" };
  if (miss(p) > SAME * scene.impact) return { say: "parting-speeds", soft: [p.soft.speed, "m/s"], hard: [p.hard.speed, "m/s"] };
  return { say: "parting-off", error: [error, "", 2] };
}

function outcomes({ error, soft }) {
  if (error > SAME) return ["off", { say: "verdict-off", error: [error, "", 2] }];
  if (soft.shared > ROUNDING * soft.impulse) return ["yes, overlap", { say: "verdict-yes-overlap", within: within(error) }];
  return ["yes", { say: "verdict-yes", within: within(error) }];
}

const within = (error) => (error < 1e-12 ? { say: "within-rounding" } : { say: "within", error: [error, "", 1] });
