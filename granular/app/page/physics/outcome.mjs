// One scene under both engines: what came out, where they part, and the answer in one line (granular/comparison).
import { errorsOf } from "./errors.mjs";
import { findTops, settled, settledRun, simulateHard } from "./hard.mjs";
import { levelled } from "./level.mjs";
import { differences, inBoth, isEarly, isOver, largest, leavingVelocities, ofPair, otherAnswers, ownDifference, riseIn, shifted, stuckDifference } from "./measures.mjs";
import { findApexes, simulateSoft } from "./soft.mjs";
import { max } from "./numbers.mjs";
import { verdict } from "./verdict.mjs";

// Steps of the soft and events of the hard spheres, and both past the stop in search of the apexes: while a slider moves, and when it
// rests and the first were not enough.
export const AT_ONCE = { maxSteps: 800, maxEvents: 1500, follow: 100 };
export const AT_LEISURE = { maxSteps: 60000, maxEvents: 20000, follow: 20000 };

// Both runs with the contacts that count, each followed to its end, and how far they are apart. `first` is the hard run as it
// ended; where that is a collapse, it is judged as it goes on.
export function bothRuns(scene, eps, k, { ties = "left", record = false, maxSteps, maxEvents }) {
  const cut = simulateSoft(scene, eps, k, { record, maxSteps }), first = simulateHard(scene, eps, { ties, record, maxEvents });
  const whole = isEarly(cut) ? first : settled(first, eps, { ties, maxEvents }), isWhole = !isEarly(cut) && !isEarly(whole);
  const [hard, soft, lag = () => 0] = isWhole ? levelled(whole, cut, eps, k) : inBoth(whole, cut);
  const early = isEarly(hard) || isEarly(soft), off = errorsOf(hard, soft, eps, k, lag), error = early ? NaN : off.error;
  const n = isEarly(soft) || whole.status === "collapse" ? 0 : foreverAfter(first, cut, soft);
  return { first, whole, cut, hard, soft, early, ...off, error, forever: n };
}

// Hard spheres that collide forever where soft ones part: after how many contacts; else 0. So much can be told before they stick.
function foreverAfter({ status, group }, cut, soft) {
  const parts = status === "collapse" && group.some((c) => ofPair(soft, c).slice(-1).some(isOver));
  return parts ? cut.contacts.filter(({ pair }) => group.includes(pair)).length : 0;
}

export function compareEngines(scene, eps, k, { ties = "left", patience = AT_LEISURE } = {}) {
  const both = bothRuns(scene, eps, k, { ties, record: true, ...patience }), { first, whole, cut, soft, early, unit, weight } = both;
  findApexes(cut, patience.follow);
  findTops(first, patience.follow);
  const once = (run) => inBoth(run, cut)[0], own = once(whole);
  const hard = first.status === "collapse" ? once(first) : both.hard;
  const others = early ? [] : otherAnswers(whole, eps, ties).map(([name, run]) => [name, isEarly(run) ? NaN : tieError(once(run), own, weight) / unit]);
  const twin = settledRun(shifted(scene), eps, { ties });
  const self = early ? { predictable: NaN, shift: NaN } : ownDifference(own, isEarly(twin) ? own : once(twin), unit);
  const report = { ...both, scene, eps, k, hard, rule: ties, tieErrors: others, unchecked: isEarly(twin) || others.some(([, e]) => Number.isNaN(e)), ...self, finals: { hard: finals(hard), soft: finals(soft) } };
  const judged = verdict({ ...report, patience });
  return { ...report, isHasty: patience === AT_ONCE && isOpen(report), ...judged, otherRise: riseUnder(judged.verdict.worst, report, patience) };
}

// In m/s: of balls that leave, and of pairs that stick.
const tieError = (run, own, weight) => max(largest(differences(run, own)), stuckDifference(run, own, weight));

// How high the top ball rises under another tie rule.
function riseUnder(ties, { scene, eps }, { maxEvents, follow }) {
  if (!ties || !scene.gravity) return NaN;
  const run = simulateHard(scene, eps, { ties, maxEvents });
  findTops(run, follow);
  return riseIn(run, scene.mass.length - 1);
}

const isOpen = ({ scene, early, soft, hard }) => early || (scene.gravity > 0 && [soft, hard].some((run) => !isEarly(run) && run.apex.some(Number.isNaN)));

// Per body: the velocity with which it leaves its last contact, and how high it rises; NaN where the run did not get there.
// What has collapsed has no last contact, but moves on as one.
function finals(run) {
  const u = leavingVelocities(run);
  return u.map((velocity, i) => ({ velocity: isEarly(run) ? NaN : velocity, rise: riseIn(run, i) }));
}
