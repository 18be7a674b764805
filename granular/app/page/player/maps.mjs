// Maps over time: velocity or displacement of every ball as colour, and which contacts are under way.
import { tickName, ticks } from "../shell/axes.mjs";
import { quantity } from "../shell/format.mjs";
import { colour } from "./picture.mjs";

const FEW = 12;

const hue = (name) => [1, 3, 5].map((i) => parseInt(colour(name).slice(i, i + 2), 16));

// Blue to the right or up, orange to the left or down, paler where slower; every body that is shown has a row of its own.
function drawField(picture, { span, rows, times, value, peak, first, last }) {
  picture.begin(span, [first - 0.5, last + 0.5]);
  const columns = times.length, image = new ImageData(columns, rows), shades = { up: hue("--soft"), down: hue("--hard"), none: hue("--raised") };
  for (let c = 0; c < columns; c++) {
    for (let l = 0; l < rows; l++) {
      const v = value(c, l) / (peak || 1), share = Math.min(1, Math.abs(v)) ** 0.6, to = v > 0 ? shades.up : shades.down, at = 4 * ((rows - 1 - l) * columns + c);
      for (let k = 0; k < 3; k++) image.data[at + k] = shades.none[k] + share * (to[k] - shades.none[k]);
      image.data[at + 3] = 255;
    }
  }
  const whole = document.createElement("canvas");
  Object.assign(whole, { width: columns, height: rows }).getContext("2d").putImageData(image, 0, 0);
  picture.inside((pen) => {
    pen.imageSmoothingEnabled = rows > picture.b - picture.t; // else a row may fall between two pixels
    for (let c = 0; c < columns; c++) {
      const from = picture.x(c ? (times[c - 1] + times[c]) / 2 : times[0]), to = picture.x(c + 1 < columns ? (times[c] + times[c + 1]) / 2 : times[c]);
      if (to >= picture.l && from <= picture.r) pen.drawImage(whole, c, 0, 1, rows, from, picture.t, to - from + 0.6, picture.b - picture.t);
    }
  });
  picture.timeAxis();
  picture.namedAxis(ticks(picture.ys, 5).filter(Number.isInteger).map((m) => [m, tickName(m)]), "ball");
  picture.keep();
}

export function drawVelocity(picture, run, runs, span) {
  const { field } = run, peak = Math.max(...runs.map((one) => one.field.peak));
  drawField(picture, {
    span, rows: field.rows, times: field.time, peak, first: field.first, last: field.last,
    value: (c, l) => (field.values[c * field.rows + l] / 127) * field.peak,
  });
  return legend(run, "velocity", peak, "m/s") + (field.rows <= field.last - field.first ? "; of balls in one line the fastest" : "");
}

// How far each ball is from where it was at the start of the run.
export function drawDisplacement(picture, run, runs, span) {
  const of = ({ path, width }, r, i) => path[r * width + i] - path[i];
  const peak = Math.max(...runs.map((one) => one.path.reduce((top, x, j) => Math.max(top, Math.abs(x - one.path[j % one.width])), 0)));
  drawField(picture, { span, rows: run.width, times: run.time, peak, first: run.bodies[0], last: run.bodies[run.width - 1], value: (r, i) => of(run, r, i) });
  return legend(run, "displacement", peak, "m");
}

const legend = ({ upright }, name, peak, unit) =>
  `${name} as colour: blue ${upright ? "upwards" : "to the right"}, orange ${upright ? "downwards" : "to the left"}; full colour is ${quantity(peak, unit)}`;

// Single contacts as long as all were kept, at any zoom; else how many are under way, the darker the more.
export function drawContacts(picture, run, span) {
  const n = run.pairs, lanes = run.map ? run.map.lanes : n;
  picture.begin(span, [-0.5, lanes - 0.5]);
  picture.timeAxis();
  picture.namedAxis(laneNames(run, n / lanes), n > FEW ? "pair (its lower ball)" : "contacts of pair");
  const thick = Math.max(1.2, Math.min(14, (0.72 * (picture.b - picture.t)) / lanes));
  picture.inside((pen) => {
    pen.fillStyle = colour(`--${run.engine}`);
    if (run.map) counted(picture, run, thick);
    else singles(picture, run, thick);
  });
  picture.keep();
}

function laneNames(run, each) {
  if (run.pairs > FEW) return ticks([0, run.pairs - 1], 5).filter(Number.isInteger).map((pair) => [pair / each, tickName(pair)]);
  return Array.from({ length: run.pairs }, (_, pair) => [pair, pairName({ ...run, kinds: {} }, pair)]); // there is room for numbers only
}

export const pairName = (run, pair) => `${bodyName(run, pair)}–${bodyName(run, (pair + 1) % run.n)}`;

// As in the teaching page: balls are counted from 1, also where there is no floor.
export function bodyName({ walls, upright, kinds }, body) {
  if (kinds?.[body]) return kinds[body];
  if (!walls.includes(body)) return String(walls.includes(0) ? body : body + 1);
  if (!upright) return "wall";
  return body ? "ceiling" : "floor";
}

function singles(picture, { contacts: { pair, begin, end }, whole }, thick) {
  const { pen } = picture, least = whole.contacts > 3000 ? 1.6 : 3;
  pen.globalAlpha = whole.contacts > 3000 ? 0.6 : 0.9;
  for (let i = 0; i < pair.length; i++) {
    const from = picture.x(begin[i]), wide = Math.max(least, picture.x(end[i]) - from);
    if (from <= picture.r && from + wide >= picture.l) pen.fillRect(wide > least ? from : from - least / 2, picture.y(pair[i]) - thick / 2, wide, thick);
  }
}

function counted(picture, { map: { columns, lanes, counts }, span }, thick) {
  const { pen } = picture, top = Math.log1p(counts.reduce((a, b) => Math.max(a, b), 1)), each = (span[1] - span[0]) / columns;
  for (let c = 0; c < columns; c++) {
    const from = picture.x(span[0] + c * each), wide = Math.max(1.6, picture.x(span[0] + (c + 1) * each) - from);
    for (let l = 0; l < lanes; l++) {
      const count = counts[c * lanes + l];
      if (!count) continue;
      pen.globalAlpha = 0.5 + (0.5 * Math.log1p(count)) / top;
      pen.fillRect(from, picture.y(l) - thick / 2, wide, thick);
    }
  }
}
