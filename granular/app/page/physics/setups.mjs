// What the page can run: five scenes with their sliders and presets, their contacts, and what is asked of a guess.
import { aloneOf, contactsOf } from "./balls.mjs";
import { isEarly, riseIn } from "./measures.mjs";
import { ballStack, bouncingBall, newtonsCradle, realBalls, threeBalls } from "./scenes.mjs";
import { abs, round } from "./numbers.mjs";

const EPS = { name: "eps", symbol: "ε", label: "restitution", min: 0.1, max: 1 };
const GAP = { name: "gap", symbol: "Δh", label: "gap", unit: "m", min: 1e-7, max: 0.1, scale: "log", zero: true };
const K = { name: "k", symbol: "k", label: "stiffness", unit: "N/m", min: 4e3, max: 1e9, scale: "log" };
const HEIGHT = { name: "height", symbol: "h", label: "drop", unit: "m", min: 0.15, max: 2 };
const COUNT = { name: "n", symbol: "N", label: "count", min: 2, max: 8, scale: "whole" };

// Mass, radius, contact time on the floor, restitution, and whether it is filled with air, of ball i.
const ballSliders = (i, group) => [
  { name: `m${i}`, symbol: "m", label: "mass", unit: "kg", min: 1e-3, max: 2, scale: "log", group },
  { name: `r${i}`, symbol: "R", label: "radius", unit: "m", min: 2e-3, max: 0.15, scale: "log", group },
  { name: `t${i}`, symbol: "t_c", label: "time", unit: "s", min: 1e-5, max: 0.03, scale: "log", group },
  { name: `e${i}`, symbol: "ε", label: "restitution", min: 0.1, max: 1, group },
];
const air = (i, group) => ({ name: `air${i}`, label: "air", min: 0, max: 1, scale: "choice", options: ["no", "yes"], group });
const RULE = { name: "rule", label: "rule", min: 0, max: 1, scale: "choice", options: ["rule-lens", "rule-series"] };
const BOUNCES = { name: "bounces", label: "bounces", min: 1, max: 2, scale: "choice", options: ["first", "second"] };

const lastOf = (run) => run.scene.mass.length - 1;
const exit = (run) => {
  const last = run.contacts.filter((c) => c.pair === lastOf(run) - 1 && !Number.isNaN(c.end)).pop();
  return last ? last.vOut[1] : run.scene.velocity[lastOf(run)];
};
const uniform = ({ eps, k }) => ({ eps, k });
const inDrops = (run) => riseIn(run, lastOf(run)) / run.scene.drop;
const inArrivals = (run) => (isEarly(run) ? NaN : exit(run) / run.scene.impact);
const FALL = { measure: inDrops, measured: "in-drops", most: 10 };

const CHANGES = { elastic: { eps: 1 }, soft: { k: 5e5 }, apart: { gap: 1e-2 }, touching: { gap: 0 } }; // of the first preset of a scene

// Presets of real balls are `offer`ed from the data of granular/cases/balls.py.
export const SETUPS = {
  "real-balls": {
    make: realBalls, contacts: contactsOf, sliders: [GAP, HEIGHT, RULE, BOUNCES, ...ballSliders(2, "upper"), air(2, "upper"), ...ballSliders(1, "lower"), air(1, "lower")],
    presets: {}, ...FALL,
  },
  "three-balls": {
    make: threeBalls, contacts: uniform,
    sliders: [GAP, EPS, { name: "ratio", symbol: "R₁/R₂", label: "ratio", min: 0.5, max: 50, scale: "log" }, K, { ...HEIGHT, label: "centre", symbol: "z₁" }],
    presets: {
      paper: { eps: 0.7, gap: 1e-4, ratio: 10, k: 5e7, height: 0.6 }, ...CHANGES,
    },
    ...FALL,
  },
  "ball-stack": {
    make: ballStack, contacts: uniform,
    sliders: [GAP, EPS, COUNT, { name: "massRatio", symbol: "μ", label: "mass-ratio", min: 0.1, max: 1, scale: "log" }, K, HEIGHT],
    presets: {
      light: { eps: 0.9, gap: 1e-4, n: 3, massRatio: 0.1, k: 5e7, height: 1 }, ...CHANGES,
    },
    ...FALL, most: 60,
  },
  "newtons-cradle": {
    make: newtonsCradle, contacts: uniform,
    sliders: [GAP, EPS, { ...COUNT, max: 9 }, { name: "moving", symbol: "M", label: "arriving", min: 1, max: 8, scale: "whole" },
      K, { name: "speed", symbol: "v", label: "arrival-speed", unit: "m/s", min: 0.1, max: 3 }],
    presets: {
      almost: { eps: 0.95, gap: 1e-6, n: 5, moving: 1, k: 5e7, speed: 1 }, ...CHANGES,
      touching: { gap: 0, eps: 1 },
    },
    measure: inArrivals, measured: "in-arrivals", most: 2,
  },
  "bouncing-ball": {
    make: bouncingBall, contacts: aloneOf, sliders: [HEIGHT, ...ballSliders(1, "")],
    presets: {}, ...FALL, most: 1,
  },
};
export const FIRST = "three-balls"; // what a link without a scene means

