// How far two runs are apart that are levelled: the unit U, the error, and balls at rest (granular/comparison/numbers.py). In
// the scenes of the page all balls that collide are one component.
import { largestDeparture } from "./departures.mjs";
import { approach, isOver, largest, ofPair, partingOf, lasted, SAME } from "./measures.mjs";
import { AFTERWARDS } from "./level.mjs";
import { settledDepths } from "./soft.mjs";
import { pairsOf } from "./scenes.mjs";
import { abs, max, min, sum } from "./numbers.mjs";

export function errorsOf(hard, soft, eps, k, lag) {
  const { scene } = hard, alone = pairsOf(scene, eps, k), logs = scene.gap.map((_, c) => [soft, hard].map((run) => ofPair(run, c)));
  const pairs = logs.map(([s, h], pair) => ({ pair, soft: s.length, hard: h.length })), span = lasted(soft);
  const weight = largest(alone.filter((_, c) => logs[c].flat().length).map((p) => scene.gravity * min(p.duration, span)));
  const unit = unitOf([...hard.contacts, ...soft.contacts], weight), rests = logs.map((both, c) => restOf(hard, c, both, weight));
  const leaves = largestDeparture(scene, logs, rests, lag), error = largest([leaves, ...rests].map(({ apart }) => apart / unit));
  const wrong = pairs.filter((p) => p.soft !== p.hard && !rests[p.pair].settles);
  return { unit, weight, error, pairs, wrong, leaves, sunk: sunkIn(soft, weight, alone) };
}

// The largest closing speed; of a contact that begins at rest, the speed with which it parts. At least g t_c, the speed that
// weight gives, and more than rounding.
function unitOf(contacts, weight) {
  const speeds = contacts.map((c) => (approach(c) > 0 ? approach(c) : partingOf(c)));
  return max(weight, largest(speeds), 1e-13 * largest(contacts.flatMap((c) => c.vIn.map(abs))));
}

// A pair at rest, in a soft contact without end or as hard spheres that stick. A contact before it that the other run lacks
// counts in full; it begins alike in both; what one run still has from there on begins no faster, and leaves the pair at rest
// too. Where both rest, contacts that close at no more than `weight` in both are those of balls that settle.
function restOf(hard, c, [s, h], weight) {
  const never = !isOver(s.at(-1) ?? {});
  if (!never && !(h.length && h.length < s.length && partingOf(h.at(-1)) <= hard.sticks)) return {};
  const [one, other] = never ? [s, h] : [h, s], k = one.length - 1, last = other.at(-1), rest = approach(one[k]);
  const still = last ? partingOf(last) <= hard.sticks : hard.gap[c] === 0;
  const settles = (i) => still && largest([one[i], other[i]].filter(Boolean).map(approach)) <= weight;
  const apart = [...Array(max(k + 1, other.length))].map((_, i) => {
    const [a, b] = [one[i], other[i]];
    if (settles(i) || (b && i < k)) return 0;
    return b ? (a ? abs(approach(b) - rest) : approach(b) - rest) : max(partingOf(a), approach(a));
  });
  return { settles, apart: largest([...apart, last ? partingOf(last) : 0]) };
}

// By how much of the smaller radius soft balls at rest sink under their weight: to where a contact bears the balls above it,
// ξ = Σ m g / k, or as deep as one that began slowly has been. Balls that are proved to rest have yet to settle, and no deeper
// than twice that: where it can be too much, they are followed.
function sunkIn(soft, weight, pairs) {
  const { scene, contacts, overlap, status } = soft;
  if (scene.gravity === 0) return 0;
  const side = (i) => scene.radius[i] || Infinity, size = ({ pair }) => min(side(pair), side(pair + 1));
  const bears = ({ pair }) => (scene.gravity * sum(scene.mass.slice(pair + 1))) / pairs[pair].k;
  const rests = status === "resting", open = contacts.filter((c) => !isOver(c)), isNear = rests && open.some((c) => 2 * bears(c) > SAME * size(c));
  const sunk = isNear ? settledDepths(soft, soft.time + AFTERWARDS * largest(open.map((c) => pairs[c.pair].duration))) : [];
  const soFar = (c) => (approach(c) <= weight ? max(c.deepest, sunk[c.pair] ?? 0) : rests ? 0 : overlap[c.pair]);
  return largest(open.map((c) => max(soFar(c), rests ? bears(c) : 0) / size(c)));
}
