// Scene buttons, presets and sliders with units.
import { $, h, set, text } from "../shell/dom.mjs";
import { quantity } from "../shell/format.mjs";
import { cleaned, SETUPS } from "../physics/setups.mjs";

const STEPS = 1000;

export class Controls {
  constructor({ changed, chosen }) {
    Object.assign(this, { changed, chosen, rows: [] });
    this.tabs = Object.entries(SETUPS).map(([name, { title }]) =>
      h("button", { type: "button", "data-scene": name, onclick: () => chosen(name) }, title));
    $(".scenes").append(...this.tabs);
  }

  load(name, values) {
    if (name !== this.name) this.build(name);
    this.values = values;
    for (const tab of this.tabs) set(tab, { "aria-pressed": String(tab.dataset.scene === name) });
    for (const row of this.rows) row.show(values);
    this.markPresets();
  }

  build(name) {
    this.name = name;
    this.rows = SETUPS[name].sliders.map((spec) => slider(spec, (value) => this.changed({ [spec.name]: value })));
    $(".sliders").replaceChildren(...this.rows.map((row) => row.element));
    const base = Object.values(SETUPS[name].presets)[0];
    this.presets = Object.entries(SETUPS[name].presets).map(([label, values]) => {
      const whole = cleaned(name, { ...base, ...values });
      return { whole, button: h("button", { type: "button", onclick: () => this.changed(whole) }, label) };
    });
    $(".presets").replaceChildren(...this.presets.map((p) => p.button));
  }

  markPresets() {
    for (const { whole, button } of this.presets) {
      const same = Object.keys(whole).every((key) => Math.abs(whole[key] - this.values[key]) <= 1e-9 * Math.abs(whole[key]));
      set(button, { "aria-pressed": String(same) });
    }
  }
}

function slider(spec, changed) {
  const { name, label, symbol, unit } = spec, whole = spec.scale === "whole";
  const id = `slider-${name}`, value = h("output", { for: id });
  const input = h("input", {
    id, type: "range", min: whole ? spec.min : 0, max: whole ? spec.max : STEPS, step: 1, "data-name": name,
    oninput: () => changed(whole ? Number(input.value) : fromShare(spec, input.value / STEPS)),
  });
  const element = h("div", { class: "slider" }, h("label", { for: id }, h("i", {}, symbol), ` ${label}`), value, input);
  const show = (values) => {
    const x = values[name], shown = spec.zero && x === 0 ? "0, touching" : quantity(x, unit);
    if (document.activeElement !== input || fromShare(spec, input.value / STEPS) !== x) input.value = whole ? x : Math.round(toShare(spec, x) * STEPS);
    if (name === "moving") input.max = values.n - 1;
    set(input, { "aria-valuetext": shown });
    text(value, shown);
  };
  return { element, show };
}

// Three digits: what is shown is what is run, and what the link holds.
function fromShare({ min, max, scale, zero }, share) {
  if (zero && share === 0) return 0;
  const x = scale === "log" ? min * (max / min) ** share : min + share * (max - min);
  return Number(x.toPrecision(3));
}

function toShare({ min, max, scale }, x) {
  if (x <= min) return 0;
  return scale === "log" ? Math.log(x / min) / Math.log(max / min) : (x - min) / (max - min);
}
