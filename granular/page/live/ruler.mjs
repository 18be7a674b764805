// The whole fall and flight against a ruler, hard beside soft; where a guess is wanted, its ball can be dragged.
import { h, set, svg, text } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { ticks } from "../shell/axes.mjs";
import { plain, say } from "./words.mjs";

const LEFT = 52, TOP = 46, BOTTOM = 22, STEP = 0.1; // pixels, and drop heights per key

export class Ruler {
  constructor(host, { guessed = () => {} } = {}) {
    Object.assign(this, { host, guessed, guess: null, asks: false, radii: [], lanes: [] });
    this.svg = svg("svg", { class: "ruler", role: "img", "aria-label": plain("ruler-said") });
    this.caption = h("p", { class: "film-caption", "aria-live": "polite" });
    host.append(this.caption, this.svg);
    this.listen();
  }

  listen() {
    this.svg.addEventListener("pointerdown", (event) => this.asks && this.svg.setPointerCapture(event.pointerId));
    const take = (event) => this.asks && (event.buttons & 1 || event.type === "pointerdown") && this.take(this.heightAt(event.clientY));
    for (const type of ["pointerdown", "pointermove"]) this.svg.addEventListener(type, take);
    this.svg.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const ways = { ArrowUp: STEP, ArrowRight: STEP, ArrowDown: -STEP, ArrowLeft: -STEP, PageUp: 10 * STEP, PageDown: -10 * STEP };
    if (!this.asks || !(event.key in ways)) return;
    event.preventDefault();
    event.stopPropagation();
    this.take((this.guess ?? 1) + ways[event.key]);
  }

  heightAt(clientY) {
    const box = this.svg.getBoundingClientRect();
    return (this.floor - (clientY - box.top) * (this.tall / box.height)) / this.scale;
  }

  // A guess in drop heights.
  take(height) {
    this.guess = Math.round(20 * Math.min(this.most, Math.max(0, height))) / 20;
    this.drawGuess();
    this.guessed(this.guess);
  }

  // `most`: highest height in drop heights; `lanes`: the engines shown, none where a guess is asked for.
  layout({ scene, most, lanes, asks = false }) {
    const [w, tall] = [this.svg.clientWidth || 300, this.svg.clientHeight || 340], largest = Math.max(...scene.radius);
    Object.assign(this, { scene, most, w, tall, asks, lanes, floor: tall - BOTTOM });
    this.scale = (this.floor - TOP) / (1.06 * most);
    this.radii = scene.radius.map((r) => (r ? Math.max(5, 22 * Math.sqrt(r / largest)) : 0));
    set(this.svg, { viewBox: `0 0 ${w} ${tall}`, tabindex: asks ? 0 : null, ...(asks ? {} : { "aria-valuenow": null, "aria-valuetext": null }) });
    set(this.svg, asks ? { role: "slider", "aria-label": plain("guess-label"), "aria-orientation": "vertical", "aria-valuemin": 0, "aria-valuemax": most } : { role: "img", "aria-label": plain("ruler-said") });
    this.draw();
  }

  draw() {
    const { w, floor, scale, scene, lanes, most } = this, parts = [svg("line", { class: "floor", x1: LEFT, x2: w - 8, y1: floor, y2: floor })];
    for (const v of ticks([0, most], 5)) {
      const y = floor - v * scale, label = svg("text", { x: LEFT - 8, y: y + 4, "text-anchor": "end", class: "ruler-tick" });
      text(label, digits(v, 3));
      parts.push(svg("line", { class: "ruler-line", x1: LEFT, x2: w - 8, y1: y, y2: y }), label);
    }
    const name = svg("text", { x: 8, y: this.tall - 6, class: "ruler-tick" }), drop = floor - scale;
    text(name, plain("in-drops"));
    parts.push(name, svg("line", { class: "drop-line", x1: LEFT, x2: w - 8, y1: drop, y2: drop }));
    this.balls = lanes.map((engine) => scene.radius.map((r, i) => (r ? svg("circle", { class: `ruler-ball ${engine}`, r: this.radii[i] }) : null)));
    const titles = lanes.map((engine, i) => named(plain(`${engine}-spheres`), this.centre(i), engine));
    this.mark = svg("g", { class: "guess-mark" });
    this.svg.replaceChildren(...parts, ...titles, ...this.balls.flat().filter(Boolean), this.mark);
    this.drawGuess();
  }

  centre(lane) {
    return LEFT + ((this.w - LEFT - 8) * (lane + 0.5)) / Math.max(1, this.lanes.length);
  }

  drawGuess() {
    const { guess, asks, w, floor, scale } = this, at = guess ?? (asks ? 1 : null);
    if (at === null) return this.mark.replaceChildren();
    const y = floor - at * scale, x = this.centre(0), label = svg("text", { x: w - 12, y: y - 8, "text-anchor": "end", class: "guess-text" });
    text(label, guess === null ? plain("drag-me") : plain("your-guess", { guess }));
    this.mark.replaceChildren(svg("line", { x1: LEFT, x2: w - 8, y1: y, y2: y }), ...(asks ? [svg("circle", { cx: x, cy: y, r: 16 }), svg("path", { d: `M${x} ${y - 32}l7 10h-14zM${x} ${y + 32}l7-10h-14z` })] : []), label);
    if (asks) set(this.svg, { "aria-valuenow": at, "aria-valuetext": say("your-guess", { guess: at }) });
  }

  // Heights of the lanes' balls in m, with the radii taken out: of the lowest points, so balls fall side by side.
  show(rows) {
    const width = Math.min(30, (0.7 * (this.w - LEFT)) / Math.max(1, this.lanes.length) / this.radii.length);
    rows.forEach((heights, lane) => heights.forEach((y, i) => {
      if (!this.balls[lane][i]) return;
      const cx = this.centre(lane) + width * (i - this.radii.length / 2), cy = this.floor - Math.max(0, y / this.scene.drop) * this.scale - this.radii[i];
      set(this.balls[lane][i], { cx: cx.toFixed(1), cy: Math.max(-99, cy).toFixed(2) });
    }));
  }

  tell(key, values) {
    text(this.caption, key ? plain(key, values) : "");
  }
}

function named(content, x, engine) {
  const label = svg("text", { x, y: 15, "text-anchor": "middle", class: `stage-name ${engine}` });
  text(label, content);
  return label;
}
