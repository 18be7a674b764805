// A lens on the place where two balls touch: their distance on its own scale, and its number.
import { set, svg, text } from "../shell/dom.mjs";
import { digits, quantity } from "../shell/format.mjs";
import { plain } from "./words.mjs";
import { abs, max } from "../physics/numbers.mjs";

const FARTHEST = 1.7; // radii of the lens

export class Lens {
  constructor(engine) {
    const id = `lens-${engine}`;
    this.cut = svg("circle");
    this.glass = svg("circle", { class: "lens-glass" });
    [this.lower, this.upper] = ["lower", "upper"].map((side) => svg("circle", { class: `lens-ball ${side}` }));
    this.stalk = svg("line", { class: "lens-stalk" });
    this.value = svg("text", { class: "lens-value", "text-anchor": "middle" });
    this.times = svg("text", { class: "lens-times", "text-anchor": "middle" });
    const inside = svg("g", { "clip-path": `url(#${id})` }, this.lower, this.upper);
    this.element = svg("g", { class: "lens" }, svg("clipPath", { id }, this.cut), this.stalk, this.glass, inside, svg("circle", { class: "lens-rim" }), this.value, this.times);
    this.rim = this.element.querySelector(".lens-rim");
  }

  // Round (cx, cy), of radius r; `range` is the distance in m that fills most of it, `natural` how many pixels a metre has; balls touch
  // where less than `least` is between them: that is rounding.
  layout({ cx, cy, r, upright, range, natural, least }) {
    Object.assign(this, { cx, cy, r, upright, least, valueAt: cy + r + 13, scale: (0.9 * r) / range });
    for (const circle of [this.cut, this.glass, this.rim]) set(circle, { cx, cy, r });
    set(this.value, { x: cx, y: cy + r + 17 });
    set(this.times, { x: cx, y: cy - r - 7 });
    this.power = `× ${digits(this.scale / natural, 2)}`;
  }

  // Balls farther apart than the lens is wide are at its rim, and it says no magnification.
  show(distance, touch) {
    const { cx, cy, r, upright, scale } = this, big = 3 * r, wide = distance * scale, isFar = wide > FARTHEST * r;
    const half = (isFar ? FARTHEST * r : max(-r, wide)) / 2 + big;
    for (const [circle, side] of [[this.lower, upright ? 1 : -1], [this.upper, upright ? -1 : 1]]) {
      set(circle, upright ? { cx, cy: (cy + side * half).toFixed(2), r: big } : { cx: (cx + side * half).toFixed(2), cy, r: big });
    }
    set(this.stalk, { x1: touch[0], y1: touch[1], x2: cx - r, y2: cy });
    text(this.times, isFar ? "" : this.power);
    const isTouch = abs(distance) < this.least;
    set(this.value, { x: isTouch ? cx + r : cx, "text-anchor": isTouch ? "end" : "middle" });
    text(this.value, isTouch ? plain("touching") : quantity(distance, "m", 2));
  }
}
