// The two scenes side by side. Balls are drawn far smaller against their paths than they are: gaps would be invisible.
import { $, set, svg, text } from "../shell/dom.mjs";
import { hardHeights, largestForce, softForces, softHeights } from "../physics/traces.mjs";
import { Lens } from "./lens.mjs";
import { plain, told } from "./words.mjs";

const MIDDLE = 0.42; // of the width: where balls stand
const FLASH = 0.02; // share of the span for which a hard collision stays visible

export class Stage {
  constructor(host) {
    this.host = host;
    this.views = ["hard", "soft"].map((engine) => new View(host, engine));
  }

  load(report, span, samples, watched) {
    Object.assign(this, { report, span });
    const upright = report.scene.gravity > 0, extent = { ...samples, depth: depthIn(samples.soft, report.scene) };
    this.host.classList.toggle("upright", upright);
    this.host.classList.toggle("lying", !upright);
    this.host.parentElement.classList.toggle("flat", !upright);
    for (const view of this.views) view.look(upright);
    for (const view of this.views) view.layout(report.scene, upright, extent, watched, report[view.engine].contacts.length);
    this.forceMax = largestForce(report.soft);
    told($(".scale-note"), "scale-note", { times: [this.views[0].magnification, "", 2] });
  }

  // Asking for sizes makes the browser lay out the page: both at once, only at the start and when the window changes.
  measure() {
    for (const view of this.views) view.measure();
  }

  show(t) {
    const { soft, hard } = this.report, fade = FLASH * (this.span[1] - this.span[0]);
    const press = softForces(soft, t).map((f) => Math.sqrt(f / this.forceMax));
    const flash = press.map((_, c) => {
      const last = hard.contacts.reduce((s, k) => (k.pair === c && k.begin <= t ? Math.max(s, k.begin) : s), -Infinity);
      return Math.max(0, 1 - (t - last) / fade);
    });
    this.views[0].show(hardHeights(hard, t), flash);
    this.views[1].show(softHeights(soft, t), press);
  }
}

// How deep each pair sinks in.
const depthIn = (rows, scene) => scene.gap.map((_, c) => rows.reduce((most, y) => Math.max(most, y[c] - y[c + 1]), 0));

class View {
  constructor(host, engine) {
    this.engine = engine;
    this.edge = engine === "hard" ? 1.5 : 0.8; // half a line: balls touch where their outlines do
    this.svg = svg("svg", { role: "img", class: engine });
    this.lens = new Lens(engine);
    host.append(this.svg);
  }

  measure() {
    this.size = null;
  }

  look(upright) {
    if (upright !== this.upright || !this.size) this.size = [this.svg.clientWidth || 280, this.svg.clientHeight || 320];
  }

  layout(scene, upright, { low, high, depth }, watched, count) {
    const [w, tall] = this.size, length = upright ? tall : w - (watched ? 2 * lyingLens(w, tall) + 28 : 0), largest = Math.max(...scene.radius);
    const cap = Math.min(upright ? 74 : 36, 0.25 * w), fit = ((upright ? 0.52 : 0.6) * length) / 2;
    const raw = scene.radius.map((r) => (r === 0 ? 0 : Math.max(0.16, Math.sqrt(r / largest))));
    const unit = Math.min(cap, fit / raw.reduce((a, b) => a + b, 0));
    this.radii = raw.map((r) => r * unit);
    const room = length - 2 * this.radii.reduce((a, b) => a + b, 0) - (upright ? 46 : 24);
    const side = (i) => this.radii[i] || Infinity, sinks = Math.max(...depth.map((d, c) => d / (0.6 * Math.min(side(c), side(c + 1)))));
    Object.assign(this, { upright, w, tall, low, watched, count, scale: Math.min(room / (high - low), 1 / sinks) });
    this.magnification = this.scale / (unit / largest);
    this.draw();
    set(this.cut, { height: this.isCut ? tall - 16 + low * this.scale : tall });
    if (watched) this.lens.layout({ ...this.lensPlace(), upright, range: watched.range, natural: unit / largest });
  }

