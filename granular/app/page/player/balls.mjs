// The balls now, on one scale for all runs: upright where gravity acts, with the floor below, else from left to right.
import { tickName, ticks } from "../shell/axes.mjs";
import { unitFor } from "../shell/format.mjs";
import { positionsAt, underWay } from "./decode.mjs";
import { colour, extent } from "./picture.mjs";

// How far the balls get in a run, with their radii.
export function reach({ path, offset, radius, width }) {
  const low = extent(path.map((x, j) => x + offset[j % width] - radius[j % width]))[0];
  return [low, extent(path.map((x, j) => x + offset[j % width] + radius[j % width]))[1]];
}

// Axis and scale; the largest ball must fit across, so that all are drawn true to scale.
export function beginBalls(picture, run, [low, high]) {
  const { upright } = run, blank = () => picture.begin([low, high], [low, high]);
  blank();
  const along = upright ? picture.b - picture.t : picture.r - picture.l, across = upright ? picture.r - picture.l : picture.b - picture.t;
  const widest = 2.2 * run.radius.reduce((a, b) => Math.max(a, b), 0), scale = Math.min(along / (high - low || 1), across / (widest || 1e-300));
  const rest = (along / scale - (high - low)) * (upright ? 0 : 0.5), range = [low - rest, low - rest + along / scale];
  picture.begin(range, range);
  picture.scale = scale;
  if (upright) picture.leftAxis("m", "height");
  else {
    const [unit, name] = unitFor(Math.max(...range.map(Math.abs)), "m");
    picture.bottomAxis(ticks(range.map((x) => x / unit), along / 90).map((m) => [m * unit, tickName(m)]), `position, ${name}`);
  }
  picture.keep();
}

export function drawBalls(picture, run, t, glow) {
  picture.again();
  const { pen, scale } = picture, { radius, upright } = run, row = positionsAt(run, t, (picture.row ??= new Float32Array(run.width)));
  const middle = upright ? (picture.l + picture.r) / 2 : (picture.t + picture.b) / 2;
  const place = (x) => (upright ? [middle, picture.y(x)] : [picture.x(x), middle]);
  for (let i = 0; i < run.width; i++) {
    if (run.walls.includes(run.bodies[i])) wall(picture, place(row[i]), upright);
    else ball(picture, run, i, place(row[i]), Math.max(0.9, radius[i] * scale));
  }
  for (const i of underWay(run, t, glow)) {
    const body = nearest(run.bodies, run.contacts.pair[i]), next = Math.min(body + 1, run.width - 1);
    const [x, y] = place((row[body] + radius[body] + row[next] - radius[next]) / 2);
    const [along, across] = upright ? [middle - picture.l, 3] : [3, picture.b - picture.t];
    pen.fillStyle = colour("--ink");
    if (upright) [-1, 1].forEach((side) => pen.fillRect(x + side * along * 0.92 - 5, y - across / 2, 10, across));
    else pen.fillRect(x - along / 2, picture.t, along, 8);
  }
}

function ball({ pen }, run, i, [x, y], r) {
  pen.beginPath();
  pen.arc(x, y, r, 0, 7);
  pen.fillStyle = colour(r < 3 ? `--${run.engine}` : `--${run.engine}-ball`);
  pen.fill();
  if (r < 3) return;
  Object.assign(pen, { strokeStyle: colour(`--${run.engine}`), lineWidth: 1.4 });
  pen.stroke();
  if (r < 2 + 3 * String(run.bodies[i]).length) return;
  Object.assign(pen, { fillStyle: colour("--ink"), textAlign: "center" });
  pen.fillText(String(run.bodies[i]), x, y + 4);
}

function wall(picture, [x, y], upright) {
  picture.stroke("--ink", 2.4, () => {
    if (upright) (picture.pen.moveTo(picture.l, y), picture.pen.lineTo(picture.r, y));
    else (picture.pen.moveTo(x, picture.t), picture.pen.lineTo(x, picture.b));
  });
}

function nearest(bodies, pair) {
  let low = 0, high = bodies.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (bodies[middle] <= pair) low = middle;
    else high = middle - 1;
  }
  return low;
}
