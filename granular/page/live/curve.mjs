// The breakdown curve over the gap: a first sketch at once, refined in the time that is left over. A tap sets the gap.
import { Chart, decadeName, decades, tickName, ticks } from "../shell/axes.mjs";
import { $, h, marked, whenIdle } from "../shell/dom.mjs";
import { breakdown, SKETCH } from "../physics/breakdown.mjs";
import { sceneOf, SETUPS } from "../physics/setups.mjs";

const AT_ONCE = 2, SLICE = 6, PATIENCE = 120, GAPS = [1e-7, 1e-2]; // ms: in the picture of a move, in idle time, quiet before that

export class Curve {
  constructor(pick) {
    this.chart = new Chart($(".curve"), { height: 310, label: "breakdown curve", top: 26 });
    this.chart.svg.addEventListener("click", (event) => {
      const box = this.chart.svg.getBoundingClientRect();
      pick(10 ** this.chart.back(((event.clientX - box.left) * this.chart.width) / box.width));
    });
  }

  // The curve does not depend on the gap the page shows: moving that leaves it, and its refinement, as they are.
  load(name, values) {
    const { gap, ...others } = values, key = JSON.stringify([name, others]);
    this.gap = gap;
    if (key !== this.key) this.begin(name, values, key);
    this.draw();
  }

  begin(name, values, key) {
    const setup = SETUPS[name], { eps, k } = values, points = [];
    const make = (gap) => sceneOf(name, { ...values, gap });
    const work = breakdown({ make, observable: setup.measure(eps), eps, k, gaps: GAPS, points });
    Object.assign(this, { key, points, work });
    if (setup !== this.setup) this.title(setup);
    this.advance(AT_ONCE, SKETCH);
    clearTimeout(this.job);
    this.job = setTimeout(() => this.refine(work), PATIENCE);
  }

  title(setup) {
    this.setup = setup;
    $(".curve-key").replaceChildren(
      ...marked(setup.measureName), " over the gap ", h("span", { class: "hard" }, "╌ hard"), " ", h("span", { class: "soft" }, "─ soft"),
      ` dots: where the number of contacts jumps; tap to set the gap${setup.one ?? ""}`,
    );
  }

  // True when the curve is finished.
  advance(budget, atLeast = 1) {
    const stop = performance.now() + budget;
    let done = false;
    for (let i = 0; !done && (i < atLeast || performance.now() < stop); i++) done = this.work.next().done;
    this.chart.svg.classList.toggle("done", done);
    return done;
  }

  // In idle time, given up when another curve is wanted; drawn anew when there is a third more to see.
  refine(work) {
    if (work !== this.work) return;
    const done = this.advance(SLICE);
    if (done || this.points.length > 1.34 * this.drawn) this.draw();
    if (!done) whenIdle(() => this.refine(work));
  }

  draw() {
    const { chart, points, gap } = this, xs = GAPS.map(Math.log10);
    const finite = points.flatMap((p) => [p.soft, p.hard]).filter(Number.isFinite), top = Math.max(1, ...finite), bottom = Math.min(0, ...finite);
    chart.scales(xs, [bottom - 0.02 * top, 1.12 * top]);
    chart.xTicks(decades(xs), decadeName, "gap Δh in m");
    chart.yTicks(ticks([bottom, 1.1 * top], 5), tickName);
    chart.line(points.map((p) => [p.x, p.hard]), { class: "hard-line" });
    chart.lines(steady(points).map((run) => run.map((p) => [p.x, p.soft])), { class: "soft-line strong" });
    this.drawJumps();
    this.drawHoles("hard", "no end", 0.5);
    this.drawHoles("soft", "too stiff to follow", 0.35);
    chart.finish();
    chart.playhead(gap > 0 ? Math.max(xs[0], Math.log10(gap)) : xs[0]);
    this.drawn = points.length;
  }

  // Says why a line has a hole: along it, where there is room for the words.
  drawHoles(engine, why, share) {
    const { chart, points } = this;
    const holes = grouped(points, (p) => Number.isNaN(p[engine])).filter(([p]) => Number.isNaN(p[engine]));
    const widest = holes.map((run) => [chart.x(run[0].x), chart.x(run[run.length - 1].x)]).sort((a, b) => b[1] - b[0] - (a[1] - a[0]))[0];
    if (!widest) return;
    const middle = Math.min(chart.width - 80, Math.max(chart.left + 60, (widest[0] + widest[1]) / 2)), y = chart.y(chart.ys[0] + share * (chart.ys[1] - chart.ys[0]));
    chart.note(`${engine}: ${why}`, { x: middle.toFixed(1), y: y.toFixed(1), "text-anchor": "middle", class: `bar-value ${engine}` });
  }

  drawJumps() {
    const { chart, points } = this, runs = steady(points);
    const dots = runs.slice(1).filter(([p]) => !Number.isNaN(p.soft)).map(([p]) => `M${chart.x(p.x).toFixed(1)} ${chart.y(p.soft).toFixed(1)}h0`);
    chart.add("path", { class: "jump", d: dots.join("") });
    let lastX = -Infinity;
    for (const run of runs) {
      const middle = (chart.x(run[0].x) + chart.x(run[run.length - 1].x)) / 2;
      if (middle - lastX < 26 || Number.isNaN(run[0].contacts)) continue;
      chart.note(String(run[0].contacts), { x: middle.toFixed(1), y: 16, "text-anchor": "middle", class: "count" });
      lastX = middle;
    }
    chart.note("contacts", { x: chart.left - 6, y: 16, "text-anchor": "end", class: "count-name" });
  }
}

// Runs of neighbouring points with one number of contacts.
const steady = (points) => grouped(points, (p) => p.contacts);

function grouped(points, of) {
  const runs = [];
  for (const point of points) {
    const last = runs[runs.length - 1];
    if (last && Object.is(of(last[0]), of(point))) last.push(point);
    else runs.push([point]);
  }
  return runs;
}
