// The breakdown curve over the gap: a first sketch at once, refined in the time that is left over. A tap sets the gap.
import { Chart, decadeName, decades, tickName, ticks } from "../shell/axes.mjs";
import { $, h, marked } from "../shell/dom.mjs";
import { breakdown } from "../physics/breakdown.mjs";
import { sceneOf, SETUPS } from "../physics/setups.mjs";

const FIRST = 5, SLICE = 6, PATIENCE = 100, GAPS = [1e-7, 1e-2]; // ms: first sketch, later slices, quiet before them

export class Curve {
  constructor(pick) {
    this.chart = new Chart($(".curve"), { height: 310, label: "breakdown curve", top: 26 });
    this.chart.svg.addEventListener("click", (event) => {
      const box = this.chart.svg.getBoundingClientRect();
      pick(10 ** this.chart.back(((event.clientX - box.left) * this.chart.width) / box.width));
    });
    this.job = 0;
  }

  load(name, values) {
    const setup = SETUPS[name];
    Object.assign(this, { name, values, setup, drawn: -Infinity });
    const { eps, k } = values, make = (gap) => sceneOf(name, { ...values, gap });
    this.work = breakdown({ make, observable: setup.measure(eps), eps, k, gaps: GAPS });
    this.points = [];
    $(".curve-key").replaceChildren(
      ...marked(setup.measureName), " over the gap ", h("span", { class: "hard" }, "╌ hard"), " ", h("span", { class: "soft" }, "─ soft"),
      " dots: where the number of contacts jumps; tap to set the gap",
    );
    clearTimeout(this.job);
    this.advance(FIRST);
  }

  advance(budget) {
    const stop = performance.now() + budget;
    let step = { done: false };
    while (!step.done && (performance.now() < stop || this.points.length < 5)) {
      step = this.work.next();
      if (!step.done) this.points = step.value;
    }
    const now = performance.now();
    if (step.done || now - this.drawn > 120) {
      this.draw();
      this.drawn = now;
    }
    if (!step.done) this.job = setTimeout(() => this.advance(SLICE), budget === FIRST ? PATIENCE : 24);
    this.chart.svg.classList.toggle("done", Boolean(step.done));
  }

  draw() {
    const { chart, points, values } = this, xs = GAPS.map(Math.log10);
    const finite = points.flatMap((p) => [p.soft, p.hard]).filter(Number.isFinite), top = Math.max(1, ...finite), bottom = Math.min(0, ...finite);
    chart.scales(xs, [bottom - 0.02 * top, 1.12 * top]);
    chart.xTicks(decades(xs), decadeName, "gap Δh in m");
    chart.yTicks(ticks([bottom, 1.1 * top], 5), tickName);
    chart.line(points.map((p) => [p.x, p.hard]), { class: "hard-line" });
    for (const run of steady(points)) chart.line(run.map((p) => [p.x, p.soft]), { class: "soft-line strong" });
    this.drawJumps();
    const here = values.gap > 0 ? Math.max(xs[0], Math.log10(values.gap)) : xs[0];
    chart.playhead(here);
  }

  drawJumps() {
    const { chart, points } = this;
    let lastX = -Infinity;
    for (const run of steady(points)) {
      const middle = (chart.x(run[0].x) + chart.x(run[run.length - 1].x)) / 2;
      if (run[0] !== points[0]) chart.add("circle", { class: "jump", cx: chart.x(run[0].x).toFixed(1), cy: chart.y(run[0].soft).toFixed(1), r: 2.5 });
      if (middle - lastX < 26 || Number.isNaN(run[0].contacts)) continue;
      chart.note(String(run[0].contacts), { x: middle.toFixed(1), y: 16, "text-anchor": "middle", class: "count" });
      lastX = middle;
    }
    chart.note("contacts", { x: chart.left - 6, y: 16, "text-anchor": "end", class: "count-name" });
  }
}

// Runs of neighbouring points with one number of contacts.
function steady(points) {
  const runs = [];
  for (const point of points) {
    const last = runs[runs.length - 1];
    if (last && last[0].contacts === point.contacts) last.push(point);
    else runs.push([point]);
  }
  return runs;
}
