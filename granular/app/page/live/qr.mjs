// A QR code of a short text (ISO/IEC 18004): bytes, level M, versions 1 to 10, that is up to 213 bytes.
import { abs, floor, max, min } from "../physics/numbers.mjs";

const CHECKED = [10, 16, 26, 18, 24, 16, 18, 22, 22, 26]; // error-correction bytes of a block, by version
const BLOCKS = [1, 1, 1, 2, 2, 4, 4, 4, 5, 5];
const WHOLE = [26, 44, 70, 100, 134, 172, 196, 242, 292, 346]; // bytes in all
const MIDDLE = [0, 0, 0, 0, 0, 0, 22, 24, 26, 28]; // of the alignment patterns, where there are three in a row
const MASKS = [(r, c) => (r + c) % 2, (r) => r % 2, (r, c) => c % 3, (r, c) => (r + c) % 3, (r, c) => ((r >> 1) + floor(c / 3)) % 2,
  (r, c) => ((r * c) % 2) + ((r * c) % 3), (r, c) => (((r * c) % 2) + ((r * c) % 3)) % 2, (r, c) => (((r + c) % 2) + ((r * c) % 3)) % 2];

// Rows of 0 and 1, or null if the text is too long.
export function codeOf(text) {
  const bytes = [...new TextEncoder().encode(text)];
  const v = WHOLE.findIndex((whole, i) => bytes.length + (i < 9 ? 2 : 3) <= whole - CHECKED[i] * BLOCKS[i]);
  if (v < 0) return null;
  const bits = interleaved(padded(bytes, v), v).flatMap((byte) => binary(byte, 8)), tries = MASKS.map((_, mask) => drawn(v, bits, mask));
  const faults = tries.map(fault);
  return tries[faults.indexOf(min(...faults))];
}

export const binary = (x, n) => Array.from({ length: n }, (_, i) => (x >> (n - 1 - i)) & 1);

function padded(bytes, v) {
  const room = WHOLE[v] - CHECKED[v] * BLOCKS[v], bits = [0, 1, 0, 0, ...binary(bytes.length, v < 9 ? 8 : 16), ...bytes.flatMap((byte) => binary(byte, 8)), 0, 0, 0, 0];
  const all = Array.from({ length: bits.length >> 3 }, (_, i) => bits.slice(8 * i, 8 * i + 8).reduce((x, bit) => 2 * x + bit));
  return Array.from({ length: room }, (_, i) => all[i] ?? ((i - all.length) % 2 ? 0x11 : 0xec));
}

// Blocks with their error correction, first bytes of all blocks first; the last blocks may be one byte longer.
function interleaved(bytes, v) {
  const n = BLOCKS[v], least = floor(bytes.length / n), long = bytes.length % n;
  let at = 0;
  const blocks = Array.from({ length: n }, (_, i) => bytes.slice(at, at += least + (i >= n - long ? 1 : 0)));
  const checks = blocks.map((block) => remainder(block, CHECKED[v])), rows = (parts, length) => Array.from({ length }, (_, i) => parts.map((part) => part[i])).flat();
  return [...rows(blocks, least + 1).filter((byte) => byte !== undefined), ...rows(checks, CHECKED[v])];
}

const times = (a, b) => { // in the field of 256 numbers, modulo x⁸ + x⁴ + x³ + x² + 1
  let product = 0;
  for (let i = 7; i >= 0; i--) product = (product << 1) ^ ((product >> 7) * 0x11d) ^ (((b >> i) & 1) * a);
  return product;
};

// Reed–Solomon: what the block leaves divided by Π (x - 2^i).
function remainder(block, n) {
  let divisor = [1], root = 1;
  for (let i = 0; i < n; i++) {
    divisor = [...divisor, 0].map((c, j) => c ^ times(divisor[j - 1] ?? 0, root));
    root = times(root, 2);
  }
  const left = [...block, ...Array(n).fill(0)];
  block.forEach((_, i) => {
    const lead = left[i];
    divisor.forEach((c, j) => (left[i + j] ^= times(c, lead)));
  });
  return left.slice(block.length);
}

// Bits followed by what they leave in the field of 2 divided by a polynomial.
function guarded(x, n, polynomial) {
  let left = x << n;
  for (let i = 31 - Math.clz32(left); i >= n && left; i = 31 - Math.clz32(left)) left ^= polynomial << (i - n);
  return (x << n) | left;
}

function drawn(v, bits, mask) {
  const size = 21 + 4 * v, rows = Array.from({ length: size }, () => Array(size).fill(null));
  const put = (r, c, dark) => { if (rows[r]?.[c] !== undefined) rows[r][c] = Number(dark); };
  const ring = (r, c, half, light) => {
    for (let i = -half; i <= half; i++) for (let j = -half; j <= half; j++) put(r + i, c + j, !light.includes(max(abs(i), abs(j))));
  };
  for (let i = 0; i < size; i++) for (const [r, c] of [[6, i], [i, 6]]) put(r, c, i % 2 === 0);
  const places = v === 0 ? [] : [6, ...(MIDDLE[v] ? [MIDDLE[v]] : []), size - 7];
  for (const r of places) for (const c of places) if (!(r === 6 && c === 6) && !(r === 6 && c === size - 7) && !(r === size - 7 && c === 6)) ring(r, c, 2, [1]);
  for (const [r, c] of [[3, 3], [3, size - 4], [size - 4, 3]]) ring(r, c, 4, [2, 4]);
  const format = binary(guarded(mask, 10, 0x537) ^ 0x5412, 15); // level M is 00
  format.forEach((bit, i) => {
    put(8, i < 6 ? i : i === 6 ? 7 : size - 15 + i, bit);
    put(i < 7 ? size - 1 - i : i < 9 ? 15 - i : 14 - i, 8, bit);
  });
  put(size - 8, 8, 1);
  if (v >= 6) binary(guarded(v + 1, 12, 0x1f25), 18).forEach((bit, i) => {
    const a = 5 - floor(i / 3), b = size - 9 - (i % 3);
    put(a, b, bit);
    put(b, a, bit);
  });
  let next = 0;
  for (let right = size - 1; right > 0; right -= 2) {
    if (right === 6) right = 5;
    for (let i = 0; i < size; i++) for (const c of [right, right - 1]) {
      const r = ((size - 1 - right) >> 1) % 2 ? i : size - 1 - i;
      if (rows[r][c] === null) rows[r][c] = (bits[next++] ?? 0) ^ Number(MASKS[mask](r, c) === 0);
    }
  }
  return rows;
}

// The less, the easier it is to read: long runs, squares of one colour, what looks like a corner, too much dark or light.
function fault(rows) {
  const lines = [...rows, ...rows.map((_, i) => rows.map((row) => row[i]))].map((line) => line.join("")), dark = rows.flat().reduce((sum, bit) => sum + bit, 0) / rows.length ** 2;
  let sum = 10 * floor(abs(20 * dark - 10));
  for (const line of lines) {
    for (const run of line.match(/0{5,}|1{5,}/g) ?? []) sum += run.length - 2;
    sum += 40 * (line.match(/(?=10111010000|00001011101)/g) ?? []).length;
  }
  rows.forEach((row, r) => row.forEach((bit, c) => (sum += rows[r + 1] && row[c + 1] === bit && rows[r + 1][c] === bit && rows[r + 1][c + 1] === bit ? 3 : 0)));
  return sum;
}
