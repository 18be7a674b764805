// Predict first: results stay covered until a guess is made; then the run plays and the guess is held against it.
import { $, set, text } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { plain, told } from "./words.mjs";

export class Predict {
  constructor({ ruler, reveal, switched }) {
    Object.assign(this, { ruler, reveal, on: false, answered: null });
    this.form = $(".predict");
    this.guess = $(".guess");
    $(".predict-button").addEventListener("click", () => {
      this.set(!this.on);
      switched();
    });
    this.guess.addEventListener("input", () => this.take(this.guess.value / 100));
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.answer();
    });
  }

  set(on) {
    this.on = on;
    this.ruler.guess = null;
    this.answered = null;
    this.cover(on);
    set($(".predict-button"), { "aria-pressed": String(on) });
  }

  // Covered, the page shows the start and nothing else.
  load(report, setup) {
    Object.assign(this, { report, setup });
    const falls = report.scene.gravity > 0;
    told($(".question"), falls ? "ask-height" : "ask-speed");
    $(".guess-row").hidden = falls;
    this.guess.max = 100 * setup.most;
    if (this.on && !this.answered) this.cover(true);
    else this.tell();
  }

  cover(covered) {
    this.covered = covered;
    this.form.hidden = !covered;
    document.body.classList.toggle("covered", covered);
    const asks = covered && this.report?.scene.gravity > 0;
    $(".theatre").classList.toggle("far", Boolean(asks));
    if (asks) this.ruler.layout({ scene: this.report.scene, most: this.setup.most, lanes: [], asks: true });
    if (covered) this.take(this.ruler.guess);
    this.tell();
  }

  // Nothing is chosen beforehand: there is no answer before there is a guess.
  take(guess) {
    this.ruler.guess = guess;
    $(".run").disabled = guess === null;
    const shown = guess === null ? "–" : digits(guess, 3);
    text($(".guess-value"), shown);
    set(this.guess, { "aria-valuetext": shown });
  }

  answer() {
    const [hard, soft] = [this.report.hard, this.report.soft].map(this.setup.measure), guess = this.ruler.guess;
    this.answered = { guess, hard, soft, nearer: { say: Math.abs(guess - hard) < Math.abs(guess - soft) ? "hard-spheres" : "soft-spheres" } };
    this.cover(false);
    this.reveal();
  }

  tell() {
    if (!this.answered) return told($(".told"), "");
    const { hard, soft } = this.answered, agree = Math.abs(hard - soft) < 0.02 * Math.max(1, hard);
    told($(".told"), agree ? "told-agree" : "told", { ...this.answered, unit: plain(`unit-${this.setup.measured}`) });
  }
}
