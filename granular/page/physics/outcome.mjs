// One scene under both engines: what came out, where they part, and the answer in one line (granular/comparison).
import { simulateHard } from "./hard.mjs";
import { counted, isEarly, largestDifference, leavingVelocities, otherAnswers, pairOutcome, predictability, shifted } from "./measures.mjs";
import { simulateSoft } from "./soft.mjs";
import { verdict } from "./verdict.mjs";

// Steps of the soft and events of the hard spheres, and both past the stop in search of the apexes: while a slider moves, and when it
// rests and the first were not enough.
export const AT_ONCE = { maxSteps: 800, maxEvents: 1500, follow: 100 };
export const AT_LEISURE = { maxSteps: 60000, maxEvents: 20000, follow: 20000 };

// `soft` and `hard` are without contacts that are rounding; those open at the stop are followed to their ends.
export function compareEngines(scene, eps, k, { ties = "left", patience = AT_LEISURE } = {}) {
  const { maxSteps, maxEvents, follow } = patience, run = {
    soft: simulateSoft(scene, eps, k, { record: true, maxSteps, follow }),
    hard: simulateHard(scene, eps, { ties, record: true, maxEvents, follow }),
  };
  const soft = counted(run.soft, run.hard), hard = counted(run.hard, run.soft), early = isEarly(soft) || isEarly(hard);
  const twin = early ? hard : counted(simulateHard(shifted(scene), eps, { ties }), soft);
  const others = early ? [] : otherAnswers(hard, eps, ties).map(([name, other]) => [name, counted(other, soft)]);
  const far = (one, other) => largestDifference(one, other) / scene.impact;
  const report = {
    scene, eps, k, soft, hard, twin, rule: ties, ties: others, finals: { hard: finals(hard), soft: finals(soft) },
    pairs: scene.gap.map((_, c) => outcomeOf(soft, hard, c)), error: early ? NaN : far(soft, hard),
    tieErrors: others.map(([name, other]) => [name, far(other, hard)]), predictable: early ? NaN : predictability(hard, twin),
  };
  return { ...report, isHasty: patience === AT_ONCE && isOpen(report), ...verdict({ ...report, patience }) };
}

const isOpen = ({ scene, soft, hard }) =>
  soft.status === "unfinished" || hard.status === "endless" || (scene.gravity > 0 && [soft, hard].some((run) => !isEarly(run) && run.apex.some(Number.isNaN)));

function outcomeOf(soft, hard, c) {
  const [s, h] = [pairOutcome(soft, c), pairOutcome(hard, c)];
  return { pair: c, soft: s, hard: h, ongoing: Boolean(s.last && (s.last.ongoing || Number.isNaN(s.last.end))) };
}

// Per body: the velocity with which it leaves its last contact, and how high it rises; NaN where the run did not get there.
function finals(run) {
  const none = isEarly(run), u = leavingVelocities(run);
  return u.map((velocity, i) => ({ velocity: none ? NaN : velocity, rise: none ? NaN : run.apex[i] }));
}
