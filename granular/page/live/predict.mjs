// Predict first: results stay covered until a guess is made; then the run plays and the guess is held against it.
import { $, set, text } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";

export class Predict {
  constructor({ reveal, switched }) {
    Object.assign(this, { reveal, on: false });
    this.form = $(".predict");
    this.guess = $(".guess");
    $(".predict-button").addEventListener("click", () => {
      this.set(!this.on);
      switched();
    });
    this.guess.addEventListener("input", () => this.showGuess());
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.answer();
    });
  }

  set(on) {
    this.on = on;
    this.cover(on);
    set($(".predict-button"), { "aria-pressed": String(on) });
    text($(".told"), "");
  }

  load(report, setup) {
    Object.assign(this, { report, setup });
    text($(".question"), setup.question);
    this.guess.max = 100 * setup.most;
    this.showGuess();
    if (this.on) this.cover(true);
  }

  // Covered, the page shows the start and nothing else.
  cover(covered) {
    this.covered = covered;
    this.form.hidden = !covered;
    document.body.classList.toggle("covered", covered);
    if (covered) text($(".told"), "");
  }

  showGuess() {
    const shown = digits(this.guess.value / 100, 3);
    text($(".guess-value"), shown);
    set(this.guess, { "aria-valuetext": shown });
  }

  answer() {
    const { setup, report } = this, guess = this.guess.value / 100;
    const [hard, soft] = [setup.asked(report.hard), setup.asked(report.soft)];
    const said = new FormData(this.form).get("agree") === "yes", agree = report.verdict.startsWith("Yes");
    const nearer = Math.abs(guess - hard) < Math.abs(guess - soft) ? "hard" : "soft";
    const who = agree ? "" : ` You were nearer to the ${nearer} spheres.`;
    text($(".told"), `You guessed ${digits(guess, 3)}. Hard spheres say ${digits(hard, 3)}, soft spheres ${digits(soft, 3)}.${who} `
      + `That the engines ${agree ? "agree" : "disagree"} you had ${said === agree ? "foreseen" : "not foreseen"}.`);
    this.covered = false;
    this.form.hidden = true;
    document.body.classList.remove("covered");
    this.reveal();
  }
}
