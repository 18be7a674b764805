// A series from a text of two columns, time and height, as spreadsheets and video analysis export them.
const UNITS = { ms: 1e-3, mm: 1e-3, cm: 1e-2 };
const NUMBER = /^-?\d*[.,]?\d+(?:e[-+]?\d+)?$/i;

// [[s, m], …] with times that increase, or null. Columns are separated by tabs, semicolons or spaces, or by commas where
// decimals have a point. A unit is read from the line above the numbers.
export function seriesIn(written) {
  const lines = written.split(/\r?\n/).map((line) => line.replace(/"/g, "").trim()), hasOther = lines.some((line) => /^-?[\d.,]+\s*[;\t ]\s*-?[\d.,]+/.test(line));
  const rows = lines.map((line) => line.split(hasOther ? /\s*[;\t ]\s*/ : /\s*,\s*/).slice(0, 2)), isRow = (row) => row.length === 2 && row.every((one) => NUMBER.test(one));
  const head = lines[rows.findIndex(isRow) - 1]?.split(hasOther && /[;\t]/.test(lines.join("")) ? /[;\t]/ : /,/) ?? [];
  const [first, second] = [0, 1].map((i) => UNITS[/[([/]\s*(ms|mm|cm)\b/.exec(head[i] ?? "")?.[1]] ?? 1);
  const series = rows.filter(isRow).map(([t, y]) => [first * t.replace(",", "."), second * y.replace(",", ".")]);
  return series.length > 1 && series.every(([t], i) => i === 0 || t > series[i - 1][0]) ? series : null;
}
