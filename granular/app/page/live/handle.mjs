// The upper ball is the handle: from near of the gap below it, from far of the height that is guessed. By mouse, finger, arrows.
import { set, svg } from "../shell/dom.mjs";
import { quantity } from "../shell/format.mjs";
import { plain } from "./words.mjs";
import { max, min, round } from "../physics/numbers.mjs";

const STEP = 0.1, FINE = 0.02, ROOM = 14; // drop heights and shares of the safe gap per key; pixels around the ball

export class Handle {
  // `taken`: another value; `poised`: the picture in which a gap is set is wanted.
  constructor(view, { taken, poised }) {
    Object.assign(this, { view, taken, poised, kind: "" });
    this.disc = svg("circle", { class: "grip-disc" });
    this.arrows = svg("path", { class: "grip-arrows" });
    this.grip = view.grip;
    this.grip.append(this.disc, this.arrows);
    const { svg: host } = view;
    const begin = (event) => this.begin(event), move = (event) => this.held && event.buttons & 1 && this.move(event), end = () => (this.held = null);
    set(host, { onpointerdown: begin, onpointermove: move, onpointerup: end, onpointercancel: end });
    this.grip.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false }); // parts of an SVG have no touch-action
    set(this.grip, { onkeydown: (event) => this.key(event) });
  }

  // `kind`: "gap", "guess" or nothing; `value` of it, `most`, and the gap from which on contacts do not overlap.
  load({ kind, value, most, safe, isFirst }) {
    Object.assign(this, { kind, value, most, safe });
    const shown = kind === "gap" ? (value ? quantity(value, "m") : plain("touching")) : kind ? this.view.guessSaid(value ?? "–") : "";
    this.view.svg.classList.toggle("grabs", kind === "guess");
    set(this.grip, {
      visibility: kind ? "visible" : "hidden", tabindex: kind && isFirst ? 0 : null, role: kind && isFirst ? "slider" : null, "aria-hidden": kind && isFirst ? null : "true", "aria-orientation": "vertical",
      "aria-label": plain(kind === "gap" ? "label-gap" : "guess-label"), "aria-valuemin": 0, "aria-valuemax": most, "aria-valuenow": value ?? 1, "aria-valuetext": shown,
    });
  }

  show({ zoom }) {
    const { view, kind } = this;
    if (!kind) return;
    const isGap = kind === "gap", ball = view.placed[view.top], y = isGap ? view.camera.down(ball.low + ball.r) : this.guessed(ball), { x } = view, far = x - max(ball.r, 12) - 20;
    set(this.disc, { cx: x, cy: y.toFixed(1), r: max(ball.r, 12) + ROOM });
    set(this.arrows, { d: `M${far} ${y - 18}l8 11h-16zM${far} ${y + 18}l8-11h-16z`, opacity: isGap && zoom < 0.9 ? 0 : 1 });
  }

  // Where the ball that is guessed with is drawn.
  guessed({ zero, r }) {
    const { camera, scene } = this.view;
    return camera.down(zero + (this.value ?? 1) * scene.drop * camera.scales(0)[0] + r);
  }

  pixels({ clientY }) {
    const { svg: host, tall } = this.view, box = host.getBoundingClientRect();
    return ((clientY - box.top) * tall) / box.height;
  }

  begin(event) {
    if (!this.kind || (this.kind === "gap" && !this.grip.contains(event.target))) return;
    this.view.svg.setPointerCapture(event.pointerId);
    event.preventDefault();
    if (this.kind === "gap") this.poised();
    this.held = { from: this.pixels(event), value: this.value };
    if (this.kind === "guess") this.move(event);
  }

  move(event) {
    const { view, held } = this, at = this.pixels(event);
    if (this.kind === "guess") return this.take(view.camera.heightAt(at + view.placed[view.top].r, view.top, 0) / view.scene.drop);
    this.take(held.value + (held.from - at) / view.camera.scales(1)[0] / (view.top - 1));
  }

  key(event) {
    const ways = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 }, isGap = this.kind === "gap";
    const ends = { Home: 0, End: isGap ? min(this.most, 1.1 * this.safe) : this.most }, step = isGap ? FINE * this.safe : STEP;
    if (!this.kind || !(event.key in ways || event.key in ends)) return;
    event.preventDefault();
    event.stopPropagation();
    if (isGap) this.poised();
    this.take(ends[event.key] ?? (this.value ?? 1) + step * ways[event.key]);
  }

  take(asked) {
    const value = min(this.most, max(0, asked)), isGap = this.kind === "gap";
    this.taken(this.kind, isGap ? (value < 1e-6 ? 0 : Number(value.toPrecision(3))) : round(20 * value) / 20);
  }
}
