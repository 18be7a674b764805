// The reason: how much of the push from below happens while the ball above is already pressing.
//
// It explains and does not decide; the error decides. Of all pairs that one is told of whose push overlaps most with that of
// the pair above it. A gap of v t_c makes sure that none do; a smaller one is often enough.
import { pairName } from "./verdict.mjs";
import { pairsOf } from "./scenes.mjs";
import { softForce } from "./traces.mjs";
import { max, min, round } from "./numbers.mjs";

const POINTS = 80;

// Contacts from the bounce on that is asked for.
export function reasonOf({ scene, soft }) {
  const from = soft.contacts.filter((c) => c.pair === 0)[(scene.bounces ?? 1) - 1]?.begin ?? 0;
  const found = scene.gap.slice(1).flatMap((_, pair) => {
    const push = soft.contacts.find((c) => c.pair === pair && c.begin >= from), next = push && soft.contacts.filter((c) => c.pair === pair + 1 && endOf(soft, c) >= push.begin);
    return next?.length ? [{ pair, arrives: next[0].begin - push.begin, ...sharedPush(soft, push, next) }] : [];
  });
  return found.reduce((most, one) => (!most || one.share > most.share ? one : most), null);
}

// In a sentence. At a second bounce, what came before makes the difference.
export function reasonSaid({ scene }, reason) {
  if (scene.bounces > 1 && !(reason?.share > 0)) return { say: "because-earlier" };
  if (!reason) return { say: "because-none" };
  const { pair, lasts, arrives, share } = reason, names = { below: pairName(scene, pair), next: pairName(scene, pair + 1) };
  return { say: share > 0 ? "because-share" : "because-apart", ...names, lasts: [lasts, "s"], arrives: [arrives, "s"], share: shareSaid(share) };
}

// With the digits that matter: 8.4 %, 77 %, 0 %.
export const shareSaid = (share) => ({ say: "percent", n: 100 * share < 10 ? Number((100 * share).toPrecision(2)) : round(100 * share) });

const endOf = (soft, { end }) => (Number.isNaN(end) ? soft.time : end);

// The push in time, [[s since its onset, N]], and the share of its impulse while one of `next` lasts.
function sharedPush(soft, push, next) {
  const end = endOf(soft, push), step = (end - push.begin) / POINTS, curve = [];
  let all = 0, both = 0;
  for (let i = 0; i < POINTS; i++) {
    const t = push.begin + (i + 0.5) * step, force = softForce(soft, push.pair, t);
    curve.push([t - push.begin, force]);
    all += force;
    if (next.some((c) => c.begin <= t && t <= endOf(soft, c))) both += force;
  }
  const parts = next.map((c) => [max(0, c.begin - push.begin), min(end, endOf(soft, c)) - push.begin]).filter(([a, b]) => b > a);
  return { lasts: end - push.begin, curve, parts, share: all > 0 ? both / all : 0 };
}

// The gap beyond which two contacts never overlap: Δh = v t_c of the longest contact that is not the last.
export const safeGap = ({ scene, eps, k }) => (scene.gap.length > 1 ? reachOf({ scene, eps, k }) : NaN);

// How far a ball falls while that lasts.
export function reachOf({ scene, eps, k }) {
  const durations = pairsOf(scene, eps, k).map((p) => p.duration);
  return scene.impact * max(...durations.slice(0, max(1, durations.length - 1)));
}
