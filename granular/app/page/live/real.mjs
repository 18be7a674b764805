// Real balls: how far the heights depend on contact times that are estimates.
import { $, whenIdle } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { ballValues } from "../physics/setups.mjs";
import { spreadOf } from "../physics/spread.mjs";
import { told } from "./words.mjs";
import { abs, max } from "../physics/numbers.mjs";

const USUAL = 1.2; // factor of a contact time

export class Spread {
  constructor(balls) {
    this.balls = Object.values(balls);
  }

  // Nine more runs, when nothing else is to be done.
  load(name, values, isStory) {
    const key = name === "real-balls" ? JSON.stringify([values, isStory]) : "";
    $(".spread").hidden = !key;
    if (!key || key === this.key) return;
    this.key = key;
    whenIdle(() => key === this.key && this.show(values, isStory));
  }

  show(values, isStory) {
    const factors = [1, 2].map((i) => this.factorOf(values, i)), found = spreadOf(values, factors);
    if (!found) return told($(".spread"), "");
    const uncertain = max(...factors) > 1.5 ? { say: "factor-two" } : { say: "twenty-percent" };
    const n = digits(found[0], 2) === digits(found[1], 2) ? 3 : 2, [low, high] = found.map((rise) => digits(isStory ? rise * values.height : rise, n));
    told($(".spread"), "spread", { low, high, unit: isStory ? "m" : { say: "unit-in-drops" }, uncertain });
  }

  factorOf(values, i) {
    const same = (ball) => Object.entries(ballValues(ball, i)).every(([key, x]) => abs(values[key] - x) <= 1e-9 * x);
    return this.balls.find(same)?.at(-1) ?? USUAL;
  }
}
