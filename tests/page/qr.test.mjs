// The code on printed pages is that of another encoder, module by module; what is too long has none.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { codeOf } from "../../granular/page/live/qr.mjs";

const { codes } = JSON.parse(readFileSync(new URL("../reference/qr_codes.json", import.meta.url)));

test("links of every length have the codes that another encoder gives them", () => {
  assert.equal(new Set(Object.values(codes).map((rows) => rows.length)).size, 6);
  for (const [link, rows] of Object.entries(codes)) assert.deepEqual(codeOf(link).map((row) => BigInt(`0b1${row.join("")}`).toString(16)), rows, link);
});

test("up to 213 bytes", () => {
  assert.equal(codeOf("x".repeat(213)).length, 57);
  assert.equal(codeOf("x".repeat(214)), null);
});
