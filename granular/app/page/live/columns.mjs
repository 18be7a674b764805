// A recording from a text: two columns, time and height, as spreadsheets and video analysis export them, or one column,
// the times of the bounces.
import { abs, max } from "../physics/numbers.mjs";

const TIMES = { s: 1, ms: 1e-3 }, LENGTHS = { m: 1, dm: 0.1, cm: 1e-2, mm: 1e-3 };
const SPELLED = [[/^(?:se[ckg]|san|秒)/i, "s"], [/^(?:m[eè]t|米)/i, "m"]]; // seconds, Sekunden, saniye …
const UNIT = [/.*[([（](?!t\))([^()[\]（）]*)[)\]）]/, /^[^/,]*?(?:\/|,|\s(?:in|en)\s)(.+)/]; // y (cm), y/cm, "y, cm", y in cm; h(t) has none
const WRITTEN = "ms|[dcm]m|px|pixels?|inch(?:es)?|ft|feet|yd", IN_LINE = new RegExp(`(?:^|[^\\p{L}])(?:${WRITTEN})(?!\\p{L})`, "iu"), FOREIGN = new RegExp(`^(?:${WRITTEN}|in|frames?)$`, "i");
const NUMBER = /^[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?$/i;
const LINE_LENGTH = 1000, BEYOND_ANY = 1e6; // characters of a line that are read; s or m, more is not a bouncing ball
const SEPARATORS = [/;/, /\t/, /,/, /\s+/]; // in this order; a comma within quotes is a decimal sign
const BETWEEN_NAMES = /\s+(?![([/])/; // if the numbers are separated by spaces
const FEWEST = 3; // bounces

const isNumber = (cell) => NUMBER.test(cell ?? "");
const number = (cell) => Number(cell.replace(",", "."));
const increases = (times) => times.every((t, i) => abs(t) < BEYOND_ANY && (i === 0 || t > times[i - 1]));

// { series: [[s, m], …] } with times from 0 on that increase, { bounces: [s, …] } with intervals that decrease,
// { column } if that column has a unit that is not converted, or null. Units are read from the line of names above the
// numbers. The height is the second column, or the column named y.
export function recordingIn(written) {
  const lines = written.split(/\r\n?|\n/).map((line) => line.slice(0, LINE_LENGTH).replace(/"([^"]*)"/g, (_, cell) => cell.replaceAll(",", "\0")).trim());
  return SEPARATORS.reduce((found, separator) => found ?? seriesWith(lines, separator), bouncesIn(lines.map((line) => line.replace(/[;,\t\s]+$/, "")).filter(Boolean)));
}

function seriesWith(lines, separator) {
  const rows = lines.map((line) => line.split(separator).map((cell) => cell.trim().replaceAll("\0", ","))), isRow = (row, at) => isNumber(row[0]) && isNumber(row[at]);
  const begin = max(0, rows.findIndex((row) => isRow(row, 1))), names = lines.slice(0, begin).findLast((line, i) => rows[i][0] && !isNumber(rows[i][0])) ?? "";
  const head = names.replace(/^#\s*/, "").split(separator.test(" ") ? BETWEEN_NAMES : separator).map((name) => name.trim().replaceAll("\0", ",")), at = max(1, head.findIndex((name) => /^y\b/i.test(name)));
  const used = rows.filter((row) => isRow(row, at)), isPlain = head.length < 2;
  const isTorn = separator.test(",") && used.some((row) => row.length > max(2, head.length)) && !used.some((row) => /\./.test(row[0] + row[at])); // 0,04,0,99
  if (isTorn || used.length < 2) return null;
  const [second, metre] = isPlain ? [1, Number(!IN_LINE.test(names))] : [unitIn(head[0], TIMES, false), unitIn(head[at], LENGTHS, Object.hasOwn(TIMES, head[0]))];
  if (!second || !metre) return { column: (second && head[at]) || head[0] };
  const series = used.map((row) => [second * number(row[0]), metre * number(row[at])]).filter(([t]) => t >= 0);
  return series.length > 1 && increases(series.map(([t]) => t)) && series.every(([, y]) => abs(y) < BEYOND_ANY) ? { series } : null;
}

// A line with a separator has another column, but 0,04 is a number.
function bouncesIn(lines) {
  const cells = lines.map((line) => line.replaceAll("\0", ",")), begin = max(0, cells.findIndex(isNumber)), name = (lines[begin - 1] ?? "").replace(/^#\s*/, "");
  const second = unitIn(name, TIMES, false), bounces = cells.slice(begin).map((cell) => (second || 1) * number(cell)), flights = intervals(bounces);
  if (bounces.length < FEWEST || /[;,\t]/.test(lines[begin - 1]) || !cells.slice(begin).every(isNumber) || !increases(bounces) || flights.some((flight, i) => flight >= flights[i - 1])) return null;
  return second ? { bounces } : { column: name };
}

const intervals = (bounces) => bounces.slice(1).map((t, i) => t - bounces[i]);

// A flight between two bounces of T seconds is g T²/8 high.
export const flightHeights = (bounces, g) => intervals(bounces).map((flight) => (g * flight * flight) / 8);

// The factor of the unit in a column's name, 1 without a unit, 0 if it is not converted. A whole name is a unit if `isUnit`:
// in a line of units below the names.
function unitIn(name, known, isUnit) {
  const given = UNIT.map((pattern) => pattern.exec(name)?.[1].trim()).find((found) => found !== undefined), last = /[\p{L}µ]*$/u.exec(name)[0];
  const unit = SPELLED.find(([pattern]) => pattern.test(given))?.[1] ?? given ?? (isUnit || last.length > 1 ? last : "");
  if (Object.hasOwn(known, unit)) return known[unit];
  return unit && (given || isUnit || FOREIGN.test(unit)) ? 0 : 1;
}
