// The player: recorded runs of any scene and engine, no physics.
import { Clock } from "../shell/clock.mjs";
import { $, h, set, text } from "../shell/dom.mjs";
import { digits, inThousands, quantity } from "../shell/format.mjs";
import { beginBalls, drawBalls, enlargement, reach } from "./balls.mjs";
import { decoded } from "./decode.mjs";
import { episodes, later, nextEpisode, slowable } from "./episodes.mjs";
import { showFacts } from "./facts.mjs";
import { drawContacts, drawDisplacement, drawVelocity, pairName } from "./maps.mjs";
import { drawDistance, drawEnergy, drawPositions } from "./paths.mjs";
import { Picture, timeUnit } from "./picture.mjs";

const FEW_LINES = { balls: 60, pairs: 8 };

const LABELS = { time: "time", restart: "restart", "step-back": "step back", play: "play", "step-forward": "step forward", pace: "seconds for the whole span" };

// The clock of the player: time goes slower in the episodes of `slow`.
class SlowClock extends Clock {
  setSpan(span) {
    this.span = span;
    this.setDuration(this.duration);
    this.go(this.share);
  }

  setDuration(seconds) {
    this.duration = seconds;
    const slower = seconds / (this.span[1] - this.span[0]);
    text($(".slowdown"), slower >= 1 ? `slowed ${inThousands(slower)} ×` : `${digits(1 / slower, 2)} × faster than real time`);
  }

  tell() {
    const [now, whole] = [this.time, this.span[1]].map((t, i) => quantity(t - this.span[0], "s", 4 - i));
    set(this.bar, { "aria-valuetext": `${now} of ${whole}` });
    text(this.readout, now);
  }

  shareOf(time) {
    return (time - this.span[0]) / (this.span[1] - this.span[0]);
  }

  end() {
    this.pause();
  }

  frame(now) {
    const [t0, t1] = this.span, rate = (t1 - t0) / this.duration, seconds = Math.max(0, now - this.last) / 1000;
    const there = later(this.slow ?? [], this.time, seconds, rate);
    this.pace = seconds > 0 ? (there - this.time) / seconds : rate;
    this.last = now - (1000 * (there - this.time)) / rate;
    super.frame(now);
  }
}

class Player {
  constructor({ title, runs }) {
    this.runs = runs.map(decoded);
    this.whole = [Math.min(...this.runs.map((r) => r.span[0])), Math.max(...this.runs.map((r) => r.span[1]))];
    if (!(this.whole[1] > this.whole[0])) this.whole[1] = this.whole[0] + 1; // touching balls may be done in an instant
    this.span = this.whole;
    this.episodes = episodes(this.runs, this.whole);
    this.times = enlargement(this.runs);
    this.range = reach(this.runs, this.times);
    text($(".player-title"), title);
    text($(".scene-line"), this.runs[0].scene);
    this.offer();
    this.views = this.runs.map((run) => this.view(run));
    showFacts(this.runs);
    this.draw();
    for (const element of document.querySelectorAll("[data-label]")) set(element, { "aria-label": LABELS[element.dataset.label] });
    for (const option of document.querySelectorAll("[data-n]")) text(option, `in ${option.value} s`);
    this.clock = new SlowClock(document, { show: (t) => this.show(t), stops: () => this.stops() });
    this.clock.setSpan(this.span);
    this.setSlow();
    for (const medium of ["(prefers-color-scheme: dark)", "print"]) matchMedia(medium).addEventListener("change", () => this.draw());
    window.addEventListener("resize", () => this.resized());
    $(".blocked").remove();
    document.addEventListener("keydown", (event) => this.key(event));
    performance.mark("drawn");
  }

  // What may be shown over time, and the tools.
  offer() {
    const [run] = this.runs, balls = run.n - run.walls.length, few = run.n - 1 <= FEW_LINES.pairs && run.width === run.n;
    const pairs = few ? Array.from({ length: run.n - 1 }, (_, pair) => [`distance of ${pairName(run, pair)}`, (...a) => drawDistance(...a, pair)]) : [];
    this.kinds = [["positions", drawPositions], ...pairs, ["velocity as colour", drawVelocity], ["displacement as colour", drawDisplacement]];
    const chosen = balls > FEW_LINES.balls ? this.kinds.length - 2 : 0;
    $(".shown").replaceChildren(...this.kinds.map(([name], i) => h("option", { value: i, selected: i === chosen }, name)));
    $(".shown").addEventListener("change", () => this.draw());
    const actions = { ".last": () => this.meet(-1), ".next": () => this.meet(1), ".nearer": () => this.zoom(0.5), ".farther": () => this.zoom(2), ".whole": () => this.look(this.whole) };
    for (const [name, act] of Object.entries(actions)) $(name).addEventListener("click", act);
    $(".slow").addEventListener("change", () => this.setSlow());
    $(".slow").checked = slowable(this.episodes, this.whole).length > 0;
    $(".slow-label").hidden = !$(".slow").checked;
  }

