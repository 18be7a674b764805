// The player: recorded runs of any scene and engine, no physics.
import { Chart, tickName, ticks } from "../shell/axes.mjs";
import { Clock } from "../shell/clock.mjs";
import { $, csv, h, save, text } from "../shell/dom.mjs";
import { digits, plural, quantity, unitFor } from "../shell/format.mjs";
import { decoded } from "./decode.mjs";
import { drawBalls, drawContactMap, drawWorldLines, extent, Picture } from "./pictures.mjs";

class Player {
  constructor(data) {
    this.runs = data.runs.map(decoded);
    this.span = [Math.min(...this.runs.map((r) => r.span[0])), Math.max(...this.runs.map((r) => r.span[1]))];
    text($(".player-title"), this.runs.map((r) => r.name).join(" and "));
    text($(".scene-line"), this.runs[0].scene);
    this.views = this.runs.map((run) => this.view(run));
    this.energy = new Chart($(".energy"), { height: 180, label: "energy in time" });
    facts(this.runs);
    this.draw();
    this.clock = new Clock(document, { show: (t) => this.show(t), stops: () => this.stops() });
    this.clock.setSpan(this.span);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    window.addEventListener("resize", () => this.resized());
    $(".blocked").remove();
    performance.mark("drawn");
  }

  view(run) {
    const box = h("div", { class: "run-box" }), few = run.n <= 40;
    const title = h("h2", { class: run.engine }, `${run.name}: ${run.engine} spheres`);
    box.append(title, h("p", { class: "key" }, "now"));
    const balls = new Picture(box, few ? 90 : 44, "balls now");
    box.append(h("p", { class: "key lines-key" }, ""));
    const lines = new Picture(box, 260, "space–time diagram");
    box.append(h("p", { class: "key" }, "contact network over time: pairs from below (left), stronger where more contacts are under way; all are counted"));
    const map = new Picture(box, Math.min(200, Math.max(60, 12 * run.map.lanes)), "contact map over pairs and time");
    $(".runs").append(box);
    return { run, box, balls, lines, map };
  }

  draw() {
    const paths = this.runs.map((run) => extent(run.path)), range = [Math.min(...paths.map((p) => p[0])), Math.max(...paths.map((p) => p[1]))];
    for (const { run, box, balls, lines, map } of this.views) {
      const stride = drawWorldLines(lines, run, this.span, range);
      text($(".lines-key", box), `space over time, radii taken out${stride > 1 ? `; one line in ${stride} is drawn` : ""}`);
      drawContactMap(map, run, this.span);
      balls.begin();
    }
    this.drawEnergy();
    if (this.clock) this.show(this.clock.time);
  }

  drawEnergy() {
    const { energy: chart, span } = this, [unit, name] = unitFor(span[1] - span[0], "s");
    const whole = extent(this.runs.flatMap((r) => [...r.energy])), top = Math.max(whole[1], 1e-300), [factor, joule] = unitFor(top, "J");
    const x = (t) => (t - span[0]) / unit;
    Chart.measure([chart]);
    chart.scales([0, x(span[1])], [Math.min(0, whole[0]) / factor, (1.22 * top) / factor]);
    chart.xTicks(ticks(chart.xs, 6), tickName, `time in ${name}`);
    chart.yTicks(ticks(chart.ys, 4), tickName, joule);
    for (const run of this.runs) chart.line([...run.time].map((t, i) => [x(t), run.energy[i] / factor]), { class: `${run.engine}-line` });
    chart.finish();
    $(".energy-key").replaceChildren(...this.runs.map((r) => h("span", { class: r.engine }, `${r.engine === "hard" ? "╌" : "─"} ${r.name} `)));
    this.toClock = x;
  }

  show(t) {
    for (const { run, balls, lines, map } of this.views) {
      drawBalls(balls, run, t, this.span);
      lines.head(t, this.span);
      map.head(t, this.span);
    }
    this.energy.playhead(this.toClock(t));
  }

  stops() {
    return this.runs.flatMap((run) => [...run.contacts.begin]);
  }

  resized() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.draw(), 100);
  }
}

// What walls do and contacts dissipate, as far as there is any.
function accounted(runs) {
  return [...new Set(runs.flatMap((run) => run.account.map(([name]) => name)))];
}

function facts(runs) {
  const row = (name, value) => h("tr", {}, h("th", { scope: "row" }, name), ...runs.map((run) => h("td", { class: run.engine }, value(run))));
  $(".facts").replaceChildren(h("tbody", {},
    row("run", (r) => r.name), row("engine", (r) => (r.engine === "hard" ? "event-driven" : "Newton, contact force")),
    row("span of time", (r) => quantity(r.span[1] - r.span[0], "s")), row("contacts", (r) => String(r.whole.contacts)),
    row("energy at the start, J", (r) => digits(r.energy[0], 5)), row("energy at the end, J", (r) => digits(r.energy[r.energy.length - 1], 5)),
    ...accounted(runs).map((name) => row(`${name}, J`, (r) => digits(new Map(r.account).get(name) ?? 0, 5))),
    row("ended because", (r) => r.message)));
  text($(".honest"), runs.map(leftOut).join(" "));
  $(".csv-buttons").replaceChildren(...runs.map((run) => h("button", { type: "button", class: "csv", onclick: () => saveContacts(run) }, `Save contacts of ${run.name} as CSV`)));
}

// What was left out when the run was embedded.
function leftOut({ name, whole, time, contacts, width }) {
  const parts = [[whole.rows - time.length, whole.rows, "row"], [whole.contacts - contacts.pair.length, whole.contacts, "contact"], [whole.bodies - width, whole.bodies, "body"]];
  const gone = parts.filter(([less]) => less > 0).map(([less, all, noun]) => `${less} of ${noun === "body" ? `${all} bodies` : plural(all, noun)}`);
  const few = whole.rows < 20 ? ` Only ${plural(whole.rows, "row")} of positions were recorded; more come with samples=….` : "";
  return `${name}: ${gone.length ? `left out evenly, to keep this file small: ${gone.join(", ")}` : "nothing is left out"}.${few}`;
}

function saveContacts({ name, contacts: c }) {
  const rows = [...c.pair].map((pair, i) => [pair, c.begin[i], c.end[i], c.before[i], c.after[i], c.impulse[i]]);
  save(`${name}-contacts.csv`, "text/csv", csv([["pair", "begin, s", "end, s", "rate before, m/s", "rate after, m/s", "impulse, N s"], ...rows]));
}

new Player(JSON.parse($("#data").textContent));
