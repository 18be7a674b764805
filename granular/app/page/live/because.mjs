// The reason, live: the push of the floor in time, and shaded the part of it during which the ball above presses too.
import { $, h, markup, set, svg, text } from "../shell/dom.mjs";
import { quantity } from "../shell/format.mjs";
import { reasonSaid, shareSaid } from "../physics/reason.mjs";
import { plain, told } from "./words.mjs";
import { max } from "../physics/numbers.mjs";

const WIDE = 300, LOW = 60; // of the drawing

export class Because {
  constructor() {
    this.line = h("p", { class: "because-line" });
    this.chart = svg("svg", { class: "push", viewBox: `0 0 ${WIDE} ${LOW + 3}`, preserveAspectRatio: "none", role: "img" });
    this.words = ["0", "", ""].map((word) => h("span", {}, word));
    $(".because").append(this.line, this.chart, h("p", { class: "push-key", "aria-hidden": "true" }, ...this.words));
  }

  load(report, reason) {
    const said = reasonSaid(report, reason), isEmpty = !said.below;
    $(".because").classList.toggle("empty", isEmpty);
    told(this.line, said.say, said);
    if (isEmpty) return;
    set(this.chart, { "aria-label": plain("push-said", { share: said.share }) });
    this.draw(reason);
  }

  draw({ curve, parts, lasts, arrives, share }) {
    const most = max(lasts, arrives), peak = max(...curve.map(([, f]) => f)) || 1;
    const x = (t) => ((t / most) * WIDE).toFixed(1), y = (f) => (LOW - (f / peak) * (LOW - 4)).toFixed(1);
    const line = (points) => points.map(([t, f]) => `L${x(t)} ${y(f)}`).join(""), area = (points, from, to) => `M${x(from)} ${LOW}${line(points)}L${x(to)} ${LOW}z`;
    const shaded = parts.map(([a, b]) => markup("path", { class: "push-both", d: area(curve.filter(([t]) => t >= a && t <= b), a, b) }));
    const base = markup("line", { x1: 0, x2: WIDE, y1: LOW, y2: LOW, class: "zero-line" });
    this.chart.innerHTML = markup("path", { class: "push-all", d: area(curve, 0, lasts) }) + shaded.join("") + base + markup("path", { class: "push-arrives", d: `M${x(arrives)} ${LOW + 3}V2` });
    text(this.words[1], plain("push-shared", { share: shareSaid(share) }));
    text(this.words[2], quantity(most, "s", 2));
  }
}
