// One engine's balls in a row, where nothing falls. Paths and overlaps are drawn larger than the balls.
import { set, svg, text } from "../shell/dom.mjs";
import { face } from "./drawn.mjs";
import { Lens } from "./lens.mjs";
import { plain } from "./words.mjs";
import { max, min, sum } from "../physics/numbers.mjs";

export class Lying {
  constructor(engine, host) {
    Object.assign(this, { engine, svg: host, lens: new Lens(engine), title: svg("text", { x: 10, y: 20, class: "stage-name" }) });
  }

  layout(report, film, { samples: { low, high, depth }, watched }, [w, tall]) {
    const { radius } = report.scene, unit = min(36, 0.25 * w, 0.6 * tall - 39, (0.3 * (w - 2 * lensSize(w, tall) - 28)) / radius.length) / max(...radius);
    Object.assign(this, { film, low, w, tall, watched, radii: radius.map((r) => r * unit) });
    const length = w - (watched ? 2 * lensSize(w, tall) + 28 : 0), room = length - 2 * sum(this.radii) - 24;
    const sinks = max(...depth.map((d, c) => d / (0.6 * min(this.radii[c], this.radii[c + 1]))));
    this.scale = min(room / (high - low), 1 / sinks);
    this.draw(report);
    const r = lensSize(w, tall);
    if (watched) this.lens.layout({ cx: w - r - 14, cy: 0.5 * tall, r, upright: false, range: watched.range, least: watched.least, natural: unit });
    return this.scale / unit;
  }

  draw(report) {
    const { w, tall, engine } = this, shape = JSON.stringify([this.radii, w, tall, this.watched?.pair]), spheres = { say: `${engine}-spheres` };
    text(this.title, plain(spheres.say));
    set(this.svg, { viewBox: `0 0 ${w} ${tall}`, "aria-label": plain("stage-said", { engine: spheres, n: report[engine].contacts.length }) });
    if (shape === this.shape && this.svg.contains(this.title)) return;
    this.shape = shape;
    this.balls = this.radii.map((r, i) => discOf(r, i));
    this.marks = this.radii.slice(1).map(() => svg("line", { class: "mark" }));
    this.svg.replaceChildren(...this.balls, ...this.marks, ...(this.watched ? [this.lens.element] : []), this.title);
  }

  // Heights have the radii taken out; the drawn radii are put back in.
  show(frame, press) {
    const heights = this.film.heights(this.engine, frame.time), middle = 0.6 * this.tall;
    let stacked = 12;
    const at = heights.map((y, i) => {
      const centre = stacked + this.radii[i] + (y - this.low) * this.scale;
      stacked += 2 * this.radii[i];
      return centre;
    });
    at.forEach((x, i) => set(this.balls[i], { transform: `translate(${x.toFixed(2)} ${middle})` }));
    const touch = this.marks.map((_, c) => (at[c] + this.radii[c] + at[c + 1] - this.radii[c + 1]) / 2);
    this.marks.forEach((mark, c) => {
      const half = min(6 + 20 * press[c], 1.4 * max(this.radii[c], this.radii[c + 1])), x = touch[c].toFixed(1);
      set(mark, { x1: x, x2: x, y1: middle - half, y2: middle + half, opacity: press[c].toFixed(3) });
    });
    const c = this.watched?.pair;
    if (c !== undefined) this.lens.show(heights[c + 1] - heights[c], [touch[c], middle]);
  }
}

const lensSize = (w, tall) => min(0.26 * tall, 0.11 * w);

function discOf(r, i) {
  const body = svg("g", { transform: `scale(${r})`, class: "face" }), label = svg("text", { class: "ball-name", "text-anchor": "middle", y: -r - 7 });
  body.innerHTML = face("steel-ball");
  text(label, String(i + 1));
  return svg("g", { class: "ball" }, body, label);
}
