// What can be dragged in the picture, each a slider as well: the upper ball for a guess, for the gap or for the drop height, a spring
// in the lower ball for its contact time, the edge of a light ball for its mass. By mouse, finger, arrows.
import { set, svg, text } from "../shell/dom.mjs";
import { quantity } from "../shell/format.mjs";
import { plain } from "./words.mjs";
import { log10, max, min, round } from "../physics/numbers.mjs";

const ROOM = 14, FINGER = 23, TRAVEL = 0.75; // pixels: around a ball, and of what has no ball; radii that a spring becomes longer
const WAYS = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 };
const upDown = (x, y) => `M${x} ${y - 18}l8 11h-16zM${x} ${y + 18}l8-11h-16z`, sideways = (x, y) => `M${x - 17} ${y}l11-8v16zM${x + 17} ${y}l-11-8v16z`;

const aroundBall = (view, ball, y) => ({ x: view.x, y, r: max(ball.r, 12) + ROOM, arrows: upDown(view.x - max(ball.r, 12) - (view.isNarrow ? 16 : 20), y), said: [view.x + ball.r + 8, y + (view.isNarrow ? 5 : 20)] });
const centreOf = (view, i) => view.camera.down(view.placed[i].low + view.placed[i].r);
const onBall = (view) => aroundBall(view, view.placed[view.top], centreOf(view, view.top));
const threeDigits = (x) => Number(x.toPrecision(3)), along = ({ least, most }, x) => log10(x / least) / log10(most / least);

// Where it is, the value where it is pulled to `to` from `from`, and n steps of a key; `isFar`: of the picture seen from far.
const GRIPS = {
  guess: {
    at: (view, { value }) => aroundBall(view, view.placed[view.top], view.camera.down(view.placed[view.top].zero + (value ?? 1) * view.scene.drop * view.camera.scales(0)[0] + view.placed[view.top].r)),
    pull: (view, _, to) => view.camera.heightAt(to[1] + view.placed[view.top].r, view.top, 0) / view.scene.drop,
    key: ({ value }, n) => (value ?? 1) + 0.1 * n, tidy: (x) => round(20 * x) / 20,
  },
  gap: {
    at: onBall, pull: (view, from, to) => from.value + (from.at[1] - to[1]) / view.camera.scales(1)[0] / (view.top - 1),
    key: ({ value, safe }, n) => value + 0.02 * safe * n, tidy: (x) => (x < 1e-6 ? 0 : threeDigits(x)),
  },
  height: {
    at: onBall, pull: (view, from, to) => from.value + (from.at[1] - to[1]) / view.camera.scales(0)[0],
    key: ({ value }, n) => value + 0.05 * n, tidy: threeDigits, isFar: true,
  },
  t1: {
    at: (view, handle) => {
      const { r, low } = view.placed[1], x = view.x - 0.55 * r, y = centreOf(view, 1) + r * (0.65 - TRAVEL * max(0, along(handle, handle.value))), foot = view.camera.down(max(low, 0));
      return { x, y, r: FINGER, arrows: upDown(x, y), said: [x + 13, y + 5], spring: [...Array(9)].reduce((d, _, i) => `${d}L${x + (i % 2 ? 7 : -7)} ${foot + ((i + 0.5) * (y + 18 - foot)) / 9}`, `M${x} ${foot}`) };
    },
    pull: (view, from, to, { least, most }) => from.value * (most / least) ** ((from.at[1] - to[1]) / (TRAVEL * view.placed[1].r)),
    key: ({ value }, n) => value * 1.05 ** n, tidy: threeDigits, engine: "soft",
  },
  m2: {
    at: (view) => {
      const y = centreOf(view, view.top), x = view.x + view.placed[view.top].r + FINGER + 6;
      return { x, y, r: FINGER, arrows: sideways(x, y), said: [x + FINGER, y + 5] };
    },
    pull: (view, from, to) => from.value * max(0, 1 + (to[0] - from.at[0]) / from.r) ** 3,
    key: ({ value }, n) => value * 1.1 ** n, tidy: threeDigits,
  },
};

