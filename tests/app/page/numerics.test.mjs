// The page's engines against the Python engines: golden.json, 500 random cases made by make_golden.py.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { compareEngines } from "../../../granular/app/page/physics/outcome.mjs";
import { contactsIn, sceneOf } from "../../../granular/app/page/physics/setups.mjs";
import { verdict } from "../../../granular/app/page/physics/verdict.mjs";
import { check, undecided } from "./golden.mjs";

const all = JSON.parse(readFileSync(new URL("golden.json", import.meta.url), "utf8"));
const cases = all.filter((_, k) => k % 3 === Number(process.env.THIRD ?? k % 3)); // of three, or all

for (const scene of new Set(cases.map((c) => c.scene))) {
  test(`${scene} as the Python engines run it`, () => {
    for (const one of cases.filter((c) => c.scene === scene)) assert.deepEqual(check(one), [], JSON.stringify(one));
  });
}

test("rises are decided except for a few balls thrown very high", () => {
  const known = cases.flatMap(({ soft, hard }) => [soft.rise, hard.rise]).filter((rise) => rise !== null);
  assert.ok(known.length > 0.8 * cases.length && undecided.length < 0.03 * known.length, `${undecided.length} of ${known.length}`);
});

test("a contact that is given up stays so, though the search for rises comes to its end", () => {
  const values = { gap: 6.98e-5, height: 1.89, rule: 1, bounces: 2, m1: 1.06e-3, r1: 6.31e-3, t1: 2.16e-5, e1: 1, air1: 0,
    m2: 0.602, r2: 0.0778, t2: 4.8e-3, e2: 1, air2: 1 };
  const untold = { status: null }; // what is told is what make_golden.py tells
  const one = { scene: "real-balls", values, ties: "left", answer: "no", kind: "off", said: null, error: 1, counts: [[2, 2], [1, 2]], soft: untold, hard: untold };
  assert.deepEqual(check(one), []);
});

// Settings of docs/guide/answer.md and error-definition.md, with the error, the ball that decides and its velocities, soft and hard.
const BASE = ["three-balls", { gap: 1e-4, eps: 0.7, ratio: 10, k: 5e7, height: 0.6 }];
const TENNIS = ["real-balls", { gap: 0.0236, height: 1, rule: 0, bounces: 1, m1: 0.624, r1: 0.119, t1: 0.012, e1: 0.82, air1: 1,
  m2: 0.0577, r2: 0.033, t2: 0.005, e2: 0.78, air2: 1 }];
const reportOf = ([name, values]) => {
  const { eps, k } = contactsIn(name, values);
  return compareEngines(sceneOf(name, values), eps, k);
};

for (const [called, setting, error, ball, velocities] of [["base case", BASE, 0.680, 2, [2.28181, 5.91043]], ["tennis ball", TENNIS, 0.0096, 1, [2.457, 2.379]]]) {
  test(`the ${called} has the error of the documentation`, () => {
    const { leaves, ...report } = reportOf(setting);
    assert.ok(Math.abs(report.error - error) < 5e-5 + 5e-4 * error, report.error);
    assert.equal(leaves.ball, ball);
    [leaves.soft, leaves.hard].forEach((u, i) => assert.ok(Math.abs(u - velocities[i]) < 6e-4, u));
  });
}

test("a check of the hard spheres that came to no end leaves a yes undecided, and a no as it is", () => {
  for (const [setting, answer] of [[TENNIS, "undecided"], [BASE, "no"]]) {
    assert.equal(verdict({ ...reportOf(setting), patience: {}, unchecked: true }).answer, answer);
  }
});
