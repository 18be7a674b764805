// Six screens over the same engines, from one bouncing ball to the real demonstration; the last is the laboratory.
import { $, h, set, text } from "../shell/dom.mjs";
import { SETUPS } from "../physics/setups.mjs";
import { has, plain, told } from "./words.mjs";

export const LAB = 7;
const STACK = "basketball+tennis ball", SINGLE = ["basketball", "tennis ball", "table-tennis ball", "golf ball", "superball", "steel ball"];
const TEXTBOOK = { m1: 2, m2: 1e-3, e1: 1, e2: 1, gap: 1e-3 };

// What each screen begins with; `only`: its sliders, `presets`: its buttons.
const SCREENS = [
  { scene: "bouncing-ball", only: [], presets: () => pick("bouncing-ball", SINGLE) },
  { scene: "real-balls", values: TEXTBOOK, only: [], presets: () => ({ textbook: TEXTBOOK, masses: { e1: 1, e2: 1, gap: 1e-3 }, losses: { gap: 1e-3 } }), hardOnly: true },
  { scene: "real-balls", values: { gap: 1e-3 }, only: [], presets: () => ({}), predict: true },
  { scene: "real-balls", values: { gap: 1e-3 }, only: [], presets: () => ({}) },
  { scene: "real-balls", values: { gap: 1e-3 }, only: ["gap"], presets: () => ({}) },
  { scene: "real-balls", only: ["gap", "rule", "bounces"], presets: () => SETUPS["real-balls"].presets },
];

const pick = (scene, names) => Object.fromEntries(names.map((name) => [name, SETUPS[scene].presets[name]]));

export const screenOf = (number) => SCREENS[number - 1] ?? {};
export const startOf = (number) => {
  const { scene, values } = screenOf(number);
  return { name: scene, values: { ...(SETUPS[scene].presets[STACK] ?? Object.values(SETUPS[scene].presets)[0]), ...values } };
};

export class Story {
  constructor(go) {
    this.go = go;
    this.steps = Array.from({ length: LAB }, (_, i) => h("button", { type: "button", "data-screen": i + 1, onclick: () => go(i + 1) }));
    $(".steps").append(...this.steps.map((button) => h("li", {}, button)));
    $(".story-back").addEventListener("click", () => this.turn(-1));
    $(".story-next").addEventListener("click", () => this.turn(1));
  }

  turn(way) {
    this.go(this.screen + way);
    $(".steps").scrollIntoView({ block: "start" });
  }

  load(screen) {
    this.screen = screen;
    document.body.dataset.screen = screen;
    document.body.classList.toggle("hard-only", Boolean(screenOf(screen).hardOnly));
    for (const section of document.querySelectorAll("[data-on]")) section.classList.toggle("off", !section.dataset.on.split(" ").includes(String(screen)));
    this.steps.forEach((button, i) => {
      text(button, i + 1 === LAB ? plain("lab-short") : String(i + 1));
      set(button, { "aria-current": i + 1 === screen ? "step" : null, "aria-label": plain(`s${i + 1}-title`) });
    });
    told($(".story-title"), `s${screen}-title`);
    const keys = ["a", "b", "c"].map((part) => `s${screen}-${part}`).filter(has);
    const paragraphs = keys.map((key) => h("p", {}));
    $(".story-text").replaceChildren(...paragraphs);
    keys.forEach((key, i) => told(paragraphs[i], key));
    $(".story-back").hidden = screen === 1;
    $(".story-next").hidden = screen === LAB;
    told($(".story-next"), screen === LAB - 1 ? "to-lab" : "next");
  }
}
