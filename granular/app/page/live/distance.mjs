// The distance of the two balls on its own scale: the hops that are far too small for the paths.
import { Chart, tickName, ticks } from "../shell/axes.mjs";
import { $ } from "../shell/dom.mjs";
import { quantity, unitFor } from "../shell/format.mjs";
import { pairName } from "../physics/verdict.mjs";
import { plain, told } from "./words.mjs";
import { min } from "../physics/numbers.mjs";

export class Distance {
  constructor() {
    this.chart = new Chart($(".distance"), { height: 185, top: 18 });
  }

  load(report, watched, { clock, end, unitName }) {
    $(".distance-box").hidden = !watched;
    this.clock = watched ? clock : null;
    if (!watched) return;
    const { chart } = this, { range, depth, hops, touches } = watched, top = 1.3 * range, bottom = -min(1.15 * depth, 2 * range);
    const [unit, name] = unitFor(top, "m"), path = (points) => cut(points, bottom, top).map(([t, y]) => [clock(t), y / unit]);
    chart.scales([0, end], [bottom / unit, top / unit]);
    chart.xTicks(ticks([0, end], 6), tickName, plain("time-in", { unit: unitName }));
    chart.yTicks(ticks([bottom / unit, top / unit], 5), tickName, name);
    chart.line([[0, 0], [end, 0]], { class: "zero-line" });
    chart.line(path(watched.hard), { class: "hard-line" });
    chart.line(path(watched.soft), { class: "soft-line strong" });
    this.number(touches);
    this.measure(hops, unit);
    told($(".distance-key"), "distance-key", { pair: pairName(report.scene, watched.pair) });
    const heights = hops.slice(0, 12).map((hop) => quantity(hop.height, "m", 2)).join(", ");
    chart.finish(plain("distance-said", { n: touches.length, hops: heights || "–" }));
  }

  show(t) {
    if (this.clock) this.chart.playhead(this.clock(t));
  }

  number(touches) {
    let last = -Infinity;
    touches.forEach((t, i) => {
      const x = this.chart.x(this.clock(t));
      if (x - last < 13) return;
      this.chart.note(i + 1, x + 5, 13, "count", "middle");
      last = x;
    });
  }

  measure(hops, unit) {
    let last = -Infinity;
    for (const { time, height } of hops) {
      const x = this.chart.x(this.clock(time));
      if (x - last < 46) continue;
      this.chart.note(quantity(height, "m", 2), x, this.chart.y(height / unit) - 5, "bar-value soft", "middle");
      last = x;
    }
  }
}

// A line leaves the picture where it leaves the range: what lies beyond is left out, not laid flat along the edge.
function cut(points, low, high) {
  const isIn = ([, y]) => y >= low && y <= high, edge = ([, y]) => (y < low ? low : high);
  return points.flatMap((p, i) => {
    const q = points[i - 1];
    if (!q || isIn(p) === isIn(q)) return isIn(p) ? [p] : [[p[0], NaN]];
    const out = isIn(p) ? q : p, y = edge(out), at = [q[0] + ((y - q[1]) / (p[1] - q[1])) * (p[0] - q[0]), y];
    return isIn(p) ? [at, p] : [at, [p[0], NaN]];
  });
}
