// Columns of files that spreadsheets, loggers and video analysis write, times of bounces, and files that are no recording.
import assert from "node:assert/strict";
import { test } from "node:test";
import { flightHeights, recordingIn } from "../../../granular/app/page/live/columns.mjs";

const FALL = [[0, 1], [0.04, 0.99]];

test("separators, quotes, signs and exponents of either decimal sign", () => {
  for (const written of [
    '"0,00","1,00"\n"0,04","0,99"', '"t (s)","y (m)"\n0,1\n"0,04","0,99"', "0.0, 1.0\n0.04, 0.99", "0.00E+00;1.00E+00\n4.00E-02;9.9E-01", "0;1;\n0,04;0,99;\n", "+0. +1.\n+0.04 +.99",
    "0,1\r0.04,0.99\r", "-0.04,1.0\n0,1.0\n0.04,0.99", "0\u00a01\n0,04\u00a00,99", "0;1\n0,02;NaN\n0,04;0,99", "\n\nt\ty\n\n0\t1\n0.04\t0.99\n",
  ]) assert.deepEqual(recordingIn(written), { series: FALL }, written);
});

test("units beside the names, also above a gap, and the column named y", () => {
  for (const written of [
    "time [ms] height [cm]\n0 100\n40 99", "t (ms);y (cm)\n;\n0;100\n40;99", "t (ms),y (cm)\n0,\n0,100\n40,99", "t in ms;y in cm\n0;100\n40;99", "t,y\nms,cm\n0,100\n40,99",
    "# t/ms y/dm\n0 10\n40 9.9", '"t, ms","y, mm"\n0,1000\n40,990', "mass_A\t\t\nt\tx\ty\n0.0\t7\t1.0\n0.04\t8\t0.99",
    "Zeit in Sekunden;Höhe in Metern\n0;1\n0,04;0,99", "t;s\n0;1\n0,04;0,99", "t;h(t) in cm\n0;100\n0,04;99", "时间（秒）,高度（cm）\n0,100\n0.04,99", "time (sec)\theight (metres)\n0\t1\n0.04\t0.99", "Ball drop (basketball)\n0;1\n0.04;0.99",
  ]) assert.deepEqual(recordingIn(written).series.map(([t, y]) => [t, Number(y.toFixed(9))]), FALL, written);
});

test("a unit that is not converted is refused with the name of its column", () => {
  for (const [names, column] of [
    ["t (s);y (px)", "y (px)"], ["t (min);y (m)", "t (min)"], ["time;height in inches", "height in inches"], ["t/s;y/ft", "y/ft"], ["t;height_ft", "height_ft"], ["t;y in", "y in"],
    ["Frame;y", "Frame"], ["Bounce;Interval (ms)", "Interval (ms)"], ["v (m/s);y", "v (m/s)"], ["y (m);t (s)", "y (m)"], ["t;y\ns;px", "px"], ['"t, µs";"y, m"', "t, µs"], ["t (ms) y (cm)", "t (ms) y (cm)"],
  ]) assert.deepEqual(recordingIn(`${names}\n0;1\n0,04;0,99\n`), { column }, names);
  assert.deepEqual(recordingIn("y (m)\n0.5\n1.3\n2"), { column: "y (m)" });
});

test("one column holds the times of bounces, on any clock", () => {
  for (const written of [
    "0.5\n1.3\n2", "t (s)\n0,5\n1,3\n2,0", "0,5\n1,3\n2,0", "Zeit in ms\n500\n1300\n2000\n", '"Time (s)"\r\n"0,50"\r\n"1,30"\r\n"2,00"\r\n', "# t / s\n0.5;\n1.3;\n2.0;", '"t, ms"\n500\n1300\n2000', "a title\n\nt\n\n0.5\n1.3\n2",
  ]) assert.deepEqual(recordingIn(written).bounces.map((t) => Number(t.toFixed(9))), [0.5, 1.3, 2], written);
  assert.deepEqual(flightHeights([-1, 1, 2], 8), [4, 1]);
  assert.deepEqual(recordingIn("t,y\n0,5\n1,3\n2,0").series, [[0, 5], [1, 3], [2, 0]]);
  for (const written of ["0.5\n1.3", "1\n2\n3", "0.5\n1.3\n2.4", "3\n2\n1.5", "0;1\n0.1;\n0.2;", "0\n1e400\n2e400"]) assert.equal(recordingIn(written), null, written);
});

test("what is no recording is refused", () => {
  for (const written of [
    "", "1\n2\n3", "hello world", "NaN,NaN\nNaN,NaN", "0,1\n1e400,2", "0,1\n1,1e400", "0,1\n1,1e300", "-2,1\n-1,2", "0,1\n0,1\n1,1", "0,00,1,00\n1,00,0,50\n2,00,0,30", "t,y\n0,5,1,0\n1,5,0,9", "2024-01-01;1\n2024-01-02;2",
  ]) assert.equal(recordingIn(written), null, written);
});

test("a line without an end is cut: 1 ms in place of 20 s", () => {
  const begin = performance.now();
  assert.equal(recordingIn(`1${" ".repeat(1e5)}x\n${"1,".repeat(1e5)}`), null);
  for (const long of [`t;(${" ".repeat(1e5)}`, "(".repeat(1e5), "a in ".repeat(1e5)]) recordingIn(`${long}\n0;1\n1;2`);
  assert.ok(performance.now() - begin < 3000);
});
