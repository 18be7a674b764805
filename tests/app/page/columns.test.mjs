// Columns of files that spreadsheets, loggers and video analysis write, and files that are no recording.
import assert from "node:assert/strict";
import { test } from "node:test";
import { seriesIn } from "../../../granular/app/page/live/columns.mjs";

const FALL = [[0, 1], [0.04, 0.99]];

test("separators, quotes, signs and exponents of either decimal sign", () => {
  for (const written of [
    '"0,00","1,00"\n"0,04","0,99"', '"t (s)","y (m)"\n0,1\n"0,04","0,99"', "0.0, 1.0\n0.04, 0.99", "0.00E+00;1.00E+00\n4.00E-02;9.9E-01", "0;1;\n0,04;0,99;\n", "+0. +1.\n+0.04 +.99",
    "0,1\r0.04,0.99\r", "-0.04,1.0\n0,1.0\n0.04,0.99", "0\u00a01\n0,04\u00a00,99", "0;1\n0,02;NaN\n0,04;0,99", "\n\nt\ty\n\n0\t1\n0.04\t0.99\n",
  ]) assert.deepEqual(seriesIn(written), FALL, written);
});

test("units beside the names, also above a gap, and the column named y", () => {
  for (const written of [
    "time [ms] height [cm]\n0 100\n40 99", "t (ms);y (cm)\n;\n0;100\n40;99", "t (ms),y (cm)\n0,\n0,100\n40,99", "t in ms;y in cm\n0;100\n40;99", "t,y\nms,cm\n0,100\n40,99",
    "# t/ms y/dm\n0 10\n40 9.9", '"t, ms","y, mm"\n0,1000\n40,990', "mass_A\t\t\nt\tx\ty\n0.0\t7\t1.0\n0.04\t8\t0.99",
  ]) assert.deepEqual(seriesIn(written).map(([t, y]) => [t, Number(y.toFixed(9))]), FALL, written);
});

test("what is no recording is refused", () => {
  for (const written of [
    "", "1\n2\n3", "hello world", "NaN,NaN\nNaN,NaN", "0,1\n1e400,2", "0,1\n1,1e400", "0,1\n1,1e300", "-2,1\n-1,2", "0,1\n0,1\n1,1", "0,00,1,00\n1,00,0,50\n2,00,0,30", "t,y\n0,5,1,0\n1,5,0,9", "2024-01-01;1\n2024-01-02;2",
  ]) assert.equal(seriesIn(written), null, written);
});

test("a line without an end is cut: 1 ms in place of 20 s", () => {
  const begin = performance.now();
  assert.equal(seriesIn(`1${" ".repeat(1e5)}x\n${"1,".repeat(1e5)}`), null);
  assert.ok(performance.now() - begin < 3000);
});
