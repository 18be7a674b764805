// One golden case: what disagrees between the page and the Python engines, in words; empty if nothing.
import { Camera } from "../../../granular/app/page/live/camera.mjs";
import { filmOf } from "../../../granular/app/page/physics/film.mjs";
import { isEarly, leavingVelocities } from "../../../granular/app/page/physics/measures.mjs";
import { AT_LEISURE, compareEngines } from "../../../granular/app/page/physics/outcome.mjs";
import { reachOf } from "../../../granular/app/page/physics/reason.mjs";
import { contactsIn, sceneOf } from "../../../granular/app/page/physics/setups.mjs";

// What slow balls have left to go is known as well as elsewhere; when they meet is not.
const TOLERANCE = 1e-9, STUCK = 1e-6; // hard spheres that have all but collapsed stick in another order

// `follow`: how patiently rises are sought; those that are not decided are counted in `undecided`.
export const undecided = [];

export function check({ scene: name, values, ties, answer, kind, said, error, leaves = null, counts, soft, hard }, follow = 3000) {
  const scene = sceneOf(name, values), { eps, k } = contactsIn(name, values), patience = { ...AT_LEISURE, follow }, report = compareEngines(scene, eps, k, { ties, patience });
  const runs = [["soft", soft], ["hard", hard]].flatMap(([engine, golden]) => compare(engine, report[engine], golden, scene));
  const found = `${report.pairs.map((p) => [p.soft, p.hard])}`, other = counts && found !== `${counts}` ? [`counts ${found}, not ${counts}`] : [];
  return [...runs, ...other, ...judged(report, answer, kind, said, error), ...departs(report, leaves), ...(follow > 0 ? endsWrong(report) : [])];
}

// What the last picture of the film shows otherwise than the rises say: heights are read off it in pixels, from where a ball
// stands to its lowest point.
export function endsWrong(report) {
  const film = filmOf(report), { scene } = report, { time } = film.at(film.length);
  if (!film.isFilm) return [];
  const most = Math.max(scene.drop, ...["hard", "soft"].flatMap((engine) => report.finals[engine].map((f) => f.rise)).filter(Number.isFinite));
  const camera = new Camera({ scene, wide: 320, tall: 480, most, reach: reachOf(report) }), [scale] = camera.scales(0);
  return ["hard", "soft"].flatMap((engine) => camera.place(film.heights(engine, time), 0).flatMap(({ low, zero }, i) => {
    const { rise } = report.finals[engine][i], shown = Math.max(0, low - zero) / scale;
    const isRight = i === 0 || Number.isNaN(rise) || (film.isUp(engine, i, time) && Math.abs(shown - rise) < 1e-9 * Math.max(1, rise));
    return isRight ? [] : [`${engine}: the film ends with ball ${i} at ${shown}, it rises ${rise}`];
  }));
}

function judged(report, answer, kind, said, error) {
  const faults = [], { verdict } = report, precision = report.first.status === "collapse" ? STUCK : TOLERANCE;
  if (kind !== null && `${[report.answer, report.kind]}` !== `${[answer, kind]}`) faults.push(`verdict: ${report.kind} (${JSON.stringify(verdict)}), not ${kind}`);
  else if (kind === "counts" && `${[verdict.of, verdict.n, verdict.hard]}` !== `${said}`) faults.push(`${JSON.stringify(verdict)}, not ${said}`);
  else if (kind === "forever" && said !== null && `${verdict.n}` !== `${said}`) faults.push(`${verdict.n} contacts, not ${said}`);
  const bound = verdict.within?.bound ?? report.error; // said of a yes: one digit, no smaller than the error
  if (bound < report.error * (1 - 1e-12) || bound > 2 * report.error || `${bound.toPrecision(1) * 1}` !== `${bound.toPrecision(12) * 1}` && verdict.within?.bound) faults.push(`error ${report.error}, said ${bound}`);
  if (error !== null && !(Math.abs(report.error - error) < precision * Math.max(1, error))) faults.push(`error ${report.error}, not ${error}`);
  return faults;
}

// The ball that decides, and the velocities with which it leaves; of mirror images, which are off alike, either.
function departs({ leaves: { apart, ball, soft, hard }, error, unit, scene: { impact } }, golden) {
  if (!golden) return [];
  const [other, u, v] = golden, pairs = ball === other ? [[soft, u], [hard, v]] : [[Math.abs(soft - hard), Math.abs(u - v)]];
  const isSame = apart / unit === error && pairs.every(([x, y]) => Math.abs(x - y) < TOLERANCE * impact);
  return isSame ? [] : [`ball ${ball} leaves at ${[soft, hard]}, not ${golden}`];
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
  const latest = run.contacts.find((c) => [c.begin, c.end].includes(last)), closing = (latest.vIn[0] - latest.vIn[1]) / impact;
  if (!(Math.abs(last - golden.span) * Math.min(1, closing) < TOLERANCE)) faults.push(`${engine}: last contact at ${last}, not ${golden.span}`);
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
