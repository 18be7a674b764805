// The balls now, on one scale for all runs: upright where gravity acts, with the floor below, else from left to right.
import { tickName, ticks } from "../shell/axes.mjs";
import { digits, unitFor } from "../shell/format.mjs";
import { positionsAt, underWay } from "./decode.mjs";
import { bodyName } from "./maps.mjs";
import { colour, extent } from "./picture.mjs";

const SEEN = 0.01, ROOM = 0.3, DEEPEST = 0.6; // of the scene: displacements below are enlarged, to this; overlaps, of a radius
const BESIDE = 10; // bodies that can have their names beside them
const TINIEST = 0.9, VISIBLE = 4, CLOSE = 0.4; // radii in pixels; share of the room that a ball has

// How far the balls get in all runs, with their radii, where displacements are drawn `times` larger.
export function reach(runs, times) {
  const ends = (sign) => runs.flatMap(({ path, offset, radius, width }) => extent(path.map((x, j) => times * x + offset[j % width] + sign * radius[j % width])));
  return [Math.min(...ends(-1)), Math.max(...ends(1))];
}

// By how much displacements must be enlarged to be seen: 1 where they are large enough, else 2, 5, 10, …
export function enlargement(runs) {
  const [low, high] = reach(runs, 1), paths = runs.map(({ path }) => extent(path)), least = Math.min(...runs.flatMap(({ radius }) => [...radius].filter(Boolean)));
  const top = (values) => values.reduce((a, b) => Math.max(a, b), 0);
  const moved = top(runs.map(({ path, width }) => top(path.map((x, j) => Math.abs(x - path[j % width])))));
  const depth = top(runs.map(({ path, width }) => top(path.map((x, j) => (j % width ? path[j - 1] - x : 0)))));
  const way = Math.max(...paths.map(([, b]) => b)) - Math.min(...paths.map(([a]) => a));
  if (!(moved > 0 && moved < SEEN * (high - low))) return 1;
  const most = Math.min((ROOM * (high - low)) / way, (DEEPEST * least) / (depth || 1e-300)), ten = 10 ** Math.floor(Math.log10(most));
  return Math.max(1, [5, 2, 1].find((n) => n * ten <= most) * ten);
}

// Axis and scale; the largest ball must fit across, so that all are drawn true to scale, but for those that would be specks.
// Returns what is to be said of that.
export function beginBalls(picture, run, [low, high], times) {
  const { upright } = run, blank = () => picture.begin([low, high], [low, high]);
  blank();
  const along = upright ? picture.b - picture.t : picture.r - picture.l, across = upright ? picture.r - picture.l : picture.b - picture.t;
  const widest = 2.2 * run.radius.reduce((a, b) => Math.max(a, b), 0), scale = Math.min(along / (high - low || 1), across / (widest || 1e-300));
  const rest = (along / scale - (high - low)) * (upright ? 0 : 0.5), range = [low - rest, low - rest + along / scale];
  picture.begin(range, range);
  const smallest = scale * Math.min(...[...run.radius].filter(Boolean)), least = Math.max(TINIEST, Math.min(VISIBLE, (CLOSE * along) / run.width));
  Object.assign(picture, { scale, least, times });
  if (times > 1) picture.grid([]);
  else if (upright) picture.leftAxis("m", "height");
  else {
    const [unit, name] = unitFor(Math.max(...range.map(Math.abs)), "m");
    picture.bottomAxis(ticks(range.map((x) => x / unit), along / 90).map((m) => [m * unit, tickName(m)]), `position, ${name}`);
  }
  picture.keep();
  const notes = ["balls now"];
  if (times > 1) notes.push(`displacements and overlaps × ${digits(times)}`);
  if (smallest < least) notes.push(`smallest drawn × ${digits(least / smallest, 2)}`);
  return notes.join("; ");
}

export function drawBalls(picture, run, t, glow) {
  picture.again();
  const { pen, scale } = picture, { radius, upright } = run, row = positionsAt(run, t, (picture.row ??= new Float32Array(run.width)), picture.times);
  const middle = upright ? (picture.l + picture.r) / 2 : (picture.t + picture.b) / 2;
  const place = (x) => (upright ? [middle, picture.y(x)] : [picture.x(x), middle]);
  for (let i = 0; i < run.width; i++) {
    if (run.walls.includes(run.bodies[i])) wall(picture, place(row[i]), upright);
    else ball(picture, run, i, place(row[i]), Math.max(picture.least, radius[i] * scale));
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
  const name = bodyName(run, run.bodies[i]);
  const isInside = r > 2 + 3 * name.length;
  if (!isInside && !run.upright) return;
  Object.assign(pen, { fillStyle: colour("--ink"), textAlign: isInside ? "center" : "left" });
  if (isInside || run.width <= BESIDE) pen.fillText(name, isInside ? x : x + r + 3, y + 4);
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
