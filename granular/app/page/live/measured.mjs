// A recording beside both models of a bouncing ball, on one clock: in time, and as three balls side by side. Of bounces the
// times are known: the ball flies on parabolas between them, and the first is that of the models.
import { Chart, tickName, ticks } from "../shell/axes.mjs";
import { $, set, svg, text } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { simulateHard } from "../physics/hard.mjs";
import { contactsIn, sceneOf } from "../physics/setups.mjs";
import { simulateSoft } from "../physics/soft.mjs";
import { hardHeights, softHeights } from "../physics/traces.mjs";
import { flightHeights, recordingIn, textIn } from "./columns.mjs";
import { RECORDED } from "./recorded.mjs";
import { plain, say, told } from "./words.mjs";
import { max, min } from "../physics/numbers.mjs";

const CURVE_STEPS = 240, BALL = 7, PLACES = [1.05, 1.1, 1.15], DOTS = 1500; // of the curves; pixels; where the balls are, in spans of time; drawn at most
const HEIGHTS_TOLD = 6, NUMBERS_APART = 14, FLIGHT_STEPS = 40; // heights; pixels between the numbers of bounces; of a parabola

export class Measured {
  constructor() {
    Object.assign(this, { chart: new Chart($(".measured"), { height: 225 }), given: { series: RECORDED }, source: { say: "measured-source" } });
    this.balls = ["hard", "soft", "own"].map((kind) => svg("circle", { r: BALL, class: `measured-${kind}` }));
    this.chart.svg.append(...this.balls);
    set(this.chart.svg, { "aria-label": plain("measured") });
    set($(".measured-play"), { onclick: () => this.play() });
    set($(".measured-file"), { onclick: (event) => (event.target.value = ""), onchange: (event) => this.take(event.target.files[0]) }); // a file can be chosen again
  }

  // Of a file, which stays on this device.
  async take(file) {
    if (!file) return;
    this.asked = file;
    const bytes = await file.arrayBuffer().catch(() => new ArrayBuffer());
    if (this.asked !== file) return; // another one was chosen while this one was read
    const given = recordingIn(textIn(bytes)), { series, bounces, column, cell } = given ?? {};
    if (!series && !bounces) return text($(".measured-note"), say(column ? "measured-unit" : cell ? "measured-cell" : "measured-bad", { name: column ?? cell })); // as it is: a name can have an underscore
    Object.assign(this, { given, source: { say: bounces ? "measured-bounces" : "measured-own", name: file.name, n: (series ?? bounces).length } });
    if (!$(".measured-box").hidden) this.load("bouncing-ball", this.values);
  }

  load(name, values) {
    const box = $(".measured-box"), wasHidden = box.hidden;
    box.hidden = name !== "bouncing-ball";
    if (box.hidden) return this.pause();
    if (wasHidden) Chart.measure([this.chart]);
    const own = sceneOf(name, values), { eps, k } = contactsIn(name, values), first = Math.sqrt((2 * values.height) / own.gravity), { bounces } = this.given;
    this.bounces = bounces?.map((t) => t - bounces[0] + first);
    this.series = this.given.series ?? flown([-first, ...this.bounces], own.gravity);
    const end = this.series[this.series.length - 1][0], scene = { ...own, until: null, tEnd: end };
    const hard = simulateHard(scene, eps, { record: true }), soft = simulateSoft(scene, eps, k, { record: true });
    Object.assign(this, { values, end, models: [(t) => max(0, hardHeights(hard, t)[1]), (t) => max(0, softHeights(soft, t)[1]), (t) => between(this.series, t)] });
    const heights = bounces && flightHeights(bounces, own.gravity).slice(0, HEIGHTS_TOLD).map((height) => digits(height)).join("; ");
    text($(".measured-note"), say(this.source.say, { ...this.source, heights }));
    told($(".measured-play"), this.begun ? "pause" : "play"); // in another language, too
    this.draw();
    this.show(this.now ?? 0);
  }

  draw() {
    const { chart, series, bounces, models, end } = this, times = Array.from({ length: CURVE_STEPS + 1 }, (_, i) => (i / CURVE_STEPS) * end), [least, most] = series.reduce(([low, high], [, y]) => [min(low, y), max(high, y)], [0, this.values.height]), step = Math.ceil(series.length / DOTS);
    chart.scales([0, 1.2 * end], [1.08 * least, 1.08 * most]);
    chart.xTicks(ticks([0, end]), tickName, plain("time-in", { unit: "s" }));
    chart.yTicks(ticks([least, most]), tickName, plain("in-metres"));
    ["hard-line", "soft-line"].forEach((line, i) => chart.line(times.map((t) => [t, models[i](t)]), { class: line }));
    if (bounces) chart.line(series.filter(([t]) => t >= bounces[0]), { class: "drop-line" });
    bounces?.reduce((last, t, i) => (chart.x(t) < last + NUMBERS_APART ? last : chart.note(i + 1, chart.x(t), chart.y(0) - 6, "bar-value", "middle") ?? chart.x(t)), -NUMBERS_APART);
    for (const [t, y] of bounces?.map((t) => [t, 0]) ?? series.filter((_, i) => i % step === 0)) chart.add("circle", { cx: chart.x(t), cy: chart.y(y), r: 2, class: "measured-own" });
    chart.finish(plain("measured"));
  }

  show(asked) {
    const t = min(asked, this.end);
    this.now = t;
    this.chart.playhead(t);
    this.balls.forEach((ball, i) => set(ball, { cx: this.chart.x(PLACES[i] * this.end).toFixed(1), cy: (this.chart.y(this.models[i](t)) - BALL).toFixed(1) }));
  }

  play() {
    if (this.begun) return this.pause();
    this.begun = performance.now();
    told($(".measured-play"), "pause");
    const next = () => {
      const t = (performance.now() - this.begun) / 1000;
      if (!this.begun) return;
      this.show(t);
      if (t < this.end) requestAnimationFrame(next);
      else this.pause();
    };
    next();
  }

  pause() {
    this.begun = 0;
    told($(".measured-play"), "play");
  }
}

// Points of the flights between bounces, from the time 0 on: [s, m].
const flown = (bounces, g) => bounces.slice(1).flatMap((end, i) => Array.from({ length: FLIGHT_STEPS }, (_, j) => {
  const t = bounces[i] + ((end - bounces[i]) * (j + 1)) / FLIGHT_STEPS;
  return [t, (g / 2) * (t - bounces[i]) * (end - t)];
})).filter(([t]) => t >= 0);

// The height at a time, on a straight line between two points.
function between(series, t) {
  const i = max(1, series.findIndex(([at], i) => at >= t || i === series.length - 1)), [[t0, y0], [t1, y1]] = [series[i - 1], series[i]];
  return t < t0 ? y0 : y0 + ((y1 - y0) * (t - t0)) / (t1 - t0);
}
