// The page's engines against the Python engines: golden.json, 500 random cases made by make_golden.py.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { check, isUndecided } from "./golden.mjs";

const cases = JSON.parse(readFileSync(new URL("golden.json", import.meta.url), "utf8"));

for (const scene of new Set(cases.map((c) => c.scene))) {
  test(`${scene} as the Python engines run it`, () => {
    for (const one of cases.filter((c) => c.scene === scene)) assert.deepEqual(check(one), [], JSON.stringify(one));
  });
}

test("rises are decided but for a few balls thrown higher than anything the page follows", () => {
  const known = cases.filter(({ soft, hard }) => soft.rise !== null || hard.rise !== null), open = known.filter(isUndecided);
  assert.ok(known.length > 200 && open.length < 0.02 * known.length, `${open.length} of ${known.length}`);
});
