// Columns of files that spreadsheets, loggers and video analysis write, times of bounces, and files that are no recording.
import assert from "node:assert/strict";
import { test } from "node:test";
import { flightHeights, recordingIn, textIn } from "../../../granular/app/page/live/columns.mjs";

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
    ["Frame;y", "Frame"], ["v (m/s);y", "v (m/s)"], ["t;y\ns;px", "px"], ['"t, µs";"y, m"', "t, µs"], ["t (ms) y (cm)", "t (ms) y (cm)"],
  ]) assert.deepEqual(recordingIn(`${names}\n0;1\n0,04;0,99\n`), { column }, names);
  for (const name of ["y (m)", "y", "Höhe", "height", "Millisekunden", "time milliseconds", "times in ms\n\nbounces"]) assert.deepEqual(recordingIn(`${name}\n0.5\n1.3\n2`), { column: name.split("\n")[0] }, name);
});

test("units are never dropped: spelled out, without brackets, or in a line that is not the line of names", () => {
  for (const name of ["height centimeters", "hauteur centimètres", "altura centímetros", "Höhe Zentimeter", "yükseklik santimetre", "高度厘米", "y millimetres", "pixely", "y km", "y µm", "y_ms"]) assert.deepEqual(recordingIn(`t;${name}\n0;1\n0,04;0,99`), { column: name }, name);
  for (const name of ["time milliseconds", "t µs", "time minutes", "Zeit Minuten", "zaman milisaniye", "时间毫秒"]) assert.deepEqual(recordingIn(`${name};y\n0;1\n0,04;0,99`), { column: name }, name);
  for (const line of ["t (ms);y (cm)", '"times, ms";"heights, cm"', "heights in cm", "y/mm"]) assert.deepEqual(recordingIn(`${line}\nby a class\n0;1\n0,04;0,99`), { column: line.replaceAll('"', "") }, line);
  assert.deepEqual(recordingIn("Frame;t;y (px)\n0;0;1\n1;0,04;0,99"), { column: "y (px)" });
  assert.deepEqual(recordingIn("t;y;unit\n0;100;cm\n0,04;99;cm"), { column: "0;100;cm" });
  assert.deepEqual(recordingIn("A ball of 70 mm, 7cm, um, us\nt;y\n0;1\n0,04;0,99").series, FALL);
});

test("times are found by name or unit, heights by name, wherever they are", () => {
  for (const names of ["n,t (s),y (m)", "Nr,Zeit,Höhe", ",t,y", "frame,time,height", "i,temps,hauteur", "i,tiempo,altura", "i,süre,yükseklik", "编号,时间,高度", "k,clock (s),place", "#,T,h"]) {
    assert.deepEqual(recordingIn(`${names}\n1,0,1\n2,0.04,0.99\n`).series, FALL, names);
  }
  for (const names of ["y (m);t (s)", "Höhe;Zeit", "height;time"]) assert.deepEqual(recordingIn(`${names}\n1;0\n0,99;0,04\n`).series, FALL, names);
  assert.deepEqual(recordingIn("t;x;h\n0;7;1\n0,04;8;0,99").series, FALL);
  for (const written of ["bounce;time\n1;0,5\n2;1,3\n3;2", "Bounce;Interval (ms)\n1;800\n2;700", "1;0;1\n2;0,04;0,99", "three columns\n1;0;1\n2;0,04;0,99", "t (s)\n1,000.5\n2,800.5\n3,500.5"]) assert.equal(recordingIn(written), null, written);
});

