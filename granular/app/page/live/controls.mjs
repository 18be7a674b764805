// Scene buttons, presets and sliders with units.
import { $, h, set, text } from "../shell/dom.mjs";
import { cleaned, enoughFor, SETUPS } from "../physics/setups.mjs";
import { quantity } from "../shell/format.mjs";
import { choice, slider } from "./sliders.mjs";
import { alone } from "./story.mjs";
import { has, languageNow, plain, say } from "./words.mjs";
import { abs } from "../physics/numbers.mjs";

export class Controls {
  constructor({ changed, chosen }) {
    Object.assign(this, { changed, rows: [] });
    this.tabs = Object.keys(SETUPS).map((name) => h("button", { "data-scene": name, onclick: () => chosen(name) }));
    $(".scenes").append(...this.tabs);
  }

  // `only`: the sliders that a screen shows; `presets`: its own in place of the scene's.
  load(name, values, { only = null, presets = SETUPS[name].presets } = {}) {
    const shape = JSON.stringify([name, only, Object.keys(presets), languageNow()]);
    if (shape !== this.shape) this.build(name, only, presets);
    Object.assign(this, { shape, values });
    for (const row of this.rows) row.show(values);
    this.markPresets();
    this.offerGap();
    for (const tab of this.tabs) {
      set(tab, { "aria-pressed": String(tab.dataset.scene === name) });
      text(tab, say(`scene-${tab.dataset.scene}`));
    }
  }

  build(name, only, presets) {
    const specs = only ? SETUPS[name].sliders.filter((spec) => only.includes(spec.name)).map(alone) : SETUPS[name].sliders;
    const made = specs.map((spec) => [spec, (spec.scale === "choice" ? choice : slider)(spec, (value) => this.changed({ [spec.name]: value }))]);
    this.rows = made.map(([, row]) => row);
    const groups = [...new Set(specs.map((spec) => spec.group ?? ""))];
    $(".sliders").replaceChildren(...groups.map((group) => {
      const mine = made.filter(([spec]) => (spec.group ?? "") === group).map(([, row]) => row.element);
      return group ? h("details", {}, h("summary", {}, plain(`group-${group}`)), ...mine) : h("div", {}, ...mine);
    }));
    const base = Object.values(SETUPS[name].presets)[0];
    this.presets = Object.entries(presets).map(([label, given]) => {
      const whole = cleaned(name, { ...base, ...given });
      return { whole, button: h("button", { "data-preset": label, onclick: () => this.changed(whole) }, called(label)) };
    });
    this.apart = h("button", { class: "apart", onclick: () => this.changed({ gap: enoughFor(this.values) }) });
    $(".presets").replaceChildren(...this.presets.map((p) => p.button), this.apart);
  }

  // A gap from which on the balls of a preset collide one after the other.
  offerGap() {
    const gap = enoughFor(this.values), isOffered = this.presets.length > 0 && Number.isFinite(gap);
    set(this.apart, { hidden: !isOffered, "aria-pressed": String(this.values.gap === gap) });
    text(this.apart, plain("hold-above", { gap: [gap, "m"] }));
  }

  markPresets() {
    for (const { whole, button } of this.presets) {
      const same = Object.keys(whole).every((key) => abs(whole[key] - this.values[key]) <= 1e-9 * abs(whole[key]));
      set(button, { "aria-pressed": String(same) });
    }
  }

  // A mark on the slider of the gap: from there on contacts cannot overlap.
  markGap(gap) {
    const row = this.rows.find((one) => one.name === "gap");
    row?.mark(gap, Number.isFinite(gap) ? plain("gap-mark", { gap: [gap, "m", 2] }) : "");
  }
}

// A preset is a word of its own, or the names of two balls.
function called(label) {
  if (has(`preset-${label}`)) return say(`preset-${label}`);
  const names = label.split("+").map((name) => say(`ball-${name.replaceAll(" ", "-")}`)).join(" + ");
  return names.charAt(0).toLocaleUpperCase(languageNow()) + names.slice(1);
}

// A slider, its range and a value in words; of a choice its options.
export function inWords({ symbol, label, unit, zero, min, max, options }, x) {
  const name = symbol ?? plain(`label-${label}`);
  if (options) return { symbol: name, range: options.map((one) => plain(`option-${one}`)).join(", "), shown: plain(`option-${options[x - min]}`) };
  return { symbol: name, range: `${zero ? "0, " : ""}${quantity(min, unit)} – ${quantity(max, unit)}`, shown: quantity(x, unit) };
}
