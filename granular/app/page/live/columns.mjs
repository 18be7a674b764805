// A recording from a text: two columns, time and height, as spreadsheets and video analysis export them, or one column,
// the times of the bounces.
import { abs, max } from "../physics/numbers.mjs";

const TIMES = { s: 1, ms: 1e-3 }, LENGTHS = { m: 1, dm: 0.1, cm: 1e-2, mm: 1e-3 };
const SPELLED = [[/^(?:se[ckg]|san|秒)/i, "s"], [/^(?:m[eè]t|米)/i, "m"]]; // seconds, Sekunden, saniye …
const UNIT = [/.*[([（](?!t\))([^()[\]（）]*)[)\]）]/, /^[^/,]*?(?:\/|,|\s(?:in|en)\s)(.+)/]; // y (cm), y/cm, "y, cm", y in cm; h(t) has none
const WRITTEN = "[mµμ]s|[dcmkµμ]m|px|pixels?[xy]?|inch(?:es)?|ft|feet|yd|minut\\p{L}*|\\p{L}+[ií](?:m[eè]t|se[ckg]|san)\\p{L}*|\\p{L}*[毫厘]\\p{L}*"; // also centimetres, Millisekunden …
const IN_LINE = new RegExp(`(?:^|[^\\p{L}\\d\\s]|\\D\\s)(?:${WRITTEN})(?!\\p{L})`, "iu"), FOREIGN = new RegExp(`^(?:${WRITTEN}|in|min|frames?)$`, "iu"); // not the 7 cm of a title
const TIME_NAME = /^(?:t|time|zeit|temps|tiempo|zaman|süre|时间)(?!\p{L})/iu, HEIGHT_NAME = /^(?:[hy]|height|höhe|hauteur|altura|yükseklik|高度)(?!\p{L})/iu;
const NUMBER = /^[-+]?(?:\d+\.?\d*|\d*[.,]\d+)(?:e[-+]?\d+)?$/i;
const THOUSANDS = /^[-+]?[1-9]\d{0,2}(?:,\d{3})+$/; // 1,000
const LINE_LENGTH = 1000, BEYOND_ANY = 1e6; // characters of a line that are read; s or m, more is not a bouncing ball
const SEPARATORS = [/;/, /\t/, /,/, /\s+/]; // in this order; a comma within quotes is a decimal sign
const BETWEEN_NAMES = /\s+(?![([/])/; // if the numbers are separated by spaces
const FEWEST = 3; // bounces

const isNumber = (cell) => NUMBER.test(cell ?? "");
const number = (cell) => Number(cell.replace(",", "."));
const increases = (times) => times.every((t, i) => abs(t) < BEYOND_ANY && (i === 0 || t > times[i - 1]));

// Spreadsheets write UTF-16, too.
export const textIn = (bytes) => new TextDecoder(new Uint8Array(bytes)[0] === 255 ? "utf-16" : undefined).decode(bytes);

// { series: [[s, m], …] } with times from 0 on that increase, { bounces: [s, …] } with intervals that decrease,
// { column } if that column has a unit that is not converted, { cell } if that number can be read in two ways, or null.
// Units are read from the line of names above the numbers. The first column with the name or the unit of a time has the
// times, and the column with the name of a height, or the next one, the heights.
export function recordingIn(written) {
  const lines = written.replaceAll("−", "-").split(/\r\n?|\n/).map((line) => line.slice(0, LINE_LENGTH).replace(/"([^"]*)"/g, (_, cell) => cell.replaceAll(",", "\0")).trim());
  const found = SEPARATORS.reduce((found, separator) => found ?? seriesWith(lines, separator), bouncesIn(lines.map((line) => line.replace(/[;,\t\s]+$/, "")).filter(Boolean)));
  return Object.keys(found ?? {}).length ? found : null;
}

function seriesWith(lines, separator) {
  const rows = lines.map((line) => line.split(separator).map(plainCell)), isRow = (row, i, j) => isNumber(row[i]) && isNumber(row[j]);
  const begin = max(0, rows.findIndex((row) => isRow(row, 0, 1))), top = rows.slice(0, begin).findLastIndex((row) => !/^\P{L}*\d/u.test(row[0]) && row.some(Boolean)), names = lines[top] ?? "";
  const isSpaced = separator.test(" "), isComma = separator.test(","), head = names.replace(/^#\s*/, "").split(isSpaced ? BETWEEN_NAMES : separator).map(plainCell);
  const isPlain = head.length < 2 || (isSpaced && head.length !== rows[begin].length); // a title, or names with spaces
  const clock = isPlain ? -1 : head.findIndex(isTime), first = max(0, clock), named = isPlain ? 1 : head.findIndex((name, i) => i !== first && HEIGHT_NAME.test(name)), at = named < 0 ? first + 1 : named;
  const used = rows.filter((row) => isRow(row, first, at)), cells = used.flatMap((row) => [row[first], row[at]]);
  const isTorn = isComma && used.some((row) => row.filter(Boolean).length > max(2, head.length)); // 0,04,0,99
  const isNameless = clock < 0 ? rows.some((row) => row.filter(isNumber).length > 2) || (isPlain && isComma && isTime(names)) : at === head.length; // which column is the height?
  if (isTorn || isNameless || used.length < 2) return null;
  const units = isPlain ? ["", ""] : [unitIn(head[first], false), unitIn(head[at], Object.hasOwn(TIMES, head[first]))];
  const [second, metre] = [inSi(units[0], TIMES), inSi(units[1], LENGTHS)], stray = units.join("") ? undefined : lines.find((line) => IN_LINE.test(line));
  if (!second || !metre || stray) return { column: stray ? plainCell(stray) : head[second ? at : first] };
  const cell = rows.slice(top + 1).flatMap((row) => (row[at] ? [row[first], row[at]] : [])).find((one) => /\d/.test(one) && !isNumber(one)) ?? unclear(cells, !separator.test(";"));
  if (cell) return { cell };
  const series = used.map((row) => [second * number(row[first]), metre * number(row[at])]).filter(([t]) => t >= 0);
  return series.length > 1 && increases(series.map(([t]) => t)) && series.every(([, y]) => abs(y) < BEYOND_ANY) ? { series } : isPlain ? null : {}; // no other separator
}

// A line with a separator has another column. But 0,04 is a number, if the name above it is that of a time.
function bouncesIn(lines) {
  const cells = lines.map(plainCell), begin = max(0, cells.findIndex(isNumber)), numbers = cells.slice(begin), name = (cells[begin - 1] ?? "").replace(/^#\s*/, ""), unit = unitIn(name, false);
  if (numbers.length < 2 || /[;,\t]/.test(lines[begin - 1]) || !numbers.every(isNumber)) return null;
  const cell = !isTime(name) && lines.slice(begin).every((line) => /^[^.]+,/.test(line)) ? numbers[0] : unclear(numbers, true);
  if (cell) return { cell };
  const second = inSi(unit, TIMES), bounces = numbers.map((one) => (second || 1) * number(one)), flights = intervals(bounces);
  if (bounces.length < FEWEST || !increases(bounces) || flights.some((flight, i) => flight >= flights[i - 1])) return null;
  const column = !second || HEIGHT_NAME.test(name) ? name : unit ? undefined : cells.find((line) => IN_LINE.test(line));
  return column === undefined ? { bounces } : { column };
}

const plainCell = (cell) => cell.trim().replaceAll("\0", ",");

// The first number with a comma, if all commas can be thousands separators, or some numbers have points.
function unclear(cells, isStrict) {
  const commas = cells.filter((cell) => cell.includes(","));
  return cells.some((cell) => cell.includes(".")) || (isStrict && commas.every((cell) => THOUSANDS.test(cell))) ? commas[0] : undefined;
}

const intervals = (bounces) => bounces.slice(1).map((t, i) => t - bounces[i]);

// A flight between two bounces of T seconds is g T²/8 high.
export const flightHeights = (bounces, g) => intervals(bounces).map((flight) => (g * flight * flight) / 8);

// The unit in a column's name, "" without a unit. A whole name is a unit if `isUnit`: in a line of units below the names.
function unitIn(name, isUnit) {
  const given = UNIT.map((pattern) => pattern.exec(name)?.[1].trim()).find((found) => found !== undefined), last = /[\p{L}µ]*$/u.exec(name)[0];
  const unit = SPELLED.find(([pattern]) => pattern.test(given))?.[1] ?? given ?? (isUnit || last.length > 1 ? last : "");
  return given || isUnit || Object.hasOwn(TIMES, unit) || FOREIGN.test(unit) ? unit : "";
}

// 0 for a unit that is not converted.
const inSi = (unit, known) => (unit === "" ? 1 : Object.hasOwn(known, unit) ? known[unit] : 0);

const isTime = (name) => TIME_NAME.test(name) || Object.hasOwn(TIMES, name) || Object.hasOwn(TIMES, unitIn(name, false));
