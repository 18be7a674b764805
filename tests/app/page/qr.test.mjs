// The code on printed pages is that of another encoder, module by module; what is too long has none.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { codeOf } from "../../../granular/app/page/live/qr.mjs";

const { codes } = JSON.parse(readFileSync(new URL("../../reference/qr_codes.json", import.meta.url)));

test("links of every length have the codes that another encoder gives them", () => {
  assert.equal(new Set(Object.values(codes).map((rows) => rows.length)).size, 6);
  for (const [link, rows] of Object.entries(codes)) assert.deepEqual(codeOf(link).map((row) => BigInt(`0b1${row.join("")}`).toString(16)), rows, link);
});

test("up to 213 bytes", () => {
  assert.equal(codeOf("x".repeat(213)).length, 57);
  assert.equal(codeOf("x".repeat(214)), null);
});

// The standard's numbers once more: of each version the blocks (total and data bytes) of level M, and the alignment places.
const BLOCKS = [[[26, 16]], [[44, 28]], [[70, 44]], [[50, 32], [50, 32]], [[67, 43], [67, 43]], Array(4).fill([43, 27]), Array(4).fill([49, 31]),
  [[60, 38], [60, 38], [61, 39], [61, 39]], [...Array(3).fill([58, 36]), [59, 37], [59, 37]], [...Array(4).fill([69, 43]), [70, 44]]];
const PLACES = [[], [6, 18], [6, 22], [6, 26], [6, 30], [6, 34], [6, 22, 38], [6, 24, 42], [6, 26, 46], [6, 28, 50]];
const LIGHT = [(r, c) => (r + c) % 2, (r) => r % 2, (r, c) => c % 3, (r, c) => (r + c) % 3, (r, c) => (Math.floor(r / 2) + Math.floor(c / 3)) % 2,
  (r, c) => (r * c) % 6, (r, c) => (((r * c) % 3) + r * c) % 2, (r, c) => (((r * c) % 3) + r + c) % 2];
const EXP = [1];
for (let i = 1; i < 255; i++) EXP.push((EXP[i - 1] << 1) ^ (EXP[i - 1] > 127 ? 0x11d : 0));
const LOG = new Map(EXP.map((x, i) => [x, i]));

// What a reader makes of a code: its bytes, and whether every block is a multiple of the Reed–Solomon polynomial.
function read(m) {
  const n = m.length, v = (n - 21) / 4, spots = PLACES[v], mask = [2, 3, 4].reduce((x, c) => 2 * x + (m[8][c] ^ (c % 2 === 0 ? 1 : 0)), 0);
  const near = (r, c) => spots.some((a) => spots.some((b) => Math.max(Math.abs(r - a), Math.abs(c - b)) < 3 && !((a === 6 || b === 6) && (a + b === 12 || a + b === n - 1))));
  const isFixed = (r, c) => r === 6 || c === 6 || (r < 9 && (c < 9 || c > n - 9)) || (r > n - 9 && c < 9) || (v > 5 && ((r < 6 && c > n - 12) || (c < 6 && r > n - 12))) || near(r, c);
  const bits = [];
  for (let pair = 0, c = n - 1; c > 0; c -= 2, pair++) {
    if (c === 6) c--;
    for (let i = 0; i < n; i++) for (const k of [c, c - 1]) {
      const r = pair % 2 ? i : n - 1 - i;
      if (!isFixed(r, k)) bits.push(m[r][k] ^ (LIGHT[mask](r, k) === 0 ? 1 : 0));
    }
  }
  const blocks = BLOCKS[v].map(() => []), taken = (from, to, x) => { for (let i = from; i < to; i++) BLOCKS[v].forEach(([, data], b) => { if (i < data || from > 0) blocks[b].push(x()); }); };
  let at = 0;
  const byte = () => bits.slice(8 * at, 8 * ++at).reduce((x, bit) => 2 * x + bit, 0);
  taken(0, Math.max(...BLOCKS[v].map(([, data]) => data)), byte);
  taken(1, 1 + BLOCKS[v][0][0] - BLOCKS[v][0][1], byte);
  const whole = blocks.every((block, b) => EXP.slice(0, BLOCKS[v][b][0] - BLOCKS[v][b][1]).every((_, root) =>
    block.reduce((sum, x) => (sum === 0 ? 0 : EXP[(LOG.get(sum) + root) % 255]) ^ x, 0) === 0));
  const data = blocks.flatMap((block, b) => block.slice(0, BLOCKS[v][b][1])).flatMap((x) => [...x.toString(2).padStart(8, "0")]).join(""), wide = v < 9 ? 8 : 16;
  const long = parseInt(data.slice(4, 4 + wide), 2);
  return { whole, mode: data.slice(0, 4), bytes: Array.from({ length: long }, (_, i) => parseInt(data.slice(4 + wide + 8 * i, 12 + wide + 8 * i), 2)) };
}

test("a reader finds any text in its code", () => {
  let seed = Number(process.env.THIRD ?? 0) + 1;
  const draw = (n) => (seed = (seed * 48271) % 2147483647) % n, seen = new Set();
  for (let k = 0; k < 60; k++) {
    const text = Array.from({ length: draw(k % 2 ? 214 : 60) }, () => String.fromCharCode(32 + draw(95))).join(""), rows = codeOf(text);
    const { whole, mode, bytes } = read(rows);
    assert.ok(whole && mode === "0100", text);
    assert.equal(String.fromCharCode(...bytes), text);
    seen.add(rows.length);
  }
  assert.ok(seen.size > 7);
});
