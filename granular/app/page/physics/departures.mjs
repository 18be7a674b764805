// Episodes of linked contacts, and the velocities with which balls leave them in two runs (granular/comparison/episodes.py).
import { approach, isOver } from "./measures.mjs";
import { abs, max, min } from "./numbers.mjs";

// The ball that leaves an episode with the largest difference in m/s. `logs` are soft and hard contacts by pairs. Contacts
// without end, and those of balls that settle, do not link others. A ball that rests on the floor is compared elsewhere.
export function largestDeparture({ mass, gravity }, logs, rests, lag) {
  let since = mass[0] === Infinity ? -1 : Infinity; // walls are left out
  const held = [since, ...logs.map(([log]) => (since = isOver(log.at(-1) ?? {}) ? Infinity : max(since, log.at(-1).begin)))];
  const rows = logs.flatMap(([log, hits], c) => log.flatMap((one, i) => (isOver(one) && !rests[c].settles?.(i) ? [[one, hits[i]]] : [])));
  const found = episodesOf(rows).flatMap((episode) => mass.flatMap((_, ball) => {
    const [s, h] = [0, 1].map((k) => lastContact(episode.map((row) => row[k]), ball));
    if (!h || s.end > held[ball]) return [];
    const [soft, hard] = [s, h].map(({ vOut, pair }) => vOut[ball - pair]), late = lag(h.pair, approach(h)), d = hard - soft;
    return [{ ball, soft, hard, apart: min(abs(d), abs(d - gravity * max(-late, min(late, s.end - h.end)))) }];
  }));
  return found.sort((a, b) => a.apart - b.apart).at(-1) ?? {};
}

const lastContact = (contacts, ball) => contacts.filter((c) => c && ball - c.pair in c.vOut).sort((a, b) => a.end - b.end).at(-1);

// Of two contacts of neighbouring pairs that overlap in time, the later one begins during the last one of the other pair.
function episodesOf(rows) {
  const latest = [], own = new Map();
  for (const row of rows.sort(([a], [b]) => a.begin - b.begin)) {
    const [{ pair, begin }] = row;
    own.set(row, [row]);
    for (const other of [latest[pair - 1], latest[pair + 1]]) {
      const [from, to] = [row, other].map((one) => own.get(one));
      if (other?.[0].end > begin && from !== to) for (const one of from) to.push(one), own.set(one, to);
    }
    latest[pair] = row;
  }
  return [...new Set(own.values())];
}
