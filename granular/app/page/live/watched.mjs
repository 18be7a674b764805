// The pair that is looked at closely: of those between balls the one that soft spheres make touch most often, the upper
// of equals. With it the distance in m that shows all of its hops, and its distances in time.
import { hardGaps, softGaps } from "../physics/traces.mjs";
import { max, min } from "../physics/numbers.mjs";

const FRAMES = 240;

export function watchedPair(report, span) {
  const { scene, pairs, soft, hard } = report;
  if (scene.gap.length < 2 && scene.gravity > 0) return null;
  const between = pairs.filter(({ pair }) => scene.gravity === 0 || pair > 0);
  const { pair } = between.reduce((most, p) => (p.soft >= most.soft ? p : most));
  const mine = soft.contacts.filter((c) => c.pair === pair), times = timesOf(mine, span);
  const softly = times.map((t) => [t, softGaps(soft, t)[pair]]), hardly = times.map((t) => [t, hardGaps(hard, t)[pair]]);
  const hops = hopsOf(mine, softly), depth = softly.reduce((most, [, y]) => max(most, -y), 0);
  const start = softly[0]?.[1] ?? 0, range = max(...hops.map((hop) => hop.height), 0.6 * depth, hops.length ? 0 : start, 1e-9);
  return { pair, least: 1e-12 * min(...scene.radius.slice(pair, pair + 2).filter(Boolean)), soft: softly, hard: hardly, hops, depth, range, touches: mine.map((c) => c.begin) };
}

function timesOf(contacts, [begin, end]) {
  const even = Array.from({ length: FRAMES + 1 }, (_, i) => begin + (i / FRAMES) * (end - begin));
  const ends = contacts.slice(0, 40).flatMap((c) => [c.begin, c.end, 0.5 * (c.begin + c.end)]).filter((t) => t > begin && t < end);
  return [...even, ...ends].sort((a, b) => a - b);
}

// The highest point between one contact and the next.
function hopsOf(contacts, path) {
  return contacts.slice(1).flatMap((next, i) => {
    const inside = path.filter(([t]) => t > contacts[i].end && t < next.begin);
    const [time, height] = inside.reduce((most, one) => (one[1] > most[1] ? one : most), [NaN, 0]);
    return height > 0 ? [{ time, height }] : [];
  });
}
