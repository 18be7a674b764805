// The breakdown curve over the gap: a first sketch at once, refined in the time that is left over. A tap sets the gap.
import { Chart, decadeName, decades } from "../shell/axes.mjs";
import { $, whenIdle } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { breakdown, LEAST, SKETCH } from "../physics/breakdown.mjs";
import { SAME } from "../physics/measures.mjs";
import { contactsIn, sceneOf, SETUPS } from "../physics/setups.mjs";
import { plain, say, told } from "./words.mjs";
import { abs, log10, max } from "../physics/numbers.mjs";

const GLIMPSE = 2, SLICE = 6, CALM = 120, ALL_GAPS = [1e-7, 0.1]; // ms: in the picture of a move, in idle time, quiet before that
const LOWEST = log10(LEAST), SAFE = log10(SAME);

export class Curve {
  constructor(pick) {
    this.chart = new Chart($(".curve"), { height: 185, left: 66, top: 26 });
    this.chart.svg.addEventListener("click", (event) => {
      const box = this.chart.svg.getBoundingClientRect();
      pick(10 ** this.chart.back(((event.clientX - box.left) * this.chart.width) / box.width));
    });
  }

  // The curve does not depend on the gap the page shows: moving that leaves it, and its refinement, as they are.
  load(name, values, safe) {
    const hasGap = SETUPS[name].sliders.some((slider) => slider.name === "gap");
    $(".curve-box").classList.toggle("none", !hasGap);
    if (!hasGap || $(".curve-box").classList.contains("off")) return (this.key = "");
    const { gap, ...others } = values, key = JSON.stringify([name, others]);
    Object.assign(this, { gap, safe });
    if (key !== this.key) this.begin(name, values, key);
    this.draw();
  }

  begin(name, values, key) {
    const points = [], { eps, k } = contactsIn(name, values);
    const work = breakdown({ make: (gap) => sceneOf(name, { ...values, gap }), eps, k, gaps: ALL_GAPS, points });
    Object.assign(this, { key, points, work });
    this.advance(GLIMPSE, SKETCH);
    clearTimeout(this.job);
    this.job = setTimeout(() => this.refine(work), CALM);
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
    if (work !== this.work || !this.key) return;
    const done = this.advance(SLICE);
    if (done || this.points.length > 1.34 * this.drawn) this.draw();
    if (!done) whenIdle(() => this.refine(work));
  }

  draw() {
    const { chart, points, gap } = this, xs = ALL_GAPS.map(log10), highest = max(0, ...points.map((p) => p.y || 0));
    const x = gap > 0 ? max(xs[0], log10(gap)) : xs[0];
    told($(".curve-key"), "curve-key");
    chart.scales(xs, [LOWEST, highest + 0.5]);
    this.shade(xs);
    chart.xTicks(decades(xs), decadeName, plain("gap-in-m"));
    chart.yTicks(decades([LOWEST, highest]), (e) => `${e > LOWEST ? "" : "≤ "}${say("percent", { n: digits(100 * 10 ** e) })}`, plain("error-axis"));
    this.markSafe(xs);
    chart.line(points.map((p) => [p.x, p.y]), { class: "soft-line strong" });
    this.drawCounts(x);
    for (const engine of ["hard", "soft"]) this.sayWhereItEnds(engine);
    chart.finish(plain("curve-said", { n: points.filter((p) => p.y < SAFE).length, of: points.length }));
    chart.playhead(x);
    this.drawn = points.length;
  }

  // Where the error is at most 1 %.
  shade(xs) {
    const { chart } = this, y = chart.y(SAFE), left = chart.x(xs[0]);
    chart.add("rect", { class: "safe", x: left, y, width: chart.x(xs[1]) - left, height: chart.y(LOWEST) - y });
    chart.note(plain("safe-zone"), left + 8, y + 16);
  }

  markSafe(xs) {
    const { chart, safe } = this, x = log10(safe);
    if (!(x > xs[0] && x < xs[1])) return;
    chart.line([[x, chart.ys[0]], [x, chart.ys[1]]], { class: "drop-line" });
    chart.note(plain("curve-mark"), chart.x(x) - 5, chart.y(LOWEST) - 8, "axis-name", "end");
  }

  // Along the line, where there is room for the words.
  sayWhereItEnds(engine) {
    const { chart, points } = this, holes = grouped(points, (p) => p.missing).filter(([p]) => p.missing === engine);
    const widest = holes.map((run) => [chart.x(run[0].x), chart.x(run[run.length - 1].x)]).sort((a, b) => b[1] - b[0] - (a[1] - a[0]))[0];
    if (!widest) return;
    const middle = (widest[0] + widest[1]) / 2, [from, to] = [chart.x(chart.xs[0]), chart.x(chart.xs[1])], third = (to - from) / 3;
    const [x, anchor] = middle < from + third ? [from + 4, "start"] : middle > to - third ? [to - 4, "end"] : [middle, "middle"], share = engine === "hard" ? 0.8 : 0.68;
    chart.add("rect", { class: "hole", x: widest[0], y: chart.top, width: max(2, widest[1] - widest[0]), height: chart.y(LOWEST) - chart.top });
    const y = chart.y(chart.ys[0] + share * (chart.ys[1] - chart.ys[0]));
    chart.note(plain(`hole-${engine}`), x, y, `bar-value ${engine}`, anchor);
  }

  // Numbers of contacts along the top: that at the marker first, the others where there is room.
  drawCounts(marker) {
    const { chart, points } = this, runs = grouped(points, (p) => p.contacts).filter(([p]) => !Number.isNaN(p.contacts)), placed = [];
    const place = (run, x) => {
      if (placed.some((other) => abs(other - x) < 6 + 8 * String(run[0].contacts).length)) return;
      placed.push(x);
      chart.note(run[0].contacts, x, 16, "count", "middle");
    };
    const here = runs.find((run) => run[0].x <= marker + 1e-9 && marker <= run[run.length - 1].x + 1e-9);
    if (here) place(here, max(chart.left + 8, chart.x(marker)));
    for (const run of [...runs].sort((a, b) => b.length - a.length)) if (run !== here) place(run, (chart.x(run[0].x) + chart.x(run[run.length - 1].x)) / 2);
    chart.note(plain("contacts-short"), 0, 16);
  }
}

// Runs of neighbouring points of one kind.
function grouped(points, of) {
  const runs = [];
  for (const point of points) {
    const last = runs[runs.length - 1];
    if (last && Object.is(of(last[0]), of(point))) last.push(point);
    else runs.push([point]);
  }
  return runs;
}
