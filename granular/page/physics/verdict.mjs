// May this scene be event-driven? The answer in one line, with its kind: that of granular/comparison/verdict.py, in fewer words.
import { digits, plural, quantity } from "../shell/format.mjs";
import { RULES } from "./hard.mjs";
import { counts, isEarly, SAME, sameButForTiming, SMALL } from "./measures.mjs";
import { ROUNDING } from "./scenes.mjs";

const PATIENT = 10000; // steps

const pairName = (scene, c) =>
  scene.mass[0] === Infinity ? (c === 0 ? "floor and ball 1" : `balls ${c} and ${c + 1}`) : `balls ${c + 1} and ${c + 2}`;

export function verdict(report) {
  for (const judge of [unfinished, endless, notUnique, unpredictable, countsDiffer, outcomes]) {
    const found = judge(report);
    if (found) return { kind: found[0], verdict: found[1] };
  }
}

// Nothing is claimed of a run that did not get to its end.
function unfinished({ soft, hard, patience }) {
  if (soft.status === "unfinished" && patience.maxSteps < PATIENT) return ["no verdict", "No verdict yet: the soft spheres are stiff and take many steps."];
  if (soft.status === "unfinished") return ["no verdict", "No verdict: too stiff to follow in this page; granular compare runs it."];
  if (!isEarly(hard)) return null;
  return ["no verdict", "No verdict: hard spheres collide ever faster and come to no end (inelastic collapse); soft spheres have "
    + `${plural(soft.contacts.length, "contact")} in all.`];
}

// A soft contact that fills much of the run, or has no end in sight, while the hard spheres have bounced.
function endless({ scene, pairs, soft, hard }) {
  for (const p of pairs) {
    if (!p.ongoing) continue;
    const lasted = soft.time - p.soft.last.begin, still = Number.isNaN(p.soft.speed);
    const parting = Math.max(Math.abs(hard.velocity[p.pair + 1] - hard.velocity[p.pair]), Math.abs(p.hard.speed) || 0);
    if (parting > SAME * scene.impact && (lasted > SMALL * soft.time || still)) {
      return ["lasting", `No: the soft contact of ${pairName(scene, p.pair)} has lasted ${quantity(lasted, "s")} and is not over; hard spheres part at once.`];
    }
  }
  return null;
}

// Balls that touch or collide at once, where tie rules differ: no hard-sphere answer is the right one.
function notUnique({ scene, rule, tieErrors, predictable }) {
  const [error, worst] = tieErrors.reduce((most, [name, e]) => (e > most[0] ? [e, name] : most), [0, ""]);
  if (error > SAME) {
    return ["not uniquely", "Not uniquely: balls that touch have no one hard-sphere answer; here it hangs on the tie rule: "
      + `“${RULES[rule]}” and “${RULES[worst]}” differ by ${digits(error, 2)} of the impact speed.`];
  }
  if (predictable > SAME && scene.gap.includes(0)) {
    return ["not uniquely", "Not uniquely: balls that touch have no one hard-sphere answer; here it hangs on the tie rule."];
  }
  return null;
}

function unpredictable({ predictable, soft }) {
  if (!(predictable > SAME)) return null;
  return ["not ball by ball", `Not ball by ball: beyond prediction, gaps shifted by 10⁻¹² already change the hard spheres; ${digits((100 * soft.shared) / soft.impulse, 2)} % of the impulse is shared.`];
}

// Pairs with other numbers of contacts, unless only the tie rule or the end time decides that.
function countsDiffer(report) {
  const { scene, pairs, soft, hard, eps, k, error } = report, wrong = pairs.filter((p) => p.hard.contacts !== p.soft.contacts);
  if (!wrong.length) return null;
  if (sameButForTiming(soft, hard, eps, k)) return ["timing", `Yes, except for timing: the contacts are the same, yet ${wrong.length} of ${plural(pairs.length, "pair")} have one on the other side of the end.`];
  const p = wrong.reduce((most, one) => (miss(one) >= miss(most) ? one : most));
  const many = wrong.length > 1 ? `${wrong.length} of ${plural(pairs.length, "pair")} differ in contacts; ` : "";
  const said = `${pairName(scene, p.pair)} have ${plural(p.soft.contacts, "contact")}, not ${p.hard.contacts}`;
  if (error > SAME) return ["counts", `No: ${many}${said}${parting(p, report)}.`];
  const same = `outcomes agree ${within(error)}`;
  if (wrong.every((one) => isUnsettled(report, one.pair))) return ["yes, ties", `Yes: ${same}, though ${said}; in which order balls collide that meet at once decides no more than that.`];
  return ["counts", `No: ${many}${said}, though ${same}.`];
}

const miss = (p) => (Number.isNaN(p.soft.speed - p.hard.speed) ? -1 : Math.abs(p.soft.speed - p.hard.speed));

// Whether a pair collides another number of times under another tie rule, or from shifted gaps.
const isUnsettled = ({ hard, twin, ties }, c) => [twin, ...ties.map(([, run]) => run)].some((run) => counts(run)[c] !== counts(hard)[c]);

function parting(p, { scene, error }) {
  if (p.ongoing && Number.isNaN(p.soft.speed)) return ", and are still in contact";
  if (miss(p) > SAME * scene.impact) return `, and part at ${digits(p.soft.speed)} instead of ${digits(p.hard.speed)} m/s`;
  return `, and outcomes are off by ${digits(error, 2)} of the impact speed`;
}

function outcomes({ error, soft }) {
  if (error > SAME) return ["off", `No: outcomes are off by ${digits(error, 2)} of the impact speed.`];
  if (soft.shared > ROUNDING * soft.impulse) return ["yes, overlap", `Yes, ${within(error)}, though contacts overlap in time.`];
  return ["yes", `Yes: every contact is binary, and the outcomes agree ${within(error)}.`];
}

const within = (error) => (error < 1e-12 ? "to rounding" : `within ${digits(error, 1)} of the impact speed`);
