// The page's engines against the Python engines: golden.json, 500 random cases made by make_golden.py.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { check, undecided } from "./golden.mjs";

const cases = JSON.parse(readFileSync(new URL("golden.json", import.meta.url), "utf8"));

for (const scene of new Set(cases.map((c) => c.scene))) {
  test(`${scene} as the Python engines run it`, () => {
    for (const one of cases.filter((c) => c.scene === scene)) assert.deepEqual(check(one), [], JSON.stringify(one));
  });
}

test("rises are decided except for a few balls thrown very high", () => {
  const known = cases.flatMap(({ soft, hard }) => [soft.rise, hard.rise]).filter((rise) => rise !== null);
  assert.ok(known.length > 400 && undecided.length < 0.02 * known.length, `${undecided.length} of ${known.length}`);
});