export const ballValues = ([mass, radius, duration, restitution, filled], i) =>
  ({ [`m${i}`]: mass, [`r${i}`]: radius, [`t${i}`]: duration, [`e${i}`]: restitution, [`air${i}`]: Number(filled) });

const NAMED = { "real-balls": { lower: 1, upper: 2 }, "bouncing-ball": { ball: 1 } }, BALLS = {}; // balls of a link; their values, by names

// The names that a link can have, and the number of the ball.
export const ballKeys = (scene) => NAMED[scene] ?? {};
export const ballNames = () => Object.keys(BALLS);
export const settingsOf = (scene) => SETUPS[scene].sliders.map(({ name }) => name);

const valuesOf = (scene, name, i) => Object.fromEntries(Object.entries(ballValues(BALLS[name], i)).filter(([key]) => settingsOf(scene).includes(key)));

// The name of ball i, if it has one.
export const ballCalled = (scene, values, i) => ballNames().find((name) => Object.entries(valuesOf(scene, name, i)).every(([key, x]) => values[key] === x));

// Numbers in place of the names of balls; numbers that are given as well count.
export function withoutNames(scene, given) {
  const known = Object.entries(ballKeys(scene)).filter(([key]) => Object.hasOwn(BALLS, given[key] ?? ""));
  return Object.assign({}, ...known.map(([key, i]) => valuesOf(scene, given[key], i)), given);
}

// What is other than at the start, with the names of balls in place of their numbers.
export function withNames(scene, values, start) {
  const other = Object.fromEntries(Object.entries(values).filter(([key, x]) => x !== start[key]));
  for (const [key, i] of Object.entries(ballKeys(scene))) {
    const name = ballCalled(scene, values, i);
    if (!name || name === ballCalled(scene, start, i)) continue;
    for (const number in ballValues(BALLS[name], i)) delete other[number];
    other[key] = name;
  }
  return other;
}

const GAPS = [], KINDS = []; // from which gap on hard spheres are right, by balls; radii, by names

export function enoughFor(values) {
  return GAPS.find(([both]) => Object.keys(both).every((key) => both[key] === values[key]))?.[1] ?? NaN;
}

export function offer({ balls, pairs }) {
  Object.assign(BALLS, balls);
  for (const [lower, upper, gap] of pairs) {
    const both = { ...ballValues(balls[lower], 1), ...ballValues(balls[upper], 2) };
    SETUPS["real-balls"].presets[`${lower}+${upper}`] = { ...both, gap: 1e-3, height: 1, rule: 0, bounces: 1 };
    GAPS.push([both, gap]);
  }
  for (const name in balls) KINDS.push([balls[name][1], name]);
  for (const name in balls) SETUPS["bouncing-ball"].presets[name] = { ...ballValues(balls[name], 1), height: 1 };
}

// What was asked for and cannot be: the slider, what was asked, and what is shown.
export function refused(name, given) {
  const values = cleaned(name, given);
  return SETUPS[name].sliders.flatMap((slider) => {
    const { name: key, min, zero } = slider, max = key === "moving" ? values.n - 1 : slider.max;
    const asked = given[key], x = Number(asked ?? NaN), wide = 1e-9 * abs(x);
    const isIn = asked !== "" && Number.isFinite(x) && ((zero && x === 0) || (x >= min - wide && x <= max + wide && abs(values[key] - x) <= wide));
    return asked === undefined || isIn ? [] : [{ slider: { ...slider, max }, asked, shown: values[key] }];
  });
}

// Values of every slider, within its range; unknown names are dropped, missing ones are those of the first preset.
export function cleaned(name, given) {
  const setup = SETUPS[name], values = { ...Object.values(setup.presets)[0] };
  for (const { name: key, min, max, scale, zero } of setup.sliders) {
    const x = Number(given[key] ?? NaN);
    if (!Number.isFinite(x) || given[key] === "") continue;
    values[key] = zero && x < min / 2 ? 0 : Math.min(max, Math.max(min, scale === "whole" || scale === "choice" ? round(x) : x));
  }
  if ("moving" in values) values.moving = Math.min(values.moving, values.n - 1);
  return values;
}

// With what its balls are, where they are real ones: told by their radii.
export function sceneOf(name, values) {
  const scene = SETUPS[name].make(values);
  return { ...scene, kinds: scene.radius.map((r) => KINDS.find(([radius]) => abs(r - radius) < 1e-6 * radius)?.[1].replaceAll(" ", "-")) };
}
export const contactsIn = (name, values) => SETUPS[name].contacts(values);
