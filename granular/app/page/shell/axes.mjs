// A chart: an SVG in its own pixels, redrawn when its width changes, with ticks, grid lines and a plot area. What is drawn
// is written down first; `finish` hands the browser only what has changed.
import { markup, set, svg, tenths } from "./dom.mjs";
import { digits, superscript } from "./format.mjs";

const MARGIN = { left: 56, right: 18, top: 8, bottom: 38 };

const widthIn = (host) => Math.max(200, host.clientWidth);

export class Chart {
  constructor(host, { height, left = MARGIN.left, top = MARGIN.top }) {
    Object.assign(this, { host, height, top, left });
    this.grid = svg("g", { class: "grid" });
    [this.body, this.words] = ["body", "words"].map((name) => svg("g", { class: name }));
    this.head = svg("line", { class: "playhead", y1: top - 4, y2: height - MARGIN.bottom, visibility: "hidden" });
    this.svg = svg("svg", { role: "img", height, class: "chart" }, this.grid, this.body, this.head, this.words);
    host.append(this.svg);
    this.width = 600;
    this.resize(height);
  }

  get isOff() {
    return this.host.clientWidth > 0 && this.width !== widthIn(this.host);
  }

  // Asking for a width makes the browser lay out the page: of all charts at once, at the start and when a width changes.
  static measure(charts) {
    const widths = charts.map(({ host, width }) => (host.clientWidth ? widthIn(host) : width));
    charts.forEach((chart, i) => {
      chart.width = widths[i];
      chart.resize(chart.height);
    });
  }

  resize(height) {
    this.height = height;
    set(this.svg, { width: this.width, height, viewBox: `0 0 ${this.width} ${height}` });
    set(this.head, { y2: height - MARGIN.bottom });
  }

  // Scales from data to pixels; `log` takes the axis in decades.
  scales([x0, x1], [y0, y1]) {
    const [l, r, t, b] = [this.left, this.width - MARGIN.right, this.top, this.height - MARGIN.bottom];
    this.x = (v) => l + ((v - x0) / (x1 - x0)) * (r - l);
    this.y = (v) => b - ((v - y0) / (y1 - y0)) * (b - t);
    this.back = (px) => x0 + ((px - l) / (r - l)) * (x1 - x0);
    [this.xs, this.ys] = [[x0, x1], [y0, y1]];
    [this.frame, this.marks, this.notes, this.nameY] = ["", "", "", ""];
  }

  // `said`: what there is to be seen, for who does not see it.
  finish(said) {
    set(this.svg, { "aria-label": said });
    for (const [group, written] of [[this.grid, this.frame], [this.body, this.marks], [this.words, this.notes + this.nameY]]) {
      if (group.written !== written) group.innerHTML = group.written = written;
    }
  }

  xTicks(values, format, name) {
    const b = this.height - MARGIN.bottom;
    for (const v of values) {
      const x = this.x(v);
      this.frame += markup("line", { x1: x, x2: x, y1: this.top, y2: b });
      if (format) this.frame += markup("text", { x, y: b + 14, "text-anchor": "middle" }, format(v));
    }
    if (name) this.frame += markup("text", { x: this.width - MARGIN.right, y: b + 31, "text-anchor": "end", class: "axis-name" }, name);
  }

  yTicks(values, format, name) {
    for (const v of values) {
      const y = this.y(v);
      this.frame += markup("line", { x1: this.left, x2: this.width - MARGIN.right, y1: y, y2: y });
      this.frame += markup("text", { x: this.left - 6, y: y + 4, "text-anchor": "end" }, format(v));
    }
    this.nameY = name ? markup("text", { x: this.left + 6, y: this.top + 10, class: "axis-name" }, name) : "";
  }

  add(tag, attributes) {
    this.marks += markup(tag, attributes);
  }

  note(content, x, y, name = "axis-name", anchor = "start") {
    this.notes += markup("text", { x, y, "text-anchor": anchor, class: name }, content);
  }

  // Lines through [x, y] data, all in one element; a break where y is not a number.
  lines(many, attributes) {
    let d = "";
    for (const points of many) {
      let pen = "M";
      for (const [px, py] of points) {
        if (Number.isNaN(py)) pen = "M";
        else {
          d += `${pen}${tenths(this.x(px))} ${tenths(this.y(py))}`;
          pen = "L";
        }
      }
    }
    this.add("path", { fill: "none", ...attributes, d });
  }

  line(points, attributes) {
    this.lines([points], attributes);
  }

  playhead(value) {
    if (!this.xs) return; // nothing is drawn yet
    const x = this.x(value).toFixed(1), hidden = value < this.xs[0] || value > this.xs[1];
    set(this.head, { x1: x, x2: x, visibility: hidden ? "hidden" : "visible" });
  }
}

// Round tick values, about `count` of them.
export function ticks([low, high], count = 5) {
  const raw = (high - low) / count, base = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * base).find((s) => s >= raw * 0.999), found = [];
  for (let v = Math.ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) found.push(Math.abs(v) < 1e-12 * step ? 0 : v);
  return found;
}

export const decades = ([low, high]) => {
  const found = [];
  for (let e = Math.ceil(low - 1e-9); e <= high + 1e-9; e++) found.push(e);
  return found;
};
export const decadeName = (e) => `10${superscript(String(e))}`;
export const tickName = (v) => digits(v, 4);
