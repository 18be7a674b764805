// The two scenes side by side. Balls are drawn far smaller against their paths than they are: gaps would be invisible.
import { $, set, svg, text } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { hardHeights, largestForce, softForces, softHeights } from "../physics/traces.mjs";

const FLASH = 0.02; // share of the span for which a hard collision stays visible

export class Stage {
  constructor(host) {
    this.host = host;
    this.views = ["hard", "soft"].map((engine) => new View(host, engine));
  }

  load(report, span, samples) {
    Object.assign(this, { report, span });
    const upright = report.scene.gravity > 0, extent = { ...samples, depth: depthIn(samples.soft, report.scene) };
    set(this.host, { class: `stage ${upright ? "upright" : "lying"}` });
    for (const view of this.views) view.layout(report.scene, upright, extent);
    this.forceMax = largestForce(report.soft);
    text($(".scale-note"), `Paths and overlaps are drawn ${digits(this.views[0].magnification, 2)} times larger than the balls.`);
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
    this.svg = svg("svg", { role: "img", class: engine, "aria-label": engine === "hard" ? "hard spheres" : "soft spheres" });
    this.name = engine === "hard" ? "hard spheres" : "soft spheres";
    host.append(this.svg);
  }

  layout(scene, upright, { low, high, depth }) {
    const [w, tall] = upright ? [280, 520] : [560, 150], length = upright ? tall : w;
    const largest = Math.max(...scene.radius);
    const cap = upright ? 74 : 36, fit = (0.52 * length) / 2;
    const raw = scene.radius.map((r) => (r === 0 ? 0 : Math.max(0.16, Math.sqrt(r / largest))));
    const unit = Math.min(cap, fit / raw.reduce((a, b) => a + b, 0));
    this.radii = raw.map((r) => r * unit);
    const room = length - 2 * this.radii.reduce((a, b) => a + b, 0) - (upright ? 46 : 24);
    const side = (i) => this.radii[i] || Infinity, sinks = Math.max(...depth.map((d, c) => d / (0.6 * Math.min(side(c), side(c + 1)))));
    Object.assign(this, { upright, w, tall, low, scale: Math.min(room / (high - low), 1 / sinks) });
    this.magnification = this.scale / (unit / largest);
    this.draw(scene, upright);
  }

  draw(scene, upright) {
    const shape = JSON.stringify([upright, this.radii]);
    if (shape === this.shape) return;
    this.shape = shape;
    set(this.svg, { viewBox: `0 0 ${this.w} ${this.tall}` });
    const name = svg("text", { x: upright ? 8 : 10, y: 20, class: "stage-name" });
    text(name, this.name);
    this.balls = this.radii.map((r, i) => (r ? svg("g", { class: "ball" }, svg("circle", { r }), numberOf(i, r, upright)) : this.ground()));
    this.marks = scene.gap.map(() => svg("line", { class: "mark" }));
    this.svg.replaceChildren(name, ...this.balls, ...this.marks);
  }

  ground() {
    const half = this.w / 2 - 20;
    return svg("g", { class: "floor" }, svg("line", { x1: -half, x2: half }));
  }

  // Heights have the radii taken out; the drawn radii are put back in.
  show(heights, press) {
    let stacked = 0;
    const at = heights.map((y, i) => {
      const centre = stacked + this.radii[i] + (y - this.low) * this.scale;
      stacked += 2 * this.radii[i];
      return centre;
    });
    at.forEach((z, i) => set(this.balls[i], { transform: this.place(z) }));
    this.marks.forEach((mark, c) => {
      const z = (at[c] + this.radii[c] + at[c + 1] - this.radii[c + 1]) / 2, half = 6 + 20 * press[c];
      const across = this.upright ? { x1: -half, x2: half, y1: 0, y2: 0 } : { x1: 0, x2: 0, y1: -half, y2: half };
      set(mark, { transform: this.place(z), opacity: press[c].toFixed(3), ...across });
    });
  }

  place(z) {
    return this.upright ? `translate(${this.w / 2} ${(this.tall - 16 - z).toFixed(2)})` : `translate(${(12 + z).toFixed(2)} ${this.tall / 2 + 6})`;
  }
}

function numberOf(i, r, upright) {
  const label = svg("text", { class: "ball-number", "text-anchor": "middle", dy: "0.36em", "font-size": Math.min(18, 1.1 * r) });
  text(label, r > 7 ? String(upright ? i : i + 1) : "");
  return label;
}
