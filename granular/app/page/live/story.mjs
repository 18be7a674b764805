// The drop, six screens over the same engines from a guess to the real demonstration, and the laboratory.
import { $, classes, h, set, text } from "../shell/dom.mjs";
import { SETUPS } from "../physics/setups.mjs";
import { has, plain, told } from "./words.mjs";

export const OPENING = 0;
export const GUESS = 1;
export const LAB = 7;
const CLOSE = 1e-6; // m: all but touching
const STACK = "basketball+tennis ball", PINGPONG = "basketball+table-tennis ball", NEAR = { gap: 1e-3 };
const SINGLE = ["basketball", "tennis ball", "table-tennis ball", "golf ball", "superball", "steel ball"];
const TEXTBOOK = { m2: 1e-3, r2: 0.0139, e1: 1, e2: 1, gap: 1e-3 };

// What each screen begins with; `only`: its sliders, `presets`: its buttons, `grips`: what can be dragged.
const SCREENS = [
  { engine: "soft" },
  { predict: true },
  { scene: "bouncing-ball", values: {}, grips: ["height"], presets: () => pick("bouncing-ball", SINGLE) },
  { values: TEXTBOOK, grips: ["gap", "m2"], presets: () => ({ textbook: TEXTBOOK, masses: { e1: 1, e2: 1, gap: 1e-3 }, losses: NEAR }), engine: "hard" },
  { grips: ["gap", "t1"] },
  { grips: ["gap"] },
  { from: PINGPONG, values: { gap: CLOSE }, only: ["gap", "rule", "bounces"], presets: () => close(SETUPS["real-balls"].presets), grips: ["gap"] },
].map((own) => ({ scene: "real-balls", values: NEAR, grips: [], only: own.grips ?? [], presets: () => ({}), ...own }));

const close = (presets) => Object.fromEntries(Object.entries(presets).map(([name, values]) => [name, { ...values, gap: CLOSE }]));
const pick = (scene, names) => Object.fromEntries(names.map((name) => [name, SETUPS[scene].presets[name]]));

export const screenOf = (number) => SCREENS[number] ?? {};
// A setting that stands alone says of which ball it is, and ends where the picture does.
const ENDS = { t1: { min: 1e-4 }, m2: { max: 0.62 } }; // kg: 0.624 is the basketball, whose mass is its own
export const alone = ({ group, ...spec }) => ({ ...spec, ...ENDS[spec.name], of: group });
// In the story a ball of another mass is another ball, as dense as the lower one.
export const another = (screen, { m1, r1 }, { m2, r2 }) => (screen < LAB && m2 && !r2 ? { r2: r1 * Math.cbrt(m2 / m1) } : {});
export const startOf = (number) => {
  const { scene, values, from = STACK } = screenOf(number), { presets } = SETUPS[scene];
  return { name: scene, values: { ...(presets[from] ?? Object.values(presets)[0]), ...values } };
};

export class Story {
  constructor(go) {
    this.go = go;
    this.steps = Array.from({ length: LAB }, (_, i) => h("button", { "data-screen": i + 1, onclick: () => go(i + 1) }));
    $(".steps").append(...this.steps.map((button) => h("li", {}, button)));
    set($(".story-back"), { onclick: () => this.turn(-1) });
    set($(".story-next"), { onclick: () => this.turn(1) });
  }

  turn(way) {
    this.go(this.screen + way);
    scrollTo(0, 0);
  }

  // What to try in a scene of the laboratory.
  suggest(name) {
    if (this.screen === LAB) told($(".story-text").lastChild, `try-${name}`);
  }

  load(screen) {
    this.screen = screen;
    document.body.dataset.screen = screen;
    const { engine } = screenOf(screen);
    classes(document.body, { tale: screen < LAB, lab: screen === LAB, drop: screen === OPENING, "hard-only": engine === "hard", "soft-only": engine === "soft" });
    for (const section of document.querySelectorAll("[data-on]")) classes(section, { off: !section.dataset.on.includes(screen) });
    this.steps.forEach((button, i) => {
      const isLab = i + 1 === LAB, name = plain(`s${i + 1}-title`);
      text(button, isLab ? plain("lab-short") : String(i + 1));
      set(button, { "aria-current": i + 1 === screen ? "step" : null, "aria-label": isLab ? `${plain("lab-short")}: ${name}` : `${i + 1}: ${name}` });
    });
    told($(".story-title"), `s${screen}-title`);
    const keys = ["a", "b", "c"].map((part) => `s${screen}-${part}`).filter(has);
    const paragraphs = [...keys, ...(screen === LAB ? [""] : [])].map(() => h("p", {}));
    $(".story-text").replaceChildren(...paragraphs);
    keys.forEach((key, i) => told(paragraphs[i], key));
    $(screenOf(screen).predict ? ".why" : ".story-text").after($(".story-turn")); // a guess comes before what is next
    $(".story-back").hidden = screen <= GUESS;
    $(".story-next").hidden = screen === LAB;
    told($(".story-next"), { [OPENING]: "s1-title", [LAB - 1]: "to-lab" }[screen] ?? "next");
  }
}
