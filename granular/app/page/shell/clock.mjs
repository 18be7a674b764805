// Transport: play, pause, step, restart, scrub; by buttons, by the time bar, by keys. It owns the time shown. Each page has
// its own, which says what `tell`s the time, `setDuration`, `shareOf` a time and the `end` are.
import { $, set } from "./dom.mjs";

const SKIP = 0.01;

export class Clock {
  constructor(root, { show, stops = () => [], locked = () => false, duration = 9, say = (key) => key }) {
    Object.assign(this, { root, show, stops, locked, duration, say, playing: false, share: 0, span: [0, 1], last: 0 });
    this.bar = $(".time-bar", root);
    this.button = $(".play", root);
    this.readout = $(".time-now", root);
    set(this.bar, { oninput: () => this.pause() || this.go(this.bar.value / this.bar.max) });
    set(this.button, { onclick: () => this.toggle() });
    set($(".restart", root), { onclick: () => this.restart() });
    set($(".back", root), { onclick: () => this.step(-1) });
    set($(".forward", root), { onclick: () => this.step(1) });
    set($(".pace", root), { onchange: (event) => this.setDuration(Number(event.target.value)) });
    set(document, { onkeydown: (event) => this.key(event) });
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
    const ahead = this.stops().map((time) => this.shareOf(time)).filter((s) => way * (s - this.share) > 1e-9);
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
