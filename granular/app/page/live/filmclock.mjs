// The clock of a film: its time bar has three coloured parts, life, slow, life; beside it, how slow time goes.
import { $, set, text } from "../shell/dom.mjs";
import { Clock } from "../shell/clock.mjs";
import { digits, inThousands, quantity } from "../shell/format.mjs";
import { abs } from "../physics/numbers.mjs";

const WAIT = 1400; // ms before a film that loops begins anew
const isStill = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

export class FilmClock extends Clock {
  // `paced`: other seconds for the contacts; `ended`: the last picture is there.
  constructor(root, { paced, ended, ...rest }) {
    super(root, rest);
    Object.assign(this, { paced, ended, loops: false });
  }

  // Who waits at the touch goes on waiting there.
  load(film) {
    if (this.film && abs(this.share - this.film.poise) < 1e-6) this.share = film.poise;
    this.film = film;
    Object.assign(this, { span: [0, film.length], duration: film.length });
    this.go(this.share);
    const [from, to] = [film.fall, film.isFilm ? film.fly : film.length].map((t) => `${((100 * t) / film.length).toFixed(1)}%`);
    this.bar.style.setProperty("--from", from);
    this.bar.style.setProperty("--to", to);
  }

  // Asked for by hand: how long the contacts take.
  setDuration(seconds) {
    this.paced(seconds);
  }

  tell() {
    if (!this.film) return;
    const { slower, time, act } = this.film.at(this.time), now = quantity(time, "s", act === "slow" ? 4 : 2);
    text(this.readout, now);
    const pace = slower === Infinity ? this.say("film-freeze") : slower > 1.5 ? this.say("slowed", { n: inThousands(Number(slower.toPrecision(2))) }) : slower < 0.67 ? this.say("faster", { n: digits(1 / slower, 2) }) : this.say("film-life");
    text($(".slowdown", this.root), pace);
    set(this.bar, { "aria-valuetext": `${now}, ${pace}` });
  }

  // From the picture in which it waits the film begins with the fall.
  play() {
    if (this.locked() || this.playing) return;
    if (isStill() && this.film.isFilm) return this.loops ? this.poise() : this.go(1) || this.ended(); // the opening gives nothing away
    if (this.share >= 1 || abs(this.share - this.film.poise) < 1e-6) this.go(0);
    super.play();
  }

  // Whoever goes to the last picture by hand has seen the film too.
  go(share) {
    super.go(share);
    if (this.film && !this.playing && this.share >= 1) this.ended();
  }

  end() {
    if (!this.loops) this.pause();
    else setTimeout(() => this.loops && this.playing && this.again(), WAIT);
    this.ended();
  }

  again() {
    this.playing = false;
    this.go(0);
    this.play();
  }

  // A time since the touch, as a share of the film.
  shareOf(time) {
    return this.film.when(time) / this.film.length;
  }

  // At the touch, or at the start.
  poise(isFar) {
    this.pause();
    this.go(isFar ? 0 : this.film.poise);
  }
}
