// A canvas with axes: ticks, units, a grid; what is drawn is kept, so that a playhead or balls may go over it.
import { tickName, ticks } from "../shell/axes.mjs";
import { h } from "../shell/dom.mjs";
import { digits, unitFor } from "../shell/format.mjs";

// The same in all pictures over time: their playheads stand below each other.
const AROUND = { left: 62, right: 14, top: 18, bottom: 36 };

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Picture {
  constructor(host, height, label, margin = {}) {
    this.canvas = h("canvas", { role: "img", "aria-label": label });
    Object.assign(this, { height, margin: { ...AROUND, ...margin } });
    host.append(this.canvas);
  }

  // A blank canvas of the width it has now, with scales from data to pixels.
  begin(xs, ys) {
    const ratio = matchMedia("print").matches ? 3 : Math.min(2, devicePixelRatio || 1), width = this.canvas.clientWidth || 600, { left, right, top, bottom } = this.margin;
    [this.canvas.width, this.canvas.height] = [width * ratio, this.height * ratio];
    this.canvas.style.height = `${this.height}px`;
    Object.assign(this, { width, xs, ys, l: left, r: width - right, t: top, b: this.height - bottom, pen: this.canvas.getContext("2d") });
    this.pen.scale(ratio, ratio);
    this.pen.font = "12px system-ui, 'Segoe UI', Roboto, sans-serif";
    this.x = (v) => this.l + ((v - xs[0]) / (xs[1] - xs[0])) * (this.r - this.l);
    this.y = (v) => this.b - ((v - ys[0]) / (ys[1] - ys[0])) * (this.b - this.t);
    return this.pen;
  }

  back(px) {
    return this.xs[0] + ((px - this.l) / (this.r - this.l)) * (this.xs[1] - this.xs[0]);
  }

  timeAxis() {
    const { unit, name, offset } = timeUnit(this.xs), marks = ticks(this.xs.map((t) => (t - offset) / unit), (this.r - this.l) / 90);
    this.bottomAxis(marks.map((m) => [offset + m * unit, tickName(m)]), offset ? `time since ${digits(offset, 15)} s, ${name}` : `time, ${name}`);
  }

  bottomAxis(marks, name) {
    this.words("center", marks.map(([v, said]) => [said, Math.min(this.x(v), this.r - 4), this.b + 14]));
    this.grid(marks.map(([v]) => [this.x(v), this.t, this.x(v), this.b]));
    this.words("right", [[name, this.r, this.b + 30]]);
  }

  // Ticks at the left, in a unit of their own: a quantity in `base` units.
  leftAxis(base, name) {
    const [low, high] = this.ys, [unit, said] = unitFor(Math.max(Math.abs(low), Math.abs(high)), base);
    const marks = ticks([low / unit, high / unit], Math.max(2, (this.b - this.t) / 45)).map((m) => [m * unit, tickName(m)]);
    this.namedAxis(marks, `${name}, ${said}`);
  }

  namedAxis(marks, name) {
    this.words("right", marks.map(([v, said]) => [said, this.l - 6, this.y(v) + 4]));
    this.grid(marks.map(([v]) => [this.l, this.y(v), this.r, this.y(v)]));
    this.words("left", [[name, 4, 11]]);
  }

  words(side, many) {
    this.pen.fillStyle = colour("--muted");
    this.pen.textAlign = side;
    for (const [said, x, y] of many) this.pen.fillText(said, x, y);
  }

  grid(lines) {
    this.stroke("--line", 1, () => lines.forEach(([x0, y0, x1, y1]) => (this.pen.moveTo(x0, y0), this.pen.lineTo(x1, y1))));
  }

  stroke(ink, width, path, dash = []) {
    this.pen.setLineDash(dash);
    Object.assign(this.pen, { strokeStyle: colour(ink), lineWidth: width, lineJoin: "round" });
    this.pen.beginPath();
    path();
    this.pen.stroke();
    this.pen.setLineDash([]);
  }

  // What lies outside the axes is not drawn.
  inside(draw) {
    this.pen.save();
    this.pen.beginPath();
    this.pen.rect(this.l, this.t, this.r - this.l, this.b - this.t);
    this.pen.clip();
    draw(this.pen);
    this.pen.restore();
  }

  keep() {
    this.kept ??= document.createElement("canvas");
    [this.kept.width, this.kept.height] = [this.canvas.width, this.canvas.height];
    this.kept.getContext("2d").drawImage(this.canvas, 0, 0);
  }

  again() {
    this.pen.clearRect(0, 0, this.width, this.height);
    this.pen.drawImage(this.kept, 0, 0, this.width, this.height);
  }

  head(t) {
    this.again();
    const x = this.x(t);
    if (x >= this.l - 0.5 && x <= this.r + 0.5) this.stroke("--ink", 1.2, () => (this.pen.moveTo(x, this.t), this.pen.lineTo(x, this.b)));
  }
}

// The unit of a span of time, and a round instant near its begin where that is far from zero.
export function timeUnit([t0, t1]) {
  const [unit, name] = unitFor(t1 - t0, "s"), base = 10 ** Math.floor(Math.log10(t1 - t0));
  return { unit, name, offset: Math.abs(t0) > 20 * (t1 - t0) ? Math.floor(t0 / base) * base : 0 };
}

export function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low > high ? [0, 1] : [low, high > low ? high : low + 1e-9];
}

// A range with some room at both ends.
export const roomy = ([low, high], share = 0.05) => [low - share * (high - low), high + share * (high - low)];
