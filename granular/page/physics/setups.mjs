// What the page can run: three scenes with their sliders, presets, and the one number by which the engines are compared.
import { quantity } from "../shell/format.mjs";
import { pairOutcome } from "./measures.mjs";
import { effectiveRestitution } from "./outcome.mjs";
import { ballStack, newtonsCradle, threeBalls } from "./scenes.mjs";

const EPS = { name: "eps", symbol: "ε", label: "restitution", unit: "", min: 0.1, max: 1, scale: "linear" };
const GAP = { name: "gap", symbol: "Δh", label: "gap between balls", unit: "m", min: 1e-7, max: 1e-2, scale: "log", zero: true };
const K = { name: "k", symbol: "k", label: "stiffness", unit: "N/m", min: 1e5, max: 1e9, scale: "log" };
const HEIGHT = { name: "height", symbol: "h", label: "drop height", unit: "m", min: 0.15, max: 2, scale: "linear" };
const COUNT = { name: "n", symbol: "N", label: "number of balls", unit: "", min: 2, max: 8, scale: "whole" };

const ONE = "; this is one ball, the verdict judges all";
const lastOf = (run) => run.scene.mass.length - 1;
const exit = (run) => {
  const last = run.contacts.filter((c) => c.pair === lastOf(run) - 1 && !Number.isNaN(c.end)).pop();
  return last ? last.vOut[1] : run.scene.velocity[lastOf(run)];
};

export const SETUPS = {
  "three-balls": {
    title: "Two balls and the floor", make: threeBalls,
    sliders: [GAP, EPS, { name: "ratio", symbol: "R₁/R₂", label: "radius ratio", unit: "", min: 0.5, max: 50, scale: "log" }, K,
      { ...HEIGHT, label: "height of the lower ball’s centre", symbol: "z₁" }],
    presets: {
      "the paper": { eps: 0.7, gap: 1e-4, ratio: 10, k: 5e7, height: 0.6 }, elastic: { eps: 1 }, soft: { k: 5e5 },
      "far apart": { gap: 1e-2 }, touching: { gap: 0 },
    },
    measure: (eps) => (run) => effectiveRestitution(pairOutcome(run, 1).speed, run.scene.impact) / eps,
    measureName: "ε_eff / ε", question: "How fast will the two balls part, in units of the impact speed?",
    asked: (run) => pairOutcome(run, 1).speed / run.scene.impact, most: 3,
  },
  "ball-stack": {
    title: "Kerwin’s stack", make: ballStack,
    sliders: [GAP, EPS, COUNT, { name: "massRatio", symbol: "μ", label: "mass ratio to the ball below", unit: "", min: 0.1, max: 1, scale: "log" },
      K, HEIGHT],
    presets: {
      "light on heavy": { eps: 0.9, gap: 1e-4, n: 3, massRatio: 0.1, k: 5e7, height: 1 }, elastic: { eps: 1 }, soft: { k: 5e5 },
      "far apart": { gap: 1e-2 }, touching: { gap: 0 },
    },
    measure: () => (run) => exit(run) / run.scene.impact,
    measureName: "launch / impact speed", one: ONE, question: "How fast will the top ball leave, in units of the impact speed?",
    asked: (run) => exit(run) / run.scene.impact, most: 12,
  },
  "newtons-cradle": {
    title: "Newton’s cradle", make: newtonsCradle,
    sliders: [GAP, EPS, { ...COUNT, max: 9 }, { name: "moving", symbol: "M", label: "balls that arrive", unit: "", min: 1, max: 8, scale: "whole" },
      K, { name: "speed", symbol: "v", label: "arrival speed", unit: "m/s", min: 0.1, max: 3, scale: "linear" }],
    presets: {
      "almost touching": { eps: 0.95, gap: 1e-6, n: 5, moving: 1, k: 5e7, speed: 1 }, elastic: { eps: 1 }, soft: { k: 5e5 },
      "far apart": { gap: 1e-2 }, touching: { gap: 0, eps: 1 },
    },
    measure: () => (run) => exit(run) / run.scene.impact,
    measureName: "last ball / arrival speed", one: ONE, question: "How fast will the last ball leave, in units of the arrival speed?",
    asked: (run) => exit(run) / run.scene.impact, most: 2,
  },
};

// What was asked for and cannot be: in words.
export function refused(name, given) {
  const values = cleaned(name, given);
  return SETUPS[name].sliders.flatMap(({ name: key, symbol, unit, min, max, zero }) => {
    const asked = given[key], x = Number(asked ?? NaN), wide = 1e-9 * Math.abs(x);
    if (asked === undefined || (zero && x === 0) || (asked !== "" && x >= min - wide && x <= max + wide && Math.abs(values[key] - x) <= wide)) return [];
    const range = `${zero ? "0 or " : ""}${quantity(min, unit)} to ${quantity(max, unit)}`;
    return [`${symbol} cannot be ${asked || "nothing"} here (${range}): ${quantity(values[key], unit)} is shown.`];
  });
}

// Values of every slider, within its range; unknown names are dropped, missing ones are those of the first preset.
export function cleaned(name, given) {
  const setup = SETUPS[name], values = { ...Object.values(setup.presets)[0] };
  for (const { name: key, min, max, scale, zero } of setup.sliders) {
    const x = Number(given[key] ?? NaN);
    if (Number.isNaN(x)) continue;
    values[key] = zero && x < min / 2 ? 0 : Math.min(max, Math.max(min, scale === "whole" ? Math.round(x) : x));
  }
  if ("moving" in values) values.moving = Math.min(values.moving, values.n - 1);
  return values;
}

export function sceneOf(name, values) {
  return SETUPS[name].make(values);
}
