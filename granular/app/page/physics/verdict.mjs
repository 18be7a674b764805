// May this scene be event-driven? The answer of granular/comparison/answer.py, in fewer words: `answer` is that of gr.Answer,
// `kind` which of its reasons it is. It names a sentence and what it speaks of; the words are elsewhere.
import { isEarly, SAME } from "./measures.mjs";
import { ROUNDING } from "./scenes.mjs";
import { abs, floor, log10 } from "./numbers.mjs";

const PATIENT = 10000; // steps
const UPRIGHT = { left: "lower", right: "upper" };
const ANSWERS = { forever: "no", sinks: "no", counts: "no", off: "no", "yes, overlap": "yes" };

// A ball has its number, a real one its kind.
const ballName = ({ kinds, mass }, i) => (kinds?.[i] ? { say: `ball-${kinds[i]}` } : { say: "ball", n: mass[0] === Infinity ? i : i + 1 });

// Two balls are told by their numbers, real ones by what they are.
export const pairName = (scene, c) => {
  const [a, b] = [c, c + 1].map((i) => scene.kinds?.[i]);
  if (b && (a || c === 0)) return { say: "pair-of", a: { say: a ? `ball-${a}` : "floor" }, b: { say: `ball-${b}` } };
  if (scene.mass[0] !== Infinity) return { say: "balls", a: c + 1, b: c + 2 };
  return c === 0 ? { say: "floor-ball" } : { say: "balls", a: c, b: c + 1 };
};

export function verdict(report) {
  for (const judge of [unfinished, forever, notUnique, unpredictable, countsDiffer, outcomes]) {
    const found = judge(report);
    if (found) return { answer: ANSWERS[found[0]] ?? found[0], kind: found[0], verdict: found[1] };
  }
}

// Nothing is claimed of a run that did not get to its end.
function unfinished({ cut, soft, early, forever: n, patience }) {
  if (isEarly(soft)) return ["undecided", { say: patience.maxSteps < PATIENT ? "verdict-wait" : "verdict-stiff" }];
  return early && !n ? ["undecided", { say: "verdict-collapse", n: cut.contacts.length }] : null;
}

const forever = ({ forever: n }) => (n ? ["forever", { say: "verdict-forever", n }] : null);

// Balls that touch or collide at once, where tie rules differ: no hard-sphere answer is the right one.
function notUnique({ scene, rule, tieErrors, predictable }) {
  const [error, worst] = tieErrors.reduce((most, [name, e]) => (e > most[0] ? [e, name] : most), [0, ""]);
  const called = (name) => ({ say: `tie-${scene.gravity ? (UPRIGHT[name] ?? name) : name}` });
  if (error > SAME) return ["not_unique", { say: "verdict-ties", one: called(rule), other: called(worst), error: [error, "", 2] }];
  return predictable > SAME && scene.gap.includes(0) ? ["not_unique", { say: "verdict-tie" }] : null;
}

function unpredictable({ predictable, shift, cut }) {
  if (predictable > SAME) return ["not_ball_by_ball", { say: "verdict-chaos", share: [(100 * cut.shared) / cut.impulse, "", 2] }];
  return shift > SAME ? ["not_unique", { say: "verdict-shift", error: [shift, "", 2] }] : null;
}

// Pairs that do not rest, with other numbers of contacts.
function countsDiffer(report) {
  const { scene, pairs, wrong } = report, miss = ({ soft, hard }) => abs(soft - hard);
  if (!wrong.length) return null;
  const { pair: of, soft: n, hard } = wrong.reduce((most, one) => (miss(one) >= miss(most) ? one : most));
  const many = wrong.length > 1 ? { say: "count-many", n: wrong.length, of: pairs.filter((p) => p.soft + p.hard).length } : "";
  return ["counts", { say: "verdict-counts", pair: pairName(scene, of), n, hard, many, parting: parting(report), of }];
}

// The ball that leaves with other velocities, if one decides.
function parting({ scene, error, leaves: { apart, ball, soft, hard }, unit }) {
  return error > SAME && apart / unit === error ? { say: "parting-speeds", ball: ballName(scene, ball), soft: [soft, "m/s", 4], hard: [hard, "m/s", 4] } : "";
}

// Yes takes an error that is known, and small, no ball that sinks where it rests, and checks that came to their end.
function outcomes(report) {
  const { error, sunk, cut, unchecked } = report;
  if (!(error <= SAME)) return ["off", { say: "verdict-off", error: [error, "", 2], parting: parting(report) }];
  if (sunk > SAME) return ["sinks", { say: "verdict-sinks", share: [sunk, "", 2] }];
  if (unchecked) return ["undecided", { say: "verdict-unchecked" }];
  if (cut.shared > ROUNDING * cut.impulse) return ["yes, overlap", { say: "verdict-yes-overlap", within: within(error) }];
  return ["yes", { say: "verdict-yes", within: within(error) }];
}

// Up to one digit: the error is never larger than is said.
const within = (error, unit = 10 ** floor(log10(error))) =>
  (error < 1e-12 ? { say: "within-rounding" } : { say: "within", error: [Math.ceil(error / unit) * unit, "", 1] });
