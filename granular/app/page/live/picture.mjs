// All that is drawn of one report: stage and film, reason, numbers, charts and curve, with the clock that moves them.
import { Chart } from "../shell/axes.mjs";
import { $ } from "../shell/dom.mjs";
import { filmOf, SLOW } from "../physics/film.mjs";
import { reachOf, reasonOf, safeGap } from "../physics/reason.mjs";
import { SETUPS } from "../physics/setups.mjs";
import { samplesOf, spanOf } from "../physics/traces.mjs";
import { Because } from "./because.mjs";
import { TimeCharts } from "./charts.mjs";
import { Curve } from "./curve.mjs";
import { Distance } from "./distance.mjs";
import { FilmClock } from "./filmclock.mjs";
import { Later } from "./later.mjs";
import { Measured } from "./measured.mjs";
import { Panels } from "./panels.mjs";
import { printsWell } from "./print.mjs";
import { Spread } from "./real.mjs";
import { whenResized } from "./resize.mjs";
import { Sound } from "./sound.mjs";
import { Stage } from "./stage.mjs";
import { titleOf } from "./sliders.mjs";
import { alone, GUESS, LAB, OPENING, screenOf } from "./story.mjs";
import { watchedPair } from "./watched.mjs";
import { plain, say } from "./words.mjs";
import { max } from "../physics/numbers.mjs";

const LEISURE = 9, NINE = 9.4, FIRST_TIME = 0.012; // s for the contacts in the laboratory; drop heights that the textbook needs; s: a stiffer ball is drawn as large

export class Picture {
  // `picked`: other values; `guessed`: a height; `stopped`: at another time; `ended`: the film; `predict`: what is covered and guessed;
  // `resized`: the stage or a chart.
  constructor({ balls, picked, guessed, stopped, ended, predict, resized }) {
    Object.assign(this, { stopped, predict, slow: null });
    this.later = new Later();
    this.stage = new Stage($(".stage"), { taken: (kind, value) => (kind === "guess" ? guessed(value) : picked({ [kind]: value })), poised: (isFar) => this.clock.poise(isFar) });
    this.because = new Because();
    this.panels = new Panels();
    this.spread = new Spread(balls);
    this.sound = new Sound();
    this.charts = new TimeCharts();
    this.distance = new Distance();
    this.curve = new Curve((gap) => picked({ gap: Number(gap.toPrecision(3)) }));
    this.measured = new Measured();
    this.clock = new FilmClock(document, { show: (now) => this.show(now), stops: () => this.stops(), locked: () => predict.covered, paced: (seconds) => this.pace(seconds), ended, say });
    whenResized([...this.stage.hosts, ...this.drawn.map((chart) => chart.host)], () => this.stage.isOff || this.drawn.some((chart) => chart.isOff), resized);
    printsWell(this);
  }

  // At first and while a slider moves, what is judged and dragged is drawn at once, the rest a moment later; what is hidden
  // not at all.
  load(report, state, isMove = false) {
    const { name, values, screen } = state, span = spanOf(report.soft, report.hard), samples = samplesOf(report, span), watched = watchedPair(report, span);
    Object.assign(this, { report, state, samples, watched, safe: safeGap(report) });
    this.film = filmOf(report, this.slow ?? (screen === LAB ? LEISURE : SLOW));
    this.loadStage();
    this.because.load(report, reasonOf(report));
    const inTime = this.inTime(report, span, samples, watched), panels = this.panels.load(report, SETUPS[name]);
    this.clock.load(this.film);
    this.clock.loops = screen === OPENING;
    this.later.plan({ ...panels, curve: () => this.curve.load(name, values, this.safe), measured: () => this.measured.load(screen === LAB ? name : "", values), ...inTime });
    if (!isMove) this.later.flush();
    this.spread.load(name, values, screen < LAB);
  }

  loadStage() {
    this.stage.load(this.report, this.film, this.look());
    this.sound.load(this.report, this.film, screenOf(this.state.screen).engine);
  }