test("a number that can be read in two ways is shown, and no row with one is left out", () => {
  const pair = (a, b, c = "0") => `"t (ms)","y (mm)"\n"${c}","${a}"\n"40","${b}"\n"80","9"`;
  for (const [written, cell] of [
    [pair("1,000", "990"), "1,000"], [pair("1,000.0", "990.0"), "1,000.0"], [pair("990", "1,234,567"), "1,234,567"], [pair("0,5", "1.5"), "0,5"], [pair("1 000", "990"), "1 000"], [pair("990", "1'000"), "1'000"],
    [pair("990 mm", "980"), "990 mm"], [pair("990", "–980"), "–980"], [pair("5", "6", "00:00"), "00:00"], [pair("5", "6", "–1"), "–1"], ["t (s)\n1,000\n1,800\n2,500", "1,000"], ["t (ms)\n500\n1,300\n2,000", "1,300"], ["t (s)\n0,5\n1.3\n2", "0,5"],
    ["0,5\n1,3\n2,0", "0,5"], ["0,100\n40,99\n80,96", "0,100"], ["0,5\n1,4\n2,3\n3,2", "0,5"], ["a class\n0,5\n1,3\n2,0", "0,5"], ["t;y\n0;1\n0,04;0,99\n0,08;0,97\0", "0,97,"],
  ]) assert.deepEqual(recordingIn(written), { cell }, written);
  assert.deepEqual(recordingIn("t (ms);y (mm)\n0;1,000\n40;0,99").series, [[0, 0.001], [0.04, 0.00099]]); // as the library: ; leaves the comma to the numbers
  for (const gap of ["NaN", "", "#N/A", "-", "inf"]) assert.deepEqual(recordingIn(`t;y\n0;1\n0,02;${gap}\n0,04;0,99\nthe end`).series, FALL, gap);
});

test("a typographic minus, a byte order mark, and UTF-16", () => {
  assert.deepEqual(recordingIn("t;y\n−0,04;1\n0;1\n0,04;−0,99").series, [[0, 1], [0.04, -0.99]]);
  const written = "t (s)\ty (m)\r\n0,00\t1,00\r\n0,04\t0,99\r\n";
  for (const bytes of [Buffer.from(written), Buffer.from(`\ufeff${written}`), Buffer.from(`\ufeff${written}`, "utf16le")]) assert.deepEqual(recordingIn(textIn(bytes)).series, FALL);
  for (const bytes of [[], [255], [255, 254, 0], [...Array(256).keys()], [0x50, 0x4b, 3, 4, ...Array(999).fill(10)]]) assert.equal(recordingIn(textIn(Uint8Array.from(bytes))), null);
});

test("one column holds the times of bounces, on any clock", () => {
  for (const written of [
    "0.5\n1.3\n2", "t (s)\n0,5\n1,3\n2,0", "t\n0,5\n1,3\n2,0", '"0,5"\n"1,3"\n"2,0"', "Zeit in ms\n500\n1300\n2000\n", '"Time (s)"\r\n"0,50"\r\n"1,30"\r\n"2,00"\r\n', "# t / s\n0.5;\n1.3;\n2.0;", '"t, ms"\n500\n1300\n2000', "a title\n\nt\n\n0.5\n1.3\n2",
  ]) assert.deepEqual(recordingIn(written).bounces.map((t) => Number(t.toFixed(9))), [0.5, 1.3, 2], written);
  assert.deepEqual(flightHeights([-1, 1, 2], 8), [4, 1]);
  assert.deepEqual(recordingIn("t,y\n0,5\n1,3\n2,0").series, [[0, 5], [1, 3], [2, 0]]);
  for (const written of ["0.5\n1.3", "1\n2\n3", "0.5\n1.3\n2.4", "3\n2\n1.5", "0;1\n0.1;\n0.2;", "0\n1e400\n2e400"]) assert.equal(recordingIn(written), null, written);
});

test("what is no recording is refused", () => {
  for (const written of [
    "", "1\n2\n3", "hello world", "NaN,NaN\nNaN,NaN", "0;1\n1e400;2", "t,y\n0,1\n1,1e400", "t,y\n0,1\n1,1e300", "-2;1\n-1;2", "0;1\n0;1\n1;1", "0,00,1,00\n1,00,0,50\n2,00,0,30", "t,y\n0,5,1,0\n1,5,0,9", "2024-01-01;1\n2024-01-02;2",
  ]) assert.equal(recordingIn(written), null, written);
});

test("a line without an end is cut: 1 ms in place of 20 s", () => {
  const begin = performance.now();
  assert.equal(recordingIn(`1${" ".repeat(1e5)}x\n${"1,".repeat(1e5)}`), null);
  for (const long of [`t;(${" ".repeat(1e5)}`, "(".repeat(1e5), "a in ".repeat(1e5)]) recordingIn(`${long}\n0;1\n1;2`);
  assert.ok(performance.now() - begin < 3000);
});
