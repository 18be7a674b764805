// Ready-made scenes, as in granular/cases/scenes.py: bodies bottom to top (left to right), a floor is a body of infinite mass.
import { dampingRatio, duration } from "./dashpot.mjs";
import { abs, max, min, sqrt } from "./numbers.mjs";

const DENSITY = 900, STEEL = 7800, GRAVITY = 9.81;
const radiusOf = (mass, density) => Math.cbrt((mass * 0.75) / (Math.PI * density));
const massOf = (radius, density) => (4 / 3) * Math.PI * density * radius ** 3;

// Two balls, one above the other, dropped on a floor (Müller & Pöschel 2011).
export function threeBalls({ ratio = 10, gap = 1e-4, height = 0.6, lower = 0.1 }) {
  const radius = [lower, lower / ratio];
  return aboveFloor(radius.map((r) => massOf(r, DENSITY)), radius, height - lower, gap, { pair: 0, nth: 2 });
}

// A stack of balls, lighter and lighter, dropped on a floor (Harter, Kerwin).
export function ballStack({ n = 3, massRatio = 0.1, gap = 1e-4, height = 1 }) {
  const mass = Array.from({ length: n }, (_, i) => massRatio ** i);
  return aboveFloor(mass, mass.map((m) => radiusOf(m, DENSITY)), height, gap, "separated");
}

// One ball of a given mass on a floor, for three bounces.
export function bouncingBall({ m1, r1, height }) {
  return aboveFloor([m1], [r1], height, 0, { pair: 0, nth: 4 });
}

// Two balls of given masses and radii; the next bounces on the floor, if they are asked for, are part of the run, and
// heights count from the last of them on.
export function realBalls({ m1, r1, m2, r2, gap, height, bounces }) {
  return { ...aboveFloor([m1, m2], [r1, r2], height, gap, { pair: 0, nth: bounces + 1 }), bounces };
}

// Equal balls in a row, some of which arrive from the left.
export function newtonsCradle({ n = 5, moving = 1, gap = 0, speed = 1 }) {
  const mass = Array(n).fill(1);
  return {
    mass, radius: mass.map((m) => radiusOf(m, STEEL)), gap: Array(n - 1).fill(gap), gravity: 0,
    velocity: mass.map((_, i) => (i < moving ? speed : 0)), until: "separated", tEnd: Infinity, impact: speed,
  };
}

function aboveFloor(mass, radius, drop, gap, until) {
  const n = mass.length, impact = sqrt(2 * GRAVITY * drop);
  return {
    mass: [Infinity, ...mass], radius: [0, ...radius], gap: [drop, ...Array(n - 1).fill(gap)],
    velocity: Array(n + 1).fill(0), gravity: GRAVITY, until, tEnd: (10 * impact) / GRAVITY, impact, drop, bounces: 1,
  };
}

// One number for all pairs, or one per pair from the bottom up.
const each = (value, c) => (Array.isArray(value) ? value[c] : value);

// Per pair: stiffness, damping of its restitution, shares of the bodies, gravity's closing acceleration of the gap.
export function pairsOf(scene, restitution, stiffness) {
  return scene.gap.map((gap, c) => {
    const [eps, k] = [each(restitution, c), each(stiffness, c)], zeta = dampingRatio(eps);
    const [m1, m2] = [scene.mass[c], scene.mass[c + 1]], light = min(m1, m2), heavy = max(m1, m2);
    const mEff = light / (1 + light / heavy), small = light / heavy / (1 + light / heavy);
    const [low, high] = m1 >= m2 ? [small, 1 - small] : [1 - small, small];
    return {
      gap, rate: scene.velocity[c + 1] - scene.velocity[c], lower: 1 / m1, upper: 1 / m2, mEff, low, high, k, eps,
      gamma: 2 * zeta * sqrt(k * mEff), duration: duration(zeta) * sqrt(mEff / k),
      pull: scene.gravity * ((m2 === Infinity ? 0 : 1) - (m1 === Infinity ? 0 : 1)),
    };
  });
}

// Elastic balls are left with relative speeds of 1e-16 of theirs, and meet again after 1e12 s: that is rounding.
export const ROUNDING = 1e-12;
export const isElastic = (pairs) => pairs.every((p) => p.eps === 1);
export const isNoise = ({ scene, elastic }, rate) => elastic && abs(rate) <= ROUNDING * scene.impact;

// Velocities of the bodies from the rates of the gaps: counted from the floor, or from the centre of mass.
export function velocities(scene, rates) {
  const v = [0];
  for (const rate of rates) v.push(v[v.length - 1] + rate);
  if (scene.mass[0] === Infinity) return v;
  const shift = meanOf(scene, scene.velocity) - meanOf(scene, v);
  return v.map((x) => x + shift);
}

// Heights of the bodies with the radii taken out, a time t after the start.
export function heights(scene, gaps, t) {
  const x = [0];
  for (const gap of gaps) x.push(x[x.length - 1] + gap);
  if (scene.mass[0] === Infinity) return x;
  const start = [0];
  for (const gap of scene.gap) start.push(start[start.length - 1] + gap);
  const shift = meanOf(scene, start) + meanOf(scene, scene.velocity) * t - meanOf(scene, x);
  return x.map((y) => y + shift);
}

function meanOf(scene, values) {
  let sum = 0, total = 0;
  scene.mass.forEach((m, i) => {
    sum += m * values[i];
    total += m;
  });
  return sum / total;
}
