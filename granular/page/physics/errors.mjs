// How far two runs are apart that are levelled: the unit U, the error, and what rests (granular/outcome.py). In the scenes
// of the page all balls that collide are one component.
import { approach, counts, differences, isOver, largest, ofPair, pairOutcome, partingOf, lasted, SAME } from "./measures.mjs";
import { AFTERWARDS } from "./level.mjs";
import { settledDepths } from "./soft.mjs";
import { pairsOf } from "./scenes.mjs";
import { abs, max, min } from "./numbers.mjs";

const orZero = (x) => (Number.isNaN(x) ? 0 : x);

export function errorsOf(hard, soft, eps, k) {
  const { scene } = hard, met = counts(hard).map((n, c) => n + counts(soft)[c] > 0);
  const span = lasted(soft), weight = largest(pairsOf(scene, eps, k).filter((_, c) => met[c]).map((p) => scene.gravity * min(p.duration, span)));
  const unit = unitOf([...hard.contacts, ...soft.contacts], weight), { balls, pairs } = differences(hard, soft);
  const resting = new Map(scene.gap.flatMap((_, c) => restApart(hard, soft, c, weight)));
  for (const [c, apart] of resting) pairs[c] = apart;
  const [n, m] = [counts(hard), counts(soft)], wrong = scene.gap.map((_, c) => c).filter((c) => n[c] !== m[c] && !resting.has(c));
  return { unit, error: met.includes(true) ? largest([...balls, ...pairs]) / unit : 0, wrong, sunk: sunkIn(soft, weight, pairsOf(scene, eps, k)) };
}

// The largest closing speed; of a contact that begins at rest, the speed with which it parts. At least g t_c, the speed that
// weight gives, and more than rounding.
function unitOf(contacts, weight) {
  const speeds = contacts.map((c) => (approach(c) > 0 ? approach(c) : orZero(partingOf(c))));
  return max(weight, largest(speeds), 1e-13 * largest(contacts.flatMap((c) => c.vIn.map(abs))));
}

// A pair at rest, in a soft contact without end or as hard spheres that stick: how far all its contacts are apart. Those
// before it part alike; it begins alike in both; what one run still has from there on begins no faster, and leaves the pair
// at rest too. Where both rest, contacts that close at no more than `weight` in both are those of balls that settle.
function restApart(hard, soft, c, weight) {
  const [h, s] = [hard, soft].map((run) => pairOutcome(run, c)), never = s.contacts > 0 && !isOver(s.last);
  if (!never && !(abs(h.speed) <= hard.sticks && h.contacts < s.contacts)) return [];
  const [one, other] = (never ? [soft, hard] : [hard, soft]).map((run) => ofPair(run, c)), k = one.length - 1, last = other.at(-1);
  const still = last ? !(abs(partingOf(last)) > hard.sticks) : hard.gap[c] === 0, rest = approach(one[k]);
  const apart = [...Array(max(k + 1, other.length))].map((_, i) => {
    const [a, b] = [one[i], other[i]], by = i < k ? partingOf : approach;
    if (still && largest([a, b].filter(Boolean).map(approach)) <= weight) return 0;
    if (a && b) return abs(by(a) - by(b));
    return b ? approach(b) - rest : max(abs(by(a)), approach(a));
  });
  return [[c, largest([...apart, last ? abs(orZero(partingOf(last))) : 0])]];
}

// By how much of the smaller radius soft balls at rest sink under their weight: to where a contact bears the balls above it,
// ξ = Σ m g / k, or as deep as one that began slowly has been. Balls that are proved to rest have yet to settle, and no deeper
// than twice that: where it can be too much, they are followed.
function sunkIn(soft, weight, pairs) {
  const { scene, contacts, overlap, status } = soft;
  if (scene.gravity === 0) return 0;
  const side = (i) => scene.radius[i] || Infinity, size = ({ pair }) => min(side(pair), side(pair + 1));
  const bears = ({ pair }) => (scene.gravity * scene.mass.slice(pair + 1).reduce((sum, m) => sum + m, 0)) / pairs[pair].k;
  const rests = status === "resting", open = contacts.filter((c) => !isOver(c)), isNear = rests && open.some((c) => 2 * bears(c) > SAME * size(c));
  const sunk = isNear ? settledDepths(soft, soft.time + AFTERWARDS * largest(open.map((c) => pairs[c.pair].duration))) : [];
  const soFar = (c) => (approach(c) <= weight ? max(c.deepest, sunk[c.pair] ?? 0) : rests ? 0 : overlap[c.pair]);
  return largest(open.map((c) => max(soFar(c), rests ? bears(c) : 0) / size(c)));
}
