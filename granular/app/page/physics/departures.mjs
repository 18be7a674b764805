// Episodes of linked contacts, and the velocities with which balls leave them in two runs (granular/comparison/episodes.py).
import { approach, INSTANT, isOver } from "./measures.mjs";
import { abs, max, min } from "./numbers.mjs";

const LONG_FLIGHT = 5; // durations of a contact

// The ball that leaves an episode with the largest difference in m/s. `logs` are soft and hard contacts by pairs. Contacts
// without end, and those of balls that settle, do not link others. A ball that rests on the floor is compared elsewhere.
export function largestDeparture({ mass, gravity }, logs, rests, lag) {
  let since = mass[0] === Infinity ? -1 : Infinity; // walls are left out
  const held = [since, ...logs.map(([log]) => (since = isOver(log.at(-1) ?? {}) ? Infinity : max(since, log.at(-1).begin)))];
  const rows = logs.flatMap(([log, hits], c) => log.flatMap((one, i) => (isOver(one) && !rests[c].settles?.(i) ? [[one, hits[i]]] : [])));
  const ends = episodesOf(rows).flatMap((episode) => mass.map((_, ball) => [ball, ...[0, 1].map((k) => lastContact(episode.map((row) => row[k]), ball))]));
  const found = [...ends, ...longFlights(mass, logs, rows)].flatMap(([ball, s, h]) => {
    if (!h || s.end > held[ball]) return [];
    const [soft, hard] = [s, h].map(({ vOut, pair }) => vOut[ball - pair]), late = lag(h.pair, approach(h)), d = hard - soft;
    return [{ ball, soft, hard, apart: min(abs(d), abs(d - gravity * max(-late, min(late, s.end - h.end)))) }];
  });
  return found.sort((a, b) => a.apart - b.apart).at(-1) ?? {};
}

// Balls that fly freely for long between two contacts of one episode leave it as well, if both runs have the next contact.
function longFlights(mass, logs, rows) {
  const both = new Set(logs.flatMap(([log, hits]) => log.flatMap((s, i) => (hits[i] ? [s, hits[i]] : []))));
  return mass.flatMap((_, ball) => {
    const [softly, hardly] = [0, 1].map((k) => flightsAfter(logs.flatMap((log) => log[k]).filter((c) => ball - c.pair in c.vOut), both));
    return rows.filter(([s, h]) => min(softly.get(s), hardly.get(h)) > LONG_FLIGHT * (s.end - s.begin)).map(([s, h]) => [ball, s, h]);
  });
}

// How long a ball is free after each of its contacts; of collisions in one instant, after the last.
function flightsAfter(contacts, both) {
  const later = [...contacts].sort((a, b) => a.begin - b.begin), rank = ({ end }) => (Number.isNaN(end) ? Infinity : end);
  const ended = [...contacts].sort((a, b) => rank(a) - rank(b) || 0), waits = ended.map(({ end }, j) => (j + 1 < ended.length ? (both.has(later[j + 1]) ? later[j + 1].begin : -Infinity) - end : Infinity));
  for (let j = ended.length - 2; j >= 0; j--) if (ended[j].begin === ended[j].end && abs(waits[j]) <= INSTANT * ended[j].end) waits[j] = waits[j + 1];
  return new Map(ended.map((c, j) => [c, waits[j]]));
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
