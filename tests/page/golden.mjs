// One golden case: what disagrees between the page and the Python engines, in words; empty if nothing.
import { isEarly, leavingVelocities } from "../../granular/page/physics/measures.mjs";
import { AT_LEISURE, compareEngines } from "../../granular/page/physics/outcome.mjs";
import { contactsIn, sceneOf } from "../../granular/page/physics/setups.mjs";

const TOLERANCE = 1e-9;

// `follow`: how patiently rises are sought; those that are not decided are counted in `undecided`.
export const undecided = [];

export function check({ scene: name, values, ties, kind, said, error, soft, hard }, follow = 3000) {
  const scene = sceneOf(name, values), { eps, k } = contactsIn(name, values), patience = { ...AT_LEISURE, follow }, report = compareEngines(scene, eps, k, { ties, patience });
  const runs = [["soft", soft], ["hard", hard]].flatMap(([engine, golden]) => compare(engine, report[engine], golden, scene));
  return [...runs, ...judged(report, kind, said, error)];
}

function judged(report, kind, said, error) {
  const faults = [];
  if (kind !== null && report.kind !== kind) faults.push(`verdict: ${report.kind} (${JSON.stringify(report.verdict)}), not ${kind}`);
  if (error !== null && !(Math.abs(report.error - error) < TOLERANCE * Math.max(1, error))) faults.push(`error ${report.error}, not ${error}`);
  if (error !== null && said !== null) {
    const { soft, hard } = report.pairs[said[0]];
    if (`${[soft.contacts, hard.contacts]}` !== `${said.slice(1)}`) faults.push(`pair ${said[0]}: ${soft.contacts} and ${hard.contacts} contacts`);
  }
  return faults;
}

function compare(engine, run, golden, { impact, gravity }) {
  if (golden.status === null) return [];
  const status = isEarly(run) ? "early" : "ended";
  if (status !== golden.status) return [`${engine}: ${status}, not ${golden.status}`];
  if (golden.velocity === null) return [];
  const sequence = run.contacts.map((c) => c.pair).join("");
  if (!isSameOrder(sequence, golden.sequence)) return [`${engine}: contacts ${sequence}, not ${golden.sequence}`];
  const faults = [], u = leavingVelocities(run), worst = Math.max(...golden.velocity.map((v, i) => (v === null ? (Number.isNaN(u[i]) ? 0 : Infinity) : Math.abs(v - u[i]))));
  if (!(worst < TOLERANCE * impact)) faults.push(`${engine}: velocities off by ${worst}`);
  const last = Math.max(...run.contacts.flatMap((c) => [c.begin, ...(c.ongoing || Number.isNaN(c.end) ? [] : [c.end])]));
  if (!(Math.abs(last - golden.span) < TOLERANCE)) faults.push(`${engine}: last contact at ${last}, not ${golden.span}`);
  const rise = run.apex[run.apex.length - 1];
  if (gravity && golden.rise !== null && Number.isNaN(rise)) undecided.push(engine);
  else if (gravity && golden.rise !== null && !(Math.abs(rise - golden.rise) < 1e-6 * Math.max(1, rise))) faults.push(`${engine}: rises ${rise}, not ${golden.rise}`);
  return faults;
}

// Contacts of pairs that share no ball commute: symmetric scenes have them at one time, in an order made by rounding.
function isSameOrder(a, b) {
  if (a === b) return true;
  const only = (sequence, c) => [...sequence].filter((x) => x === `${c}` || x === `${c + 1}`).join("");
  return a.length === b.length && [...Array(9).keys()].every((c) => only(a, c) === only(b, c));
}
