// Predict first: results stay covered until a guess is made; then the film runs, its end tells the answer, and asks why.
import { $, classes, h, set, text } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { plain, told } from "./words.mjs";
import { abs, max } from "../physics/numbers.mjs";

export const CAUSES = ["weight", "losses", "overlap"];

export class Predict {
  // `guessed`: another guess; `reveal`: the film is to run; `switched`: predicting is chosen, or no longer; `uncovered`: what
  // was hidden is to be seen.
  constructor({ guessed, reveal, switched, uncovered }) {
    Object.assign(this, { guessed, reveal, uncovered, on: false, guess: null, answered: null, isTold: false });
    this.form = $(".predict");
    this.bar = $(".guess");
    $(".predict-button").addEventListener("click", () => {
      this.set(!this.on);
      switched();
    });
    set(this.bar, { oninput: () => this.take(this.bar.value / 100) });
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.answer();
    });
  }

  // `guess`: made before.
  set(on, guess = null) {
    Object.assign(this, { on, guess, answered: null, isTold: false, why: null });
    this.cover(on);
    set($(".predict-button"), { "aria-pressed": String(on) });
  }

  // Covered, the page shows the start and nothing else.
  load(report, setup, isStory) {
    Object.assign(this, { report, setup, isStory });
    const falls = report.scene.gravity > 0;
    told($(".question"), falls ? "ask-height" : "ask-speed");
    $(".guess-row").hidden = falls;
    this.bar.max = 100 * setup.most;
    this.cover(this.on && !this.answered);
  }

  cover(covered) {
    this.covered = covered;
    this.form.hidden = !covered;
    classes(document.body, { asked: covered, covered: this.on && !this.isTold });
    this.showGuess();
    this.tell();
  }

  // Nothing is chosen beforehand: there is no answer before there is a guess.
  take(guess) {
    this.guess = guess;
    this.showGuess();
    this.guessed();
  }

  showGuess() {
    const shown = this.guess === null ? "–" : digits(this.guess, 3);
    $(".run").disabled = this.guess === null;
    text($(".guess-value"), shown);
    set(this.bar, { "aria-valuetext": shown });
  }

  answer() {
    const [hard, soft] = [this.report.hard, this.report.soft].map(this.setup.measure), { guess } = this;
    this.answered = { guess, hard, soft, nearer: { say: abs(guess - hard) < abs(guess - soft) ? "hard-spheres" : "soft-spheres" } };
    this.cover(false);
    this.reveal();
  }

  // The film has come to its end: now the answer may be told.
  ended() {
    if (!this.answered || this.isTold) return;
    this.isTold = true;
    this.cover(false);
    this.uncovered();
  }

  tell() {
    $(".why").hidden = true;
    if (!this.isTold) return told($(".told"), this.answered ? "watch" : "");
    const { hard, soft } = this.answered, agree = this.report.answer === "yes" && abs(hard - soft) < 0.02 * max(1, hard);
    if (!Number.isFinite(hard - soft)) return told($(".told"), "undecided", { engine: { say: Number.isFinite(hard) ? "soft-spheres" : "hard-spheres" } });
    const { scene } = this.report, inMetres = (x) => (this.isStory ? x * scene.drop : x), { guess, nearer } = this.answered;
    told($(".told"), agree ? "told-agree" : "told", { guess: inMetres(guess), hard: inMetres(hard), soft: inMetres(soft), nearer, unit: this.isStory ? "m" : plain(`unit-${this.setup.measured}`) });
    if (!agree && this.report.scene.gravity) this.ask();
  }

  // Why do they differ? Three causes to choose from, each with its answer.
  ask() {
    const answer = h("p", { class: "why-answer", role: "status" });
    const buttons = CAUSES.map((cause) => h("button", { "data-cause": cause, "aria-pressed": String(this.why === cause), onclick: () => choose(cause) }, plain(`why-${cause}`)));
    const choose = (cause) => {
      this.why = cause;
      buttons.forEach((button, i) => set(button, { "aria-pressed": String(CAUSES[i] === cause) }));
      told(answer, `because-${cause}`);
    };
    $(".why").replaceChildren(h("p", { class: "question" }, plain("why")), h("div", { class: "presets" }, ...buttons), answer);
    $(".why").hidden = false;
    if (this.why) choose(this.why);
  }
}
