// One slider with its symbol, name, value and perhaps a mark; or a choice of a few.
import { h, marked, set, text } from "../shell/dom.mjs";
import { quantity } from "../shell/format.mjs";
import { plain } from "./words.mjs";
import { round } from "../physics/numbers.mjs";

const STEPS = 1000;

// In words, with the ball it is of where it stands alone.
export const titleOf = ({ label, of }) => (of ? plain("group-" + of) + ": " : "") + plain(`label-${label}`);

export function slider(spec, changed) {
  const { name, symbol, unit } = spec, whole = spec.scale === "whole";
  const id = `slider-${name}`, value = h("output", { for: id, "aria-live": "off" });
  const input = h("input", {
    id, type: "range", min: whole ? spec.min : 0, max: whole ? spec.max : STEPS, step: 1, "data-name": name,
    oninput: () => changed(whole ? Number(input.value) : fromShare(spec, input.value / STEPS)),
  });
  forgetsSwipes(input);
  const tick = h("span", { class: "slider-mark", hidden: true }), note = h("span", { class: "slider-note" });
  const track = h("div", { class: "slider-track" }, input, tick, note);
  const element = h("div", { class: "slider" }, h("label", { for: id }, h("i", {}, ...marked(symbol)), " ", titleOf(spec)), value, track);
  const show = (values) => {
    const x = values[name], shown = spec.zero && x === 0 ? plain("touching") : quantity(x, unit);
    if (document.activeElement !== input || fromShare(spec, input.value / STEPS) !== x) input.value = whole ? x : round(toShare(spec, x) * STEPS);
    if (name === "moving") input.max = values.n - 1;
    set(input, { "aria-valuetext": shown });
    text(value, shown);
  };
  const mark = (x, words) => {
    const share = toShare(spec, x), isIn = share > 0 && share < 1;
    set(tick, { hidden: !isIn });
    note.replaceChildren(...marked(isIn ? words : ""));
    tick.style.left = note.style.left = `calc(9px + ${share.toFixed(4)} * (100% - 18px))`;
    note.classList.toggle("late", share > 0.5);
  };
  return { name, element, show, mark };
}

// A swipe that turns out to scroll the page leaves the slider as it was; after a drag the keys are the film's again.
function forgetsSwipes(input) {
  let before = null;
  input.addEventListener("pointerdown", () => (before = input.value), true);
  input.addEventListener("pointercancel", () => {
    if (before === null || before === input.value) return;
    input.value = before;
    input.dispatchEvent(new Event("input", { bubbles: true }));
  });
  set(input, { onpointerup: () => setTimeout(() => input.blur()) });
}

export function choice({ name, label, options, min }, changed) {
  const buttons = options.map((option, i) => {
    const input = h("input", { type: "radio", name: `choice-${name}`, value: i, onchange: () => changed(i + min) });
    return { input, element: h("label", {}, input, " ", plain(`option-${option}`)) };
  });
  const element = h("fieldset", { class: "choice", "data-name": name }, h("legend", {}, plain(`label-${label}`)), ...buttons.map((b) => b.element));
  const show = (values) => buttons.forEach(({ input }, i) => (input.checked = values[name] === i + min));
  return { name, element, show, mark: () => {} };
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
