// The reason, live: two bars on one scale, how long a contact lasts and when the next ball arrives.
import { $, h, set, text } from "../shell/dom.mjs";
import { pairName } from "../physics/verdict.mjs";
import { plain, say, told } from "./words.mjs";
import { quantity } from "../shell/format.mjs";

export class Because {
  constructor() {
    this.box = $(".because");
    this.line = h("p", { class: "because-line" });
    this.bars = ["lasts", "arrives"].map((kind) => bar(kind));
    this.box.append(this.line, h("div", { class: "because-bars", "aria-hidden": "true" }, ...this.bars.map((b) => b.element)));
  }

  load(report, reason) {
    this.box.classList.toggle("empty", !reason);
    if (!reason) return told(this.line, "because-none");
    const { lasts, arrives, isEarly, pair } = reason, most = Math.max(lasts, arrives);
    const below = pairName(report.scene, pair), next = pairName(report.scene, pair + 1);
    told(this.line, isEarly ? "because-early" : "because-late", { below, next, lasts: [lasts, "s"], arrives: [arrives, "s"] });
    this.bars[0].show(lasts / most, say("bar-lasts", { pair: below }), quantity(lasts, "s"));
    this.bars[1].show(arrives / most, say("bar-arrives", { pair: next }), quantity(arrives, "s"));
    set(this.box, { "aria-label": plain("because") });
  }
}

function bar(kind) {
  const name = h("span", { class: "bar-name" }), fill = h("span", { class: `bar-fill ${kind}` }), value = h("b");
  const element = h("div", { class: "because-bar" }, name, h("span", { class: "bar-track" }, fill), value);
  const show = (share, called, amount) => {
    fill.style.width = `${Math.max(0.5, 100 * share).toFixed(1)}%`;
    text(name, called);
    text(value, amount);
  };
  return { element, show };
}