export class Handle {
  // `taken`: another value; `poised`: the picture in which it is set is wanted.
  constructor(view, { taken, poised }) {
    Object.assign(this, { view, taken, poised, kind: "" });
    this.parts = ["circle", "path", "path", "text"].map((tag, i) => svg(tag, { class: ["grip-disc", "grip-spring", "grip-arrows", "grip-value"][i] }));
    this.grip = svg("g", { class: "grip" }, ...this.parts);
    view.grips.append(this.grip);
    const begin = (event) => this.begin(event), move = (event) => this.from && event.buttons & 1 && this.move(event), end = () => (this.from = null);
    set(view.svg, { onpointerdown: begin, onpointermove: move, onpointerup: end, onpointercancel: end });
    this.grip.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false }); // parts of an SVG have no touch-action
    set(this.grip, { onkeydown: (event) => this.key(event) });
  }

  // `kind` or nothing; `value` of it, from `least` to `most`, its `label` and `unit`, and the gap from which on contacts do not overlap.
  load({ kind, value, least = 0, most, safe, label, unit, isFirst }) {
    const own = GRIPS[kind] ?? {}, { engine } = this.view, has = kind && (own.engine ?? engine) === engine, isSlider = has && (own.engine ? true : isFirst);
    if (kind !== this.asked) Object.assign(this, { asked: kind, from: null }); // another screen while it is dragged
    Object.assign(this, { kind: has ? kind : "", own, value, least, most, safe });
    const shown = kind === "guess" ? this.view.guessSaid(value ?? "–") : value ? quantity(value, unit) : plain("touching");
    text(this.parts[3], kind === "guess" || kind === "gap" ? "" : shown);
    set(this.grip, {
      class: `grip grip-${kind}`, visibility: has ? "visible" : "hidden", tabindex: isSlider ? 0 : null, role: isSlider ? "slider" : null, "aria-hidden": isSlider ? null : "true", "aria-orientation": kind === "m2" ? "horizontal" : "vertical",
      "aria-label": label, "aria-valuemin": least, "aria-valuemax": most, "aria-valuenow": value ?? 1, "aria-valuetext": shown,
    });
  }

  // Where it is; seen where it can be set, and not behind what moves.
  show({ zoom, time }) {
    const { view, own, kind } = this;
    if (!kind) return;
    const { x, y, r, arrows, said, spring } = own.at(view, this), isSeen = kind === "guess" || (own.isFar ? time <= 1e-9 - view.film.fall : zoom > 0.9), [disc, coil, marks, words] = this.parts;
    this.r = view.placed[view.top].r;
    set(disc, { cx: x, cy: y.toFixed(1), r });
    set(coil, { d: spring ?? "" });
    set(marks, { d: arrows });
    set(words, { x: said[0], y: said[1] });
    for (const part of [coil, marks, words]) set(part, { opacity: isSeen ? 1 : 0 });
  }

  pixels({ clientX, clientY }) {
    const { svg: host, tall } = this.view, box = host.getBoundingClientRect(), scale = tall / box.height;
    return [(clientX - box.left) * scale, (clientY - box.top) * scale];
  }

  begin(event) {
    const { kind, own, value } = this;
    if (!kind || (kind !== "guess" && !this.grip.contains(event.target))) return;
    this.view.svg.setPointerCapture(event.pointerId);
    event.preventDefault();
    if (kind !== "guess") this.poised(own.isFar);
    this.from = { at: this.pixels(event), value, r: this.r };
    if (kind === "guess") this.move(event);
  }

  move(event) {
    this.take(this.own.pull(this.view, this.from, this.pixels(event), this));
  }

  key(event) {
    const { kind, own, least, most, safe } = this, ends = { Home: least, End: kind === "gap" ? min(most, 1.1 * safe) : most };
    if (!kind || !(event.key in WAYS || event.key in ends)) return;
    event.preventDefault();
    event.stopPropagation();
    if (kind !== "guess") this.poised(own.isFar);
    this.take(ends[event.key] ?? own.key(this, WAYS[event.key]));
  }

  take(asked) {
    const { kind, own, least, most } = this;
    this.taken(kind, own.tidy(min(most, max(least, asked))));
  }
}
