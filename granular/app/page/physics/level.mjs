// Both runs of a scene, cut at one end, go on until they have the same contacts (granular/comparison/align.py). With them the lag:
// the time in s by which a contact of a pair at an approach speed may be late.
import { goOnHard } from "./hard.mjs";
import { approach, counts, first, inBoth, isOver, largest, ofPair, lasted } from "./measures.mjs";
import { pairsOf } from "./scenes.mjs";
import { goOnSoft } from "./soft.mjs";
import { abs, max, min, sum } from "./numbers.mjs";

export const AFTERWARDS = 20; // isolated durations

export function levelled(hard, soft, eps, k) {
  const alone = pairsOf(hard.scene, eps, k).map((p) => p.duration), [own, some] = inBoth(hard, soft), n = counts(some);
  const lag = lagOf(own, some, alone), most = counts(own).map((m, c) => max(m, n[c])), late = [lateness(own, some, lag, most), lateness(some, own, lag, most)];
  const onward = goOnHard(own, hard.time + largest(late[0])), later = goOnSoft(some, soft.time + largest(late[1]));
  const followed = patience(some, soft.time, alone), settle = alone.map((_, c) => followed[c] > soft.time && !(ofPair(later, c)[n[c] - 1].end <= followed[c]) && bouncesLower(c, own, some, alone));
  settle.forEach((does, c) => does && (late[1][c] = 0));
  const until = patience(due(later, soft.time, late[1], most), soft.time, alone).map((t, c) => (settle[c] ? followed[c] : t)), runs = inBoth(onward, goOnSoft(later, largest(until)));
  return [due(runs[0], hard.time, late[0], most), endless(due(runs[1], soft.time, late[1], most), until), lag];
}

// Whether the hard contacts of pair c that soft spheres lack, which rest there, are no faster than the last one of theirs.
function bouncesLower(c, own, some, alone) {
  const last = ofPair(some, c), weight = own.scene.gravity * min(largest(alone.filter((_, i) => ofPair(own, i).length + ofPair(some, i).length)), lasted(some));
  return ofPair(own, c).slice(last.length).every((one) => approach(one) <= max(weight, approach(last.at(-1))));
}

function lagOf(hard, soft, alone) {
  const took = sum(soft.contacts.filter(isOver).map((c) => c.end - c.begin));
  const delay = took + sum(hard.contacts.map((c) => alone[c.pair])), way = delay * largest([...soft.contacts, ...hard.contacts].map(approach));
  const span = lasted(soft);
  return (c, speed) => alone[c] + (speed > 0 ? min(way / speed, span) : span);
}

// By how many seconds the contacts that `run` has yet to make may be late, by pairs.
function lateness(run, other, lag, most) {
  const n = counts(run);
  return most.map((m, c) => (n[c] < m ? lag(c, abs(approach(ofPair(other, c).at(-1)))) : 0));
}

// The first contacts of every pair that begin in time.
const due = (run, end, late, most) => first({ ...run, contacts: run.contacts.filter((c) => c.begin <= end + late[c.pair]) }, most);

// Until when contacts without end are followed, by pairs.
function patience({ contacts }, cut, alone) {
  const until = alone.map(() => -Infinity);
  for (const c of contacts) if (!isOver(c)) until[c.pair] = max(c.begin, cut) + AFTERWARDS * alone[c.pair];
  return until;
}

// Contacts that last longer than they are followed have no end.
const endless = (soft, until) => ({ ...soft, contacts: soft.contacts.map((c) => (
  until[c.pair] > 0 && c.end > until[c.pair] ? { ...c, end: NaN, vOut: [NaN, NaN] } : c)) });
