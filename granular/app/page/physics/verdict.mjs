// May this scene be event-driven? The answer of granular/comparison/answer.py, in fewer words: `answer` is that of gr.Answer,
// `kind` which of its reasons it is. It names a sentence and what it speaks of; the words are elsewhere.
import { digits } from "../shell/format.mjs";
import { isEarly, SAME } from "./measures.mjs";
import { ROUNDING } from "./scenes.mjs";
import { abs, floor, log10, max } from "./numbers.mjs";

const PATIENT = 10000; // steps
const ALIKE = 0.05, NEARLY = 0.05; // heights, and errors, that differ less are close
const UPRIGHT = { left: "lower", right: "upper" };
const ANSWERS = { forever: "no", sinks: "no", counts: "no", off: "no", "yes, overlap": "yes" };

// A ball has its number, a real one its kind.
const ballName = ({ kinds, mass }, i) => (kinds?.[i] ? { say: "the", ball: { say: `ball-${kinds[i]}` } } : { say: "ball", n: mass[0] === Infinity ? i : i + 1 });

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
  if (error > SAME) return ["not_unique", { say: "verdict-ties", rules: { say: "two-rules", one: called(rule), other: called(worst) }, worst, error: ofFastest(error) }];
  return predictable > SAME && scene.gap.includes(0) ? ["not_unique", { say: "verdict-tie" }] : null;
}

function unpredictable({ predictable, shift, cut }) {
  if (predictable > SAME) return ["not_ball_by_ball", { say: "verdict-chaos", share: [(100 * cut.shared) / cut.impulse, "", 2] }];
  return shift > SAME ? ["not_unique", { say: "verdict-shift", error: ofFastest(shift) }] : null;
}

// Pairs that do not rest, with other numbers of contacts.
function countsDiffer(report) {
  const { scene, pairs, wrong } = report, miss = ({ soft, hard }) => abs(soft - hard);
  if (!wrong.length) return null;
  const { pair: of, soft: n, hard } = wrong.reduce((most, one) => (miss(one) >= miss(most) ? one : most));
  const many = wrong.length > 1 ? { say: "count-many", n: wrong.length, of: pairs.filter((p) => p.soft + p.hard).length } : "";
  return ["counts", { say: "verdict-counts", counts: { say: "counts-differ", pair: pairName(scene, of), n, hard, many }, n, hard, parting: parting(report), of }];
}

// The ball that leaves with other velocities, if one decides.
function parting({ scene, error, leaves: { apart, ball, soft, hard }, unit }) {
  if (!(error > SAME && apart / unit === error)) return "";
  const n = digits(soft) === digits(hard) ? 6 : 3;
  return { say: "also", it: { say: "parting-speeds", ball: ballName(scene, ball), soft: [soft, "", n], hard: [hard, "", n] } };
}

// Yes takes an error that is known, and small, no ball that sinks where it rests, and checks that came to their end.
function outcomes(report) {
  const { error, sunk, cut, unchecked } = report;
  if (!(error <= SAME)) return ["off", { say: "verdict-off", error: ofFastest(error), parting: parting(report) }];
  if (sunk > SAME) return ["sinks", { say: "verdict-sinks", share: inPercent(sunk) }];
  if (unchecked) return ["undecided", { say: "verdict-unchecked" }];
  if (isShared(cut)) return ["yes, overlap", { say: "verdict-yes-overlap", within: within(error), overlap: { say: "overlap" } }];
  return ["yes", { say: "verdict-yes", within: within(error) }];
}

const isShared = ({ shared, impulse }) => shared > ROUNDING * impulse;

const inPercent = (x, n = 2) => ({ say: "percent", n: [x < 1e-12 ? 0 : 100 * x, "", n] });

// Errors are in units of the fastest impact. The story leaves the unit out.
const ofFastest = (x, n = 2) => ({ ...inPercent(x, n), say: "of-fastest" });

const inStory = (verdict) => ({ ...verdict, rules: "", ...(verdict.error ? { error: { ...verdict.error, say: "percent" } } : {}), ...(verdict.within?.error ? { within: inStory(verdict.within) } : {}) });

// Up to one digit: the error is never larger than is said.
const within = (error, unit = 10 ** floor(log10(error))) =>
  (error < 1e-12 ? { say: "within-rounding" } : { say: "within", bound: Math.ceil(error / unit) * unit, error: ofFastest(Math.ceil(error / unit) * unit, 1) });

// The answer in heights where something rises: it is that of the library, and stands beside its error. A small error that
// does not decide is left out. The story has the same sentences in metres, without the names of rules and units.
export function inHeights(report, isStory = false) {
  const { answer } = report, verdict = heightsOf(report, isStory ? 1 : report.scene.drop, isStory ? "m" : { say: "unit-in-drops" }) ?? report.verdict;
  return { answer, verdict: isStory ? inStory(verdict) : verdict };
}

function heightsOf({ finals, scene, answer, verdict, error, kind, leaves, cut, otherRise, unit: fastest }, per, unit) {
  const last = scene.mass.length - 1, [hard, soft] = ["hard", "soft"].map((engine) => (scene.gravity ? finals[engine][last].rise / per : NaN)), high = otherRise / per;
  if (verdict.worst && soft >= 0 && digits(hard) !== digits(high)) return { ...verdict, say: "heights-ties", low: hard, high, soft, unit };
  const decides = answer === "yes" || (answer === "no" && error > SAME);
  if (!decides || kind === "forever" || !(hard >= 0 && soft >= 0)) return null;
  const isClose = abs(hard - soft) <= ALIKE * max(hard, soft), key = answer === "yes" ? (isClose ? "yes" : "later") : !isClose ? "no" : error <= NEARLY ? "nearly" : "alike";
  const why = verdict.counts ? { say: "also", it: verdict.counts } : leaves.ball === last ? "" : parting({ scene, error, leaves, unit: fastest });
  return { say: `heights-${key}`, top: last > 1 ? { say: "to-top" } : "", hard, soft, unit, why, error: ofFastest(error), overlap: isShared(cut) ? { say: "overlap" } : "" };
}
