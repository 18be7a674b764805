// Charts over time: contact timeline, forces, paths; one common axis, one playhead.
import { Chart, tickName, ticks } from "../shell/axes.mjs";
import { quantity, unitFor } from "../shell/format.mjs";
import { softForce } from "../physics/traces.mjs";
import { $ } from "../shell/dom.mjs";
import { plain } from "./words.mjs";
import { max, min, round } from "../physics/numbers.mjs";

const SAMPLES = 24; // of the force in one contact, fewer where there are many

export class TimeCharts {
  constructor() {
    this.timeline = new Chart($(".timeline"), { height: 60 });
    this.forces = new Chart($(".forces"), { height: 120, top: 4 });
    this.paths = new Chart($(".paths"), { height: 190 });
    this.all = [this.timeline, this.forces, this.paths];
  }

  // Returns what is to be drawn, by name.
  load(report, span, samples) {
    Object.assign(this, { report, span, samples });
    [this.unit, this.unitName] = unitFor(span[1] - span[0], "s");
    this.end = (span[1] - span[0]) / this.unit;
    return { timeline: () => this.drawTimeline(), forces: () => this.drawForces(), paths: () => this.drawPaths() };
  }

  clock(t) {
    return (t - this.span[0]) / this.unit;
  }

  timeAxis(chart) {
    chart.xTicks(ticks([0, this.end], 6), tickName, plain("time-in", { unit: this.unitName }));
  }

  drawTimeline() {
    const { report: { soft, hard, pairs, scene } } = this, n = pairs.length, chart = this.timeline;
    chart.resize(48 + 24 * n);
    chart.scales([0, this.end], [-0.6, n - 0.4]);
    this.timeAxis(chart);
    chart.yTicks(pairs.map((p) => p.pair), (c) => shortName(scene, c));
    const bars = soft.contacts.map(({ pair, begin, end }) => {
      const x = chart.x(this.clock(begin)), width = chart.x(this.clock(Number.isNaN(end) ? this.span[1] : end)) - x;
      return `M${x.toFixed(1)} ${chart.y(pair) + 1}h${max(1.5, width).toFixed(1)}v8H${x.toFixed(1)}z`;
    });
    const marks = hard.contacts.slice(0, 1500).map(({ begin, pair }) => `M${chart.x(this.clock(begin)).toFixed(1)} ${chart.y(pair) - 9}v8`);
    chart.add("path", { class: "soft-bar", d: bars.join("") });
    chart.add("path", { class: "hard-mark", d: marks.join("") });
    const said = pairs.map((p) => `${shortName(scene, p.pair)}: ${plain("hard")} ${p.hard}, ${plain("soft")} ${p.soft}`).join("; ");
    chart.finish(plain("timeline-said", { said }));
  }

  // One lane a pair, each to its own scale: the forces of neighbours may differ by a thousand.
  drawForces() {
    const { report: { soft, scene }, forces: chart } = this, n = scene.gap.length, lane = n <= 3 ? 62 : n <= 5 ? 44 : 34;
    chart.resize((n + 0.2) * lane + 42);
    chart.scales([0, this.end], [-0.2, n]);
    this.timeAxis(chart);
    chart.yTicks(scene.gap.map((_, c) => c), (c) => shortName(scene, c));
    const curves = soft.contacts.map((contact) => [contact.pair, this.forceCurve(contact)]), peaks = [];
    for (let c = 0; c < n; c++) {
      const own = curves.filter(([pair]) => pair === c).map(([, curve]) => curve), peak = max(0, ...own.flat().map(([, f]) => f));
      const lines = own.map((curve) => curve.map(([t, f]) => [this.clock(t), c + (0.86 * f) / peak]));
      chart.lines(lines, { class: "soft-line force", fill: "var(--soft)" });
      if (peak > 0) peaks.push(`${shortName(scene, c)}: ${quantity(peak, "N", 2)}`);
      if (peak > 0) chart.note(quantity(peak, "N", 2), chart.width - 16, chart.y(c + 1) + 13, "axis-name", "end");
    }
    chart.finish(plain("forces-said", { said: peaks.join("; ") }));
  }

  forceCurve({ pair, begin, end }) {
    const stop = Number.isNaN(end) ? min(this.span[1], this.report.soft.time) : end, points = [[begin, 0]];
    const n = min(SAMPLES, max(6, round(400 / this.report.soft.contacts.length)));
    for (let i = 0; i <= n; i++) {
      const t = begin + ((i + (i === 0 ? 1e-6 : 0) - (i === n ? 1e-6 : 0)) / n) * (stop - begin);
      points.push([t, softForce(this.report.soft, pair, t)]);
    }
    return [...points, [stop, 0]];
  }

  drawPaths() {
    const { samples: { times, low, high }, paths: chart } = this;
    const [unit, name] = unitFor(high - low, "m"), pad = 0.06 * (high - low);
    chart.scales([0, this.end], [(low - pad) / unit, (high + pad) / unit]);
    this.timeAxis(chart);
    chart.yTicks(ticks([low / unit, high / unit], 4), tickName, name);
    const clock = times.map((t) => this.clock(t));
    for (const engine of ["soft", "hard"]) {
      const lines = this.report.scene.mass.map((_, i) => this.samples[engine].map((row, j) => [clock[j], row[i] / unit]));
      chart.lines(lines, { class: `${engine}-line` });
    }
    chart.finish(plain("paths-said", { n: this.report.scene.mass.length, height: [high, "m"] }));
  }

  show(t) {
    for (const chart of this.all) chart.playhead(this.clock(t));
  }
}

export const shortName = (scene, c) => (scene.mass[0] === Infinity ? (c === 0 ? `${plain("floor")}–1` : `${c}–${c + 1}`) : `${c + 1}–${c + 2}`);
