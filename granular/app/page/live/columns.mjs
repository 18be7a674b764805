// A series from a text of two columns, time and height, as spreadsheets and video analysis export them.
import { abs, max } from "../physics/numbers.mjs";

const UNITS = { ms: 1e-3, mm: 1e-3, cm: 1e-2, dm: 0.1 };
const NUMBER = /^[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?$/i;
const LINE_LENGTH = 1000, BEYOND_ANY = 1e6; // characters of a line that are read; s or m, more is not a bouncing ball
const SEPARATORS = [/;/, /\t/, /,/, /\s+/]; // in this order; a comma within quotes is a decimal sign
const BETWEEN_NAMES = /\s+(?![([/])/; // if the numbers are separated by spaces

// [[s, m], …] with times from 0 on that increase, or null. Units are read from the line of names above the numbers.
// The height is the second column, or the column named y.
export function seriesIn(written) {
  const lines = written.split(/\r\n?|\n/).map((line) => line.slice(0, LINE_LENGTH).replace(/"([^"]*)"/g, (_, cell) => cell.replaceAll(",", "\0")).trim());
  return SEPARATORS.reduce((found, separator) => found ?? seriesWith(lines, separator), null);
}

function seriesWith(lines, separator) {
  const rows = lines.map((line) => line.split(separator).map((cell) => cell.trim().replaceAll("\0", ","))), isRow = (row, at) => [row[0], row[at]].every((cell) => NUMBER.test(cell ?? ""));
  const begin = max(0, rows.findIndex((row) => isRow(row, 1))), names = lines.slice(0, begin).findLast((line, i) => rows[i][0] && !NUMBER.test(rows[i][0])) ?? "";
  const head = names.replace(/^#\s*/, "").split(separator.test(" ") ? BETWEEN_NAMES : separator), at = max(1, head.findIndex((name) => /^\s*y\b/i.test(name)));
  const [second, metre] = [0, at].map((i) => UNITS[/(?:^|[^\p{L}])(ms|mm|cm|dm)(?!\p{L})/u.exec(head[i] ?? "")?.[1]] ?? 1);
  const used = rows.filter((row) => isRow(row, at)), number = (cell) => Number(cell.replace(",", "."));
  const isTorn = separator.test(",") && used.some((row) => row.length > max(2, head.length)) && !used.some((row) => /\./.test(row[0] + row[at])); // 0,04,0,99
  const series = used.map((row) => [second * number(row[0]), metre * number(row[at])]).filter(([t]) => t >= 0);
  return !isTorn && series.length > 1 && series.every(([t, y], i) => t < BEYOND_ANY && abs(y) < BEYOND_ANY && (i === 0 || t > series[i - 1][0])) ? series : null;
}