  view(run) {
    const box = h("div", { class: `run-box${run.upright ? " upright" : ""}` }), sides = h("div", { class: "sides" }), over = h("div", { class: "over-time" });
    const law = run.about.slice(0, 1).map(([, said]) => h("p", { class: "about" }, said));
    const kind = `${run.engine} spheres`, heading = run.name === kind ? kind : `${run.name}: ${kind}`;
    box.append(h("h2", { class: run.engine }, heading), ...law, sides);
    const now = h("div", {}, h("p", { class: "key now-key" })), flat = run.n > 40 ? 84 : 130;
    sides.append(now, over);
    const balls = new Picture(now, run.upright ? 420 : flat, "balls now", run.upright ? { left: 46, right: 4, bottom: 8 } : { left: 14, top: 6 });
    over.append(h("p", { class: "key lines-key" }));
    const lines = new Picture(over, 250, "positions, distances, velocities or displacements over time");
    const map = new Picture(over, 54 + Math.min(180, Math.max(44, 20 * run.pairs)), "contacts over pairs and time");
    const energy = new Picture(over, 150, "energy over time");
    $(".runs").append(box);
    for (const picture of [lines, map, energy]) this.watch(picture);
    return { run, box, balls, lines, map, energy };
  }

  // A tap on a picture sets the time, a drag across it the span.
  watch(picture) {
    const { canvas } = picture, at = (event) => picture.back(event.clientX - canvas.getBoundingClientRect().left);
    let from = null;
    canvas.addEventListener("pointerdown", (event) => (from = event.isPrimary ? [event.clientX, at(event)] : null));
    canvas.addEventListener("pointercancel", () => (from = null));
    canvas.addEventListener("dblclick", () => this.look(this.whole));
    canvas.addEventListener("pointerup", (event) => {
      if (!from) return;
      if (Math.abs(event.clientX - from[0]) > 8) this.look([from[1], at(event)].sort((a, b) => a - b));
      else this.goTo(at(event));
      from = null;
    });
  }

  draw() {
    const [, drawn] = this.kinds[$(".shown").value];
    for (const { run, box, balls, lines, map, energy } of this.views) {
      text($(".lines-key", box), drawn(lines, run, this.runs, this.span));
      drawContacts(map, run, this.span);
      drawEnergy(energy, run, this.runs, this.span);
      text($(".now-key", box), beginBalls(balls, run, this.range, this.times));
    }
    if (this.clock) this.show(this.clock.time);
  }

  show(t) {
    const glow = 0.006 * (this.span[1] - this.span[0]);
    for (const { run, balls, lines, map, energy } of this.views) {
      drawBalls(balls, run, t, run.engine === "hard" ? glow : 0);
      for (const picture of [lines, map, energy]) picture.head(t);
    }
    const { unit, name, offset } = timeUnit(this.span), rate = (this.clock?.playing && this.clock.pace) || (this.span[1] - this.span[0]) / (this.clock?.duration ?? 9);
    text($(".time-now"), offset ? `${digits(offset, 15)}\u00a0s + ${((t - offset) / unit).toPrecision(4)}\u00a0${name}` : quantity(t, "s", 4));
    if (rate < 1) text($(".slowdown"), `slowed ${Number((1 / rate).toPrecision(2))} ×`);
  }

  // Look at a span of time; what is shown now stays if it lies within.
  look([from, to]) {
    const t = this.clock.time, [t0, t1] = [Math.max(from, this.whole[0]), Math.min(to, this.whole[1])];
    if (!(t1 - t0 > 1e-12 * (this.whole[1] - this.whole[0]))) return;
    this.span = [t0, t1];
    this.draw();
    this.clock.share = (t - t0) / (t1 - t0);
    this.clock.setSpan(this.span);
    this.setSlow();
  }

  zoom(factor) {
    const t = this.clock.time, [t0, t1] = this.span;
    this.look([t - factor * (t - t0), t + factor * (t1 - t)]);
  }

  // On to the next (back to the last) contacts, from where the clock stands.
  meet(way) {
    const [t0, t1] = this.span, zoomed = t1 - t0 < 0.999 * (this.whole[1] - this.whole[0]);
    const from = zoomed ? (t0 + t1) / 2 : this.clock.time, found = nextEpisode(this.episodes, from, way, this.whole);
    if (!found) return;
    this.clock.pause();
    this.look(found);
    this.clock.go(0);
  }

  setSlow() {
    this.clock.slow = $(".slow").checked ? slowable(this.episodes, this.span) : [];
  }

  goTo(t) {
    this.clock.pause();
    this.clock.go((t - this.span[0]) / (this.span[1] - this.span[0]));
  }

  key(event) {
    const actions = { n: () => this.meet(event.shiftKey ? -1 : 1), "+": () => this.zoom(0.5), "-": () => this.zoom(2), 0: () => this.look(this.whole) };
    const key = event.key.toLowerCase(), typing = event.target.matches("select");
    if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey && Object.hasOwn(actions, key)) actions[key]();
  }

  stops() {
    return this.runs.flatMap((run) => [...run.contacts.begin]);
  }

  resized() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.draw(), 100);
  }
}

new Player(JSON.parse($("#data").textContent));