  // What the screen wants to be seen on the stage.
  look() {
    const { report, predict, state, safe } = this, { scene, finals } = report, { screen, name } = state, inLab = screen === LAB, opens = screen === OPENING, { engine: only } = screenOf(screen);
    const { kinds } = scene, names = kinds.map((kind, i) => (kind ? plain(`ball-${kind}`) : String(i))), asks = predict.covered;
    const grips = asks ? [] : this.grips(), grip = grips[0]?.name, isHard = only === "hard";
    const rises = ["hard", "soft"].filter((engine) => (only ?? engine) === engine).flatMap((engine) => finals[engine].map((f) => f.rise)).filter(Number.isFinite);
    const most = max(scene.drop, 1.05 * max(predict.guess ?? 0, ...(screen === GUESS ? state.guesses : [])) * scene.drop, 1.08 * max(0, ...rises), grip === "height" ? 1.05 * grips[0].max : 0, isHard ? NINE * scene.drop : 0);
    const handles = asks ? [{ kind: "guess", label: plain("guess-label"), value: predict.guess, most: SETUPS[name].most }] : grips.map((spec) => ({ kind: spec.name, label: titleOf(spec), value: state.values[spec.name], least: spec.zero ? 0 : spec.min, most: spec.max, unit: spec.unit, safe }));
    return {
      asks, opens, inLab, kinds, names, called: (i) => (kinds[i] ? names[i] : plain("ball", { n: i })), handles, fullest: isHard ? scene.radius[1] : 0, samples: this.samples, watched: inLab && !asks ? this.watched : null, guess: predict.guess, guesses: screen === GUESS ? state.guesses : [], gauge: !predict.on && screen > 2 && !inLab,
      most: asks ? SETUPS[name].most * scene.drop : opens ? 1.5 * scene.drop : most, reach: max(reachOf(report), grips[1]?.name === "t1" ? FIRST_TIME * scene.impact : 0), ghost: grip === "gap" && screen > 4 ? safe : 0,
    };
  }

  // What can be dragged: the mass of the upper ball, if it is none that there is.
  grips() {
    const { name, screen } = this.state, { scene } = this.report, asked = screen === LAB ? ["gap"].slice(0, scene.gap.length - 1) : screenOf(screen).grips;
    return asked.flatMap((one) => SETUPS[name].sliders.filter((spec) => spec.name === one && !(one === "m2" && scene.kinds[2]))).map(alone);
  }

  // What is to be drawn later of charts over time, by name, if they are on the screen.
  inTime(report, span, samples, watched) {
    const charts = this.charts.load(report, span, samples), axis = { clock: (t) => this.charts.clock(t), end: this.charts.end, unitName: this.charts.unitName };
    if ($(".charts").classList.contains("off")) return {};
    return { distance: () => this.distance.load(report, watched, axis), ...charts, heads: () => this.showHeads(this.clock.time) };
  }

  show(now) {
    if (!this.film) return;
    this.stage.show(this.film.at(now));
    this.sound.hear(now, this.clock?.playing);
    this.showHeads(now);
    if (!this.clock?.playing) this.stopped();
  }

  showHeads(now) {
    const t = this.film.clock("soft", this.film.at(now).time);
    this.charts.show(t);
    this.distance.show(t);
  }

  // When contacts begin and end, since the touch.
  stops() {
    return ["hard", "soft"].flatMap((engine) => this.report[engine].contacts.flatMap((c) => [c.begin, c.end]).filter(Number.isFinite).map((t) => t - this.film.clock(engine, 0)));
  }

  // Other seconds for the contacts: the film is another, the time shown the same.
  pace(seconds) {
    const { time } = this.film.at(this.clock.time);
    this.slow = seconds;
    this.film = filmOf(this.report, seconds);
    this.loadStage();
    this.clock.share = this.film.when(time) / this.film.length;
    this.clock.load(this.film);
  }

  reveal() {
    this.clock.restart();
    this.clock.play();
    $(".stage-box").scrollIntoView({ block: "nearest" });
  }

  get drawn() {
    return [...this.charts.all, this.distance.chart, this.panels.rises, this.curve.chart, this.measured.chart];
  }

  measure() {
    Chart.measure(this.drawn);
    this.stage.measure();
  }
}
