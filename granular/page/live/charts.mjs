// Charts over time: contact timeline, forces, paths; one common axis, one playhead.
import { Chart, tickName, ticks } from "../shell/axes.mjs";
import { quantity, unitFor } from "../shell/format.mjs";
import { hardHeights, softForce, softHeights } from "../physics/traces.mjs";
import { $ } from "../shell/dom.mjs";

const SAMPLES = 24; // of the force in one contact

export class TimeCharts {
  constructor() {
    this.timeline = new Chart($(".timeline"), { height: 60, label: "contact timeline", bottom: false });
    this.forces = new Chart($(".forces"), { height: 120, label: "contact forces in time", bottom: false, top: 4 });
    this.paths = new Chart($(".paths"), { height: 190, label: "paths of the balls" });
    this.all = [this.timeline, this.forces, this.paths];
  }

  load(report, span) {
    Object.assign(this, { report, span });
    [this.unit, this.unitName] = unitFor(span[1] - span[0], "s");
    this.end = (span[1] - span[0]) / this.unit;
    this.drawTimeline();
    this.drawForces();
    this.drawPaths();
  }

  clock(t) {
    return (t - this.span[0]) / this.unit;
  }

  time(share) {
    return this.span[0] + share * (this.span[1] - this.span[0]);
  }

  drawTimeline() {
    const { report: { soft, hard, pairs, scene } } = this, n = pairs.length, chart = this.timeline;
    chart.resize(16 + 24 * n);
    chart.scales([0, this.end], [-0.6, n - 0.4]);
    chart.xTicks(ticks([0, this.end], 6));
    chart.yTicks(pairs.map((p) => p.pair), (c) => shortName(scene, c));
    for (const contact of soft.contacts) {
      const x = chart.x(this.clock(contact.begin)), end = Number.isNaN(contact.end) ? this.span[1] : contact.end;
      const width = Math.max(1.5, chart.x(this.clock(end)) - x), y = chart.y(contact.pair) + 1;
      chart.add("rect", { class: "soft-bar", x: x.toFixed(1), y, width: width.toFixed(1), height: 8, rx: 1 });
    }
    for (const { begin, pair } of hard.contacts.slice(0, 1500)) {
      const x = chart.x(this.clock(begin)).toFixed(1), y = chart.y(pair);
      chart.add("line", { class: "hard-mark", x1: x, x2: x, y1: y - 9, y2: y - 1 });
    }
    chart.finish();
    chart.svg.setAttribute("aria-label", `contact timeline: ${pairs.map((p) => `${shortName(scene, p.pair)}: hard ${p.hard.contacts}, soft ${p.soft.contacts}`).join("; ")}`);
  }

  // One lane a pair, each to its own scale: the forces of neighbours may differ by a thousand.
  drawForces() {
    const { report: { soft, scene }, forces: chart } = this, n = scene.gap.length, lane = n <= 3 ? 62 : n <= 5 ? 44 : 34;
    chart.resize(n * lane + 10);
    chart.scales([0, this.end], [0, n]);
    chart.xTicks(ticks([0, this.end], 6));
    chart.yTicks(scene.gap.map((_, c) => c), (c) => shortName(scene, c));
    const curves = soft.contacts.map((contact) => [contact.pair, this.forceCurve(contact)]);
    for (let c = 0; c < n; c++) {
      const own = curves.filter(([pair]) => pair === c).map(([, curve]) => curve), peak = Math.max(0, ...own.flat().map(([, f]) => f));
      for (const curve of own) {
        const points = curve.map(([t, f]) => [this.clock(t), c + (0.86 * f) / peak]);
        chart.line(points, { class: "soft-line force", fill: "var(--soft)" });
      }
      if (peak > 0) chart.note(quantity(peak, "N", 2), { x: chart.width - 16, y: (chart.y(c + 1) + 13).toFixed(1), "text-anchor": "end", class: "axis-name" });
    }
    chart.finish();
  }

  forceCurve({ pair, begin, end }) {
    const stop = Number.isNaN(end) ? Math.min(this.span[1], this.report.soft.time) : end, points = [[begin, 0]];
    for (let i = 0; i <= SAMPLES; i++) {
      const t = begin + ((i + (i === 0 ? 1e-6 : 0) - (i === SAMPLES ? 1e-6 : 0)) / SAMPLES) * (stop - begin);
      points.push([t, softForce(this.report.soft, pair, t)]);
    }
    return [...points, [stop, 0]];
  }

  drawPaths() {
    const { report: { soft, hard, scene }, paths: chart } = this, times = this.pathTimes();
    const lines = { soft: times.map((t) => softHeights(soft, t)), hard: times.map((t) => hardHeights(hard, t)) };
    const all = [...lines.soft, ...lines.hard].flat(), low = Math.min(...all), high = Math.max(...all, low + 1e-9);
    const [unit, name] = unitFor(high - low, "m"), pad = 0.06 * (high - low);
    chart.scales([0, this.end], [(low - pad) / unit, (high + pad) / unit]);
    chart.xTicks(ticks([0, this.end], 6), tickName, `time in ${this.unitName}`);
    chart.yTicks(ticks([low / unit, high / unit], 4), tickName, name);
    for (const [engine, rows] of Object.entries(lines)) {
      for (let i = 0; i < scene.mass.length; i++) {
        chart.line(rows.map((row, j) => [this.clock(times[j]), row[i] / unit]), { class: `${engine}-line` });
      }
    }
    chart.finish();
  }

  pathTimes() {
    const even = Array.from({ length: 121 }, (_, i) => this.time(i / 120));
    const kinks = this.report.hard.contacts.slice(0, 200).map((c) => c.begin);
    return [...even, ...kinks].sort((a, b) => a - b);
  }

  show(t) {
    for (const chart of this.all) chart.playhead(this.clock(t));
  }
}

export const shortName = (scene, c) => (scene.mass[0] === Infinity ? (c === 0 ? "floor·1" : `${c}·${c + 1}`) : `${c + 1}·${c + 2}`);
