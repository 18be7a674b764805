// Episodes: contacts that belong together, to zoom at and to slow down at.

const MANY = 12, SECONDS = 2.5;

// Spans of time [begin, end] in which contacts follow each other closely; none is longer than a share of the run.
export function episodes(runs, [t0, t1]) {
  const spans = runs.flatMap(({ contacts: c }) => [...c.begin].map((begin, i) => [begin, c.end[i]])).sort((a, b) => a[0] - b[0]), found = [];
  for (const [begin, end] of spans) {
    const last = found[found.length - 1], joins = last && begin <= last[1] + (last[1] - last[0]) && end - last[0] < (t1 - t0) / 10;
    if (joins) last[1] = Math.max(last[1], end);
    else found.push([begin, end]);
  }
  return found;
}

// The span to look at: the episode after (before) time t, with as much again at its sides.
export function nextEpisode(many, t, way, [t0, t1]) {
  const found = way > 0 ? many.find(([begin]) => begin > t) : many.findLast(([, end]) => end < t);
  if (!found) return null;
  const room = 0.4 * Math.max(found[1] - found[0], (t1 - t0) / 500);
  return [Math.max(t0, found[0] - room), Math.min(t1, found[1] + room)];
}

// A few short episodes of soft contacts are slowed down so that each lasts some seconds.
export function slowable(many, [t0, t1]) {
  const lasting = many.filter(([begin, end]) => end > begin), total = lasting.reduce((sum, [begin, end]) => sum + end - begin, 0);
  return lasting.length > 0 && lasting.length <= MANY && total < 0.2 * (t1 - t0) ? lasting.map(([a, b]) => [a - 0.15 * (b - a), b + 0.15 * (b - a)]) : [];
}

// Where the film is some seconds later: slow inside an episode, and none is jumped over. Times in s of the run.
export function later(slow, t, seconds, rate) {
  for (const [begin, end] of slow) {
    const hair = 1e-3 * (end - begin); // lest rounding of t holds it at an edge
    if (t >= end) continue;
    if (t >= begin - hair) return Math.min(end + hair, t + seconds * Math.min(rate, (end - begin) / SECONDS));
    return Math.min(begin, t + seconds * rate);
  }
  return t + seconds * rate;
}
