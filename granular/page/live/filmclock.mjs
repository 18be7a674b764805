// The clock of a film: its time bar has three coloured parts, life, slow, life; beside it, how slow time goes.
import { $, set, text } from "../shell/dom.mjs";
import { Clock } from "../shell/clock.mjs";
import { digits, quantity } from "../shell/format.mjs";

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
    if (this.film && Math.abs(this.share - this.film.poise) < 1e-6) this.share = film.poise;
    this.film = film;
    this.setSpan([0, film.length]);
    const [from, to] = [film.fall, film.isFilm ? film.fly : film.length].map((t) => `${((100 * t) / film.length).toFixed(1)}%`);
    this.bar.style.setProperty("--from", from);
    this.bar.style.setProperty("--to", to);
  }

  // Asked for by hand: how long the contacts take.
  setDuration(seconds) {
    this.paced(seconds);
  }

  setSpan(span) {
    this.span = span;
    this.duration = span[1];
    this.go(this.share);
  }

  tell() {
    if (!this.film) return;
    const { slower, time, act } = this.film.at(this.time), now = quantity(time, "s", act === "slow" ? 4 : 2);
    text(this.readout, now);
    const n = (x) => String(Math.round(x)).replace(/\B(?=(\d{3})+$)/g, "\u00a0");
    const pace = slower === Infinity ? this.say("film-freeze") : slower > 1.5 ? this.say("slowed", { n: n(slower) }) : slower < 0.67 ? this.say("faster", { n: digits(1 / slower, 2) }) : this.say("film-life");
    text($(".slowdown", this.root), pace);
    set(this.bar, { "aria-valuetext": `${now}, ${pace}` });
  }

  // From the picture in which it waits the film begins with the fall.
  play() {
    if (this.locked() || this.playing) return;
    if (isStill() && this.film.isFilm) return this.go(1) || this.ended();
    if (this.share >= 1 || Math.abs(this.share - this.film.poise) < 1e-6) this.go(0);
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

  poise() {
    this.pause();
    this.go(this.film.poise);
  }

  leap(way) {
    this.pause();
    const shares = this.stops().map((time) => this.shareOf(time)).filter((s) => (way > 0 ? s > this.share + 1e-9 : s < this.share - 1e-9));
    if (shares.length) this.go(way > 0 ? Math.min(...shares) : Math.max(...shares));
  }
}
