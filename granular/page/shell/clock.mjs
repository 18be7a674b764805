// Transport: play, pause, step, restart, scrub; by buttons, by the time bar, by keys. It owns the time shown.
import { $, set, text } from "./dom.mjs";
import { digits, quantity } from "./format.mjs";

const SKIP = 0.01;
const ENGLISH = {
  slowed: ({ n }) => `slowed ${n} ×`, faster: ({ n }) => `${n} × faster than life`, "time-of": ({ now, whole }) => `${now} of ${whole}`,
  play: () => "play", pause: () => "pause",
};

export class Clock {
  constructor(root, { show, stops = () => [], locked = () => false, duration = 9, say = (key, values) => ENGLISH[key](values) }) {
    Object.assign(this, { root, show, stops, locked, duration, say, playing: false, share: 0, span: [0, 1], last: 0 });
    this.bar = $(".time-bar", root);
    this.button = $(".play", root);
    this.readout = $(".time-now", root);
    this.bar.addEventListener("input", () => this.pause() || this.go(this.bar.value / this.bar.max));
    this.button.addEventListener("click", () => this.toggle());
    $(".restart", root).addEventListener("click", () => this.restart());
    $(".back", root).addEventListener("click", () => this.step(-1));
    $(".forward", root).addEventListener("click", () => this.step(1));
    const pace = $(".pace", root);
    pace.addEventListener("change", () => this.setDuration(Number(pace.value)));
    document.addEventListener("keydown", (event) => this.key(event));
  }

  setSpan(span) {
    this.span = span;
    this.setDuration(this.duration);
    this.go(this.share);
  }

  setDuration(seconds) {
    this.duration = seconds;
    const slower = seconds / (this.span[1] - this.span[0]);
    const pace = slower >= 1 ? this.say("slowed", { n: String(Math.round(slower)).replace(/\B(?=(\d{3})+$)/g, "\u00a0") }) : this.say("faster", { n: digits(1 / slower, 2) });
    text($(".slowdown", this.root), pace);
  }

  get time() {
    return this.span[0] + this.share * (this.span[1] - this.span[0]);
  }

  go(share) {
    this.share = this.locked() ? 0 : Math.min(1, Math.max(0, share));
    this.bar.value = Math.round(this.share * this.bar.max);
    this.tell();
    this.show(this.time);
  }

  tell() {
    const now = quantity(this.time - this.span[0], "s", 4), whole = quantity(this.span[1] - this.span[0], "s", 3);
    set(this.bar, { "aria-valuetext": this.say("time-of", { now, whole }) });
    text(this.readout, now);
  }

  play() {
    if (this.playing || this.locked()) return;
    if (this.share >= 1) this.go(0);
    this.playing = true;
    this.mark();
    this.last = performance.now();
    requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    if (!this.playing) return;
    this.go(this.share + Math.max(0, now - this.last) / 1000 / this.duration);
    this.last = now;
    if (this.share >= 1) this.end();
    else requestAnimationFrame((next) => this.frame(next));
  }

  end() {
    this.pause();
  }

  pause() {
    this.playing = false;
    this.mark();
  }

  mark() {
    set(this.button, { "aria-label": this.say(this.playing ? "pause" : "play"), "aria-pressed": String(this.playing) });
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  restart() {
    this.pause();
    this.go(0);
  }

  step(way) {
    this.pause();
    this.go(this.share + way * SKIP);
  }

  // To the next or the last onset or end of a contact.
  leap(way) {
    this.pause();
    const shares = this.stops().map((t) => (t - this.span[0]) / (this.span[1] - this.span[0]));
    const ahead = shares.filter((s) => (way > 0 ? s > this.share + 1e-9 : s < this.share - 1e-9));
    if (ahead.length) this.go(way > 0 ? Math.min(...ahead) : Math.max(...ahead));
  }

  key(event) {
    const focus = event.target, key = event.key.length === 1 ? event.key.toLowerCase() : event.key, isLetter = key.length === 1;
    const slides = focus.matches("input[type=range], [role=slider]"), typing = focus.matches("input, select, textarea") && !slides;
    if (this.locked() || typing || event.ctrlKey || event.metaKey || event.altKey) return;
    if (slides && !isLetter && focus !== this.bar) return; // arrows belong to the slider that has the focus
    if (key === " " && focus.matches("button, summary, a") && focus !== this.button) return;
    const actions = {
      " ": () => this.toggle(), ArrowRight: () => (event.shiftKey ? this.leap(1) : this.step(1)),
      ArrowLeft: () => (event.shiftKey ? this.leap(-1) : this.step(-1)), Home: () => this.restart(), r: () => this.restart(),
      End: () => this.pause() || this.go(1),
    };
    if (!Object.hasOwn(actions, key)) return;
    event.preventDefault();
    actions[key]();
  }
}
