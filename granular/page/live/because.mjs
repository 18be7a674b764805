// The reason, live: the push of the floor in time, and shaded the part of it during which the ball above presses too.
import { $, h, markup, set, svg } from "../shell/dom.mjs";
import { quantity } from "../shell/format.mjs";
import { pairName } from "../physics/verdict.mjs";
import { plain, told } from "./words.mjs";

const WIDE = 300, TALL = 64, LOW = 46; // pixels

export class Because {
  constructor() {
    this.line = h("p", { class: "because-line" });
    this.chart = svg("svg", { class: "push", viewBox: `0 0 ${WIDE} ${TALL}`, role: "img" });
    $(".because").append(this.line, this.chart);
  }

  load(report, reason) {
    $(".because").classList.toggle("empty", !reason);
    if (!reason) return told(this.line, "because-none");
    const { pair, lasts, arrives, share } = reason, names = { below: pairName(report.scene, pair), next: pairName(report.scene, pair + 1) };
    told(this.line, share > 0 ? "because-share" : "because-apart", { ...names, lasts: [lasts, "s"], arrives: [arrives, "s"], share: percent(share) });
    set(this.chart, { "aria-label": plain("push-said", { share: percent(share) }) });
    this.draw(reason);
  }

  draw({ curve, parts, lasts, arrives, share }) {
    const most = Math.max(lasts, arrives) * 1.02, peak = Math.max(...curve.map(([, f]) => f)) || 1;
    const x = (t) => ((t / most) * WIDE).toFixed(1), y = (f) => (LOW - (f / peak) * (LOW - 4)).toFixed(1);
    const area = (points, from, to) => `M${x(from)} ${LOW}${points.map(([t, f]) => `L${x(t)} ${y(f)}`).join("")}L${x(to)} ${LOW}z`;
    const shaded = parts.map(([a, b]) => markup("path", { class: "push-both", d: area(curve.filter(([t]) => t >= a && t <= b), a, b) }));
    const note = (t, words, anchor) => markup("text", { x: x(t), y: TALL - 3, "text-anchor": anchor, class: "ruler-tick" }, words);
    this.chart.innerHTML = markup("path", { class: "push-all", d: area(curve, 0, lasts) }) + shaded.join("") + markup("line", { x1: 0, x2: WIDE, y1: LOW, y2: LOW, class: "zero-line" })
      + markup("path", { class: "push-arrives", d: `M${x(arrives)} ${LOW + 4}V2` }) + note(0, "0", "start")
      + note(most, quantity(lasts, "s", 2), "end") + note(share > 0 ? 0.5 * most : 0.3 * most, plain("push-shared", { share: percent(share) }), "middle");
  }
}

// With the digits that matter: 8.4 %, 77 %, 0 %.
const percent = (share) => ({ say: "percent", n: 100 * share < 10 ? Number((100 * share).toPrecision(2)) : Math.round(100 * share) });