  // On the right: above where balls stand upright, beside them where they lie.
  lensPlace() {
    const { w, tall, upright } = this, r = upright ? Math.min(48, 0.17 * w) : lyingLens(w, tall);
    return upright ? { cx: w - r - 12, cy: Math.max(r + 46, 0.3 * tall), r } : { cx: w - r - 14, cy: 0.5 * tall, r };
  }

  draw() {
    const { w, tall, upright } = this, shape = JSON.stringify([upright, this.radii, w, tall, this.watched?.pair]);
    if (shape === this.shape) return this.name();
    this.shape = shape;
    set(this.svg, { viewBox: `0 0 ${w} ${tall}` });
    const id = `above-${this.engine}`;
    this.title = svg("text", { x: 10, y: 20, class: "stage-name" });
    this.balls = this.radii.map((r, i) => (r ? svg("g", { class: "ball" }, svg("circle", { r: Math.max(1, r - this.edge) }), numberOf(i, r, upright)) : this.ground()));
    this.marks = this.radii.slice(1).map(() => svg("line", { class: "mark" }));
    this.isCut = upright && this.radii[0] === 0; // a ball that sinks in is flattened by the floor
    this.cut = svg("rect", { x: 0, y: 0, width: w });
    const [floor, ...others] = this.isCut ? this.balls : [null, ...this.balls];
    this.svg.replaceChildren(svg("clipPath", { id }, this.cut), svg("g", { "clip-path": `url(#${id})` }, ...others), ...(floor ? [floor] : []), ...this.marks, ...(this.watched ? [this.lens.element] : []), this.title);
    this.name();
  }

  name() {
    text(this.title, plain(`${this.engine}-spheres`));
    set(this.svg, { "aria-label": plain("stage-said", { engine: { say: `${this.engine}-spheres` }, n: this.count }) });
  }

  ground() {
    const left = MIDDLE * this.w;
    return svg("g", { class: "floor" }, svg("line", { x1: 10 - left, x2: this.w - left - 10 }));
  }

  // Heights have the radii taken out; the drawn radii are put back in.
  show(heights, press) {
    let stacked = 0;
    const at = heights.map((y, i) => {
      const centre = stacked + this.radii[i] + (y - this.low) * this.scale;
      stacked += 2 * this.radii[i];
      return centre;
    });
    at.forEach((z, i) => set(this.balls[i], { transform: `translate(${this.place(z)})` }));
    const touch = this.marks.map((_, c) => (c === 0 && this.isCut ? at[0] : (at[c] + this.radii[c] + at[c + 1] - this.radii[c + 1]) / 2));
    this.marks.forEach((mark, c) => {
      const half = Math.min(6 + 20 * press[c], 1.4 * Math.max(this.radii[c], this.radii[c + 1])), across = this.upright ? { x1: -half, x2: half, y1: 0, y2: 0 } : { x1: 0, x2: 0, y1: -half, y2: half };
      set(mark, { transform: `translate(${this.place(touch[c])})`, opacity: press[c].toFixed(3), ...across });
    });
    const c = this.watched?.pair;
    if (c !== undefined) this.lens.show(heights[c + 1] - heights[c], this.place(touch[c]).split(" "));
  }

  place(z) {
    return this.upright ? `${(MIDDLE * this.w).toFixed(1)} ${(this.tall - 16 - z).toFixed(2)}` : `${(12 + z).toFixed(2)} ${0.6 * this.tall}`;
  }
}

const lyingLens = (w, tall) => Math.min(0.26 * tall, 0.11 * w);

function numberOf(i, r, upright) {
  const inside = r > 9, beside = inside ? {} : upright ? { x: (i % 2 ? 1 : -1) * (r + 9) } : { y: -r - 7 };
  const label = svg("text", { class: "ball-number", "text-anchor": "middle", dy: "0.36em", "font-size": Math.min(18, Math.max(12, 1.1 * r)), ...beside });
  text(label, String(upright ? i : i + 1));
  return label;
}
