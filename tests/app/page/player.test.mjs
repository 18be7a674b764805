// The player: which contacts belong together, and that its clock shows each of them.
import assert from "node:assert/strict";
import { test } from "node:test";
import { decoded, positionsAt, underWay } from "../../../granular/app/page/player/decode.mjs";
import { episodes, later, nextEpisode, slowable } from "../../../granular/app/page/player/episodes.mjs";

const run = (...spans) => ({ contacts: { begin: spans.map(([begin]) => begin), end: spans.map(([, end]) => end) } });
const whole = [0, 10];

test("contacts that follow each other closely are one episode, in whatever run and order they are told", () => {
  assert.deepEqual(episodes([run([5, 5.01]), run([1, 1.02], [1.03, 1.04], [1.01, 1.03])], whole), [[1, 1.04], [5, 5.01]]);
});

test("a short contact within a long one does not end the episode early", () => {
  assert.deepEqual(episodes([run([1, 1.5], [1.1, 1.2])], whole), [[1, 1.5]]);
});

test("no episode is made longer than a tenth of the run", () => {
  const many = Array.from({ length: 100 }, (_, i) => [1 + 0.05 * i, 1.05 + 0.05 * i]);
  for (const [begin, end] of episodes([run(...many)], whole)) assert.ok(end - begin < 1);
});

test("next and last episode have room at their sides and stay within the run", () => {
  const many = [[0, 0.1], [5, 5.1], [9.99, 10]];
  const [from, to] = nextEpisode(many, 1, 1, whole);
  assert.ok(from > 4.9 && from < 5 && to > 5.1 && to < 5.2);
  assert.deepEqual(nextEpisode(many, 6, 1, whole)[1], 10);
  assert.equal(nextEpisode(many, 6, -1, whole)[0], from);
  assert.equal(nextEpisode(many, 1, -1, whole)[0], 0);
  assert.equal(nextEpisode(many, 10, 1, whole), null);
});

test("few short soft contacts are slowed down; instants, many and long ones are not", () => {
  const [[from, to]] = slowable([[5, 5.1]], whole);
  assert.ok(from < 5 && to > 5.1);
  assert.deepEqual(slowable([[5, 5]], whole), []);
  assert.deepEqual(slowable([[5, 8]], whole), []);
  assert.deepEqual(slowable(Array.from({ length: 30 }, (_, i) => [i / 4, i / 4 + 1e-3]), whole), []);
});

test("at any rate of pictures the clock goes on, jumps over no episode and stays seconds in each", () => {
  const slow = [[1, 1.001], [1.0011, 1.002], [4, 4.00001]];
  for (const step of [1 / 60, 0.3, 5]) {
    const shown = slow.map(() => 0);
    let t = 0, pictures = 0;
    for (; t < 10 && pictures < 1e4; pictures++) {
      const next = later(slow, t, step, 10 / 9);
      assert.ok(next > t);
      t = next;
      slow.forEach(([begin, end], i) => (shown[i] += t >= begin && t <= end));
    }
    assert.ok(pictures < 1e4);
    shown.forEach((count) => assert.ok(count >= Math.max(1, Math.floor(2.4 / step)), `${count} pictures of ${step} s`));
  }
});

test("displacements too small to be seen are enlarged by a round number, overlaps to no more than a share of a radius", async () => {
  globalThis.window ??= {};
  const { enlargement, reach } = await import("../../../granular/app/page/player/balls.mjs");
  const row = (last, overlap = 0) => ({ width: 2, radius: [0.1, 0.1], offset: [0, 0.2], path: [0, 0, overlap, last] });
  const times = enlargement([row(0), row(0.001)]);
  assert.equal(times, 100); // to 0.1 m, which is less than 0.3 of 0.4 m
  assert.ok(Math.abs(reach([row(0.001)], times)[1] - 0.4) < 1e-12);
  assert.equal(enlargement([row(0.5)]), 1);
  assert.equal(enlargement([row(0)]), 1);
  assert.equal(enlargement([row(0.001, 0.003)]), 20); // 0.002 m deep: 0.04 m of 0.06 m
});

const packed = (array) => Buffer.from(array.buffer).toString("base64"), floats = (...x) => packed(new Float32Array(x)), doubles = (...x) => packed(new Float64Array(x));

test("a hard run is read back: contacts end when they begin, there is no map, a row twice is a step", () => {
  const read = decoded({
    bodies: packed(new Int32Array([0, 1])), radius: floats(0, 1), time: doubles(0, 1, 1, 2), offset: floats(0, 1), path: floats(0, 2, 0, 1, 0, 0, 0, 2), energy: doubles(2, 2, 1, 1),
    contacts: { pair: packed(new Int32Array([0])), begin: doubles(1), end: null, before: floats(-1), after: floats(1), impulse: floats(2) },
    map: null, field: { time: doubles(0), values: packed(new Int8Array([127])) },
  });
  assert.deepEqual([...read.contacts.end], [1]);
  assert.equal(read.map, null);
  assert.deepEqual([0, 0.5, 1, 1.5, 2].map((t) => positionsAt(read, t, [])[1]), [3, 2.5, 1, 2, 3]);
  assert.deepEqual([0.9, 1.05, 1.2].map((t) => underWay(read, t, 0.1).length), [0, 1, 0]);
});
