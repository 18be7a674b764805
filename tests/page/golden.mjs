// One golden case: what disagrees between the page's engines and the Python engines, in words; empty if nothing.
import { simulateHard } from "../../granular/page/physics/hard.mjs";
import { ballStack, newtonsCradle, threeBalls } from "../../granular/page/physics/scenes.mjs";
import { simulateSoft } from "../../granular/page/physics/soft.mjs";

const SCENES = { "three-balls": threeBalls, "ball-stack": ballStack, "newtons-cradle": newtonsCradle };
const TOLERANCE = 1e-9;

export function check({ scene: name, options, eps, k, ties, soft, hard }) {
  const scene = SCENES[name](options);
  const faults = compare("soft", simulateSoft(scene, eps, k, { maxSteps: 1e6 }), soft, scene.impact);
  if (hard.status === "zoomed") return faults;
  return [...faults, ...compare("hard", simulateHard(scene, eps, { ties }), hard, scene.impact)];
}

function compare(engine, run, golden, speed) {
  if (run.status !== golden.status) return [`${engine}: ${run.status}, not ${golden.status}`];
  const sequence = run.contacts.map((c) => c.pair).join("");
  if (!isSameOrder(sequence, golden.sequence)) return [`${engine}: contacts ${sequence}, not ${golden.sequence}`];
  const worst = Math.max(...run.velocity.map((v, i) => Math.abs(v - golden.velocity[i]))) / speed;
  return worst < TOLERANCE ? [] : [`${engine}: velocities off by ${worst}`];
}

// Contacts of pairs that share no ball commute: symmetric scenes have them at one time, in an order made by rounding.
function isSameOrder(a, b) {
  if (a === b) return true;
  const only = (sequence, c) => [...sequence].filter((x) => x === `${c}` || x === `${c + 1}`).join("");
  return a.length === b.length && [...Array(9).keys()].every((c) => only(a, c) === only(b, c));
}
