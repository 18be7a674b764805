// Pictures of a recorded run, on canvas: the balls now, world lines (space over time), and the contact network over time.
import { h } from "../shell/dom.mjs";
import { positionsAt, underWay } from "./decode.mjs";

const INK = { hard: "--hard", soft: "--soft" };

export class Picture {
  constructor(host, height, label) {
    this.canvas = h("canvas", { role: "img", "aria-label": label });
    this.height = height;
    host.append(this.canvas);
  }

  begin() {
    const ratio = Math.min(2, devicePixelRatio || 1), width = this.canvas.clientWidth || 600;
    Object.assign(this, { width, ratio });
    [this.canvas.width, this.canvas.height] = [width * ratio, this.height * ratio];
    this.canvas.style.height = `${this.height}px`;
    this.pen = this.canvas.getContext("2d");
    this.pen.scale(ratio, ratio);
    return this.pen;
  }

  keep() {
    this.kept ??= document.createElement("canvas");
    [this.kept.width, this.kept.height] = [this.canvas.width, this.canvas.height];
    this.kept.getContext("2d").drawImage(this.canvas, 0, 0);
  }

  // The kept picture with a line at time t over it.
  head(t, [t0, t1]) {
    const { pen, width, height } = this, x = t1 > t0 ? ((t - t0) / (t1 - t0)) * width : 0;
    pen.clearRect(0, 0, width, height);
    pen.drawImage(this.kept, 0, 0, width, height);
    pen.strokeStyle = colour("--ink");
    pen.beginPath();
    pen.moveTo(x, 0);
    pen.lineTo(x, height);
    pen.stroke();
  }
}

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export function drawWorldLines(picture, run, [t0, t1], [low, high]) {
  const pen = picture.begin(), { width, height } = picture, { time, path } = run, n = run.width;
  const stride = Math.max(1, Math.ceil(n / 250));
  pen.strokeStyle = colour(INK[run.engine]);
  pen.globalAlpha = n > 60 ? 0.55 : 0.9;
  pen.lineWidth = n > 60 ? 0.6 : 1.1;
  for (let i = 0; i < n; i += stride) {
    pen.beginPath();
    for (let r = 0; r < time.length; r++) {
      const x = ((time[r] - t0) / (t1 - t0)) * width, y = height - 6 - ((path[r * n + i] - low) / (high - low)) * (height - 12);
      if (r) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    }
    pen.stroke();
  }
  picture.keep();
  return stride;
}

// Every contact is counted in the map: the darker, the more contacts are under way.
export function drawContactMap(picture, run, [t0, t1]) {
  const pen = picture.begin(), { width, height } = picture, { columns, lanes, counts } = run.map;
  const top = Math.log1p(counts.reduce((a, b) => Math.max(a, b), 1));
  const cell = { w: Math.max(1, ((run.span[1] - run.span[0]) / (t1 - t0)) * (width / columns)), h: height / lanes };
  const left = ((run.span[0] - t0) / (t1 - t0)) * width;
  pen.fillStyle = colour(INK[run.engine]);
  for (let c = 0; c < columns; c++) {
    for (let l = 0; l < lanes; l++) {
      const count = counts[c * lanes + l];
      if (!count) continue;
      pen.globalAlpha = 0.25 + (0.75 * Math.log1p(count)) / top;
      pen.fillRect(left + c * cell.w, height - (l + 1) * cell.h, Math.max(1.2, cell.w), Math.max(1, cell.h - (cell.h > 4 ? 1 : 0)));
    }
  }
  picture.keep();
}

// The balls now, left (bottom) to right (top), with bars where contacts are under way.
export function drawBalls(picture, run, t, span) {
  const pen = picture.pen ?? picture.begin(), { width, height } = picture, { radius } = run;
  const row = positionsAt(run, t, (picture.row ??= new Float32Array(run.width)));
  const [low, high] = (picture.extent ??= reach(run)), scale = (width - 8) / (high - low || 1);
  pen.clearRect(0, 0, width, height);
  pen.fillStyle = colour(INK[run.engine]);
  pen.globalAlpha = 0.75;
  for (let i = 0; i < run.width; i++) {
    const r = Math.min(height / 2 - 12, Math.max(0.8, radius[i] * scale)), x = 4 + (row[i] - low) * scale;
    pen.beginPath();
    if (run.walls.includes(run.bodies[i])) pen.rect(x - 1, 4, 2, height - 8);
    else pen.arc(x, height / 2, r, 0, 7);
    pen.fill();
  }
  pen.globalAlpha = 1;
  pen.fillStyle = colour("--ink");
  for (const i of underWay(run, t, run.engine === "hard" ? 0.006 * (span[1] - span[0]) : 0)) {
    const body = nearest(run.bodies, run.contacts.pair[i]), next = Math.min(body + 1, run.width - 1);
    pen.fillRect(4 + ((row[body] + radius[body] + row[next] - radius[next]) / 2 - low) * scale - 1, 2, 2, 6);
  }
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

// How far the balls get, with their radii.
function reach({ path, offset, radius, width }) {
  const edges = [extent(path.map((x, j) => x + offset[j % width] - radius[j % width])), extent(path.map((x, j) => x + offset[j % width] + radius[j % width]))];
  return [edges[0][0], edges[1][1]];
}

export function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high > low ? high : low + 1e-9];
}
