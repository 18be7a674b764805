// How high each ball rises: its first apex in free flight after it has been touched, all hits before that included.
//
// A run that stops earlier is carried on, hard and soft alike. The height a ball has in mind when the run stops is no
// outcome: the ball below may be about to hit it again. A ball that comes to rest instead rises 0; one for which it cannot
// be told within the patience of the engine has NaN. Heights have the radii taken out, and overlaps count as 0. `apexAt` is
// when it is there.
import { max } from "./numbers.mjs";

export const startApexes = (scene) => ({
  apex: scene.mass.map((m) => (m === Infinity ? 0 : NaN)), apexAt: scene.mass.map(() => NaN), touched: scene.mass.map(() => false),
});

// Pair c touches; the lowest has touched so often. In a scene that asks for later bounces the first do not count.
export function noteTouch({ scene, touched }, c, floors) {
  if (floors >= (scene.bounces ?? 0)) touched[c] = touched[c + 1] = true;
}

// Balls fly freely for dt, from velocities (and heights, if they are needed) that are asked for.
export function noteApexes(run, dt, velocityOf, heightsNow, isFree = () => true) {
  const { gravity } = run.scene;
  for (let i = 1; i < run.apex.length; i++) {
    if (!run.touched[i] || !Number.isNaN(run.apex[i]) || !isFree(i)) continue;
    const v = velocityOf(i);
    if (!(v > 0 && v <= gravity * dt)) continue;
    run.apex[i] = max(0, heightsNow()[i] + (v * v) / (2 * gravity));
    run.apexAt[i] = run.t + v / gravity;
  }
}

export function comesToRest(run, i) {
  if (Number.isNaN(run.apex[i])) [run.apex[i], run.apexAt[i]] = [0, run.t];
}
