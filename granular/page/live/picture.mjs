// All that is drawn of one report: stage, reason, numbers, charts, curve and film, with the clock that moves them.
import { Chart } from "../shell/axes.mjs";
import { Clock } from "../shell/clock.mjs";
import { $, set } from "../shell/dom.mjs";
import { reasonOf, safeGap } from "../physics/reason.mjs";
import { SETUPS } from "../physics/setups.mjs";
import { samplesOf, spanOf } from "../physics/traces.mjs";
import { Because } from "./because.mjs";
import { TimeCharts } from "./charts.mjs";
import { Curve } from "./curve.mjs";
import { Distance } from "./distance.mjs";
import { Film } from "./film.mjs";
import { Later } from "./later.mjs";
import { Panels } from "./panels.mjs";
import { printsWell } from "./print.mjs";
import { Ruler } from "./ruler.mjs";
import { Spread } from "./real.mjs";
import { Stage } from "./stage.mjs";
import { watchedPair } from "./watched.mjs";
import { say } from "./words.mjs";

export class Picture {
  // `picked`: a gap; `guessed`: a height; `stopped`: at another time; `isCovered`: nothing may be given away.
  constructor({ balls, picked, guessed, stopped, isCovered }) {
    this.stopped = stopped;
    this.later = new Later();
    this.stage = new Stage($(".stage"));
    this.because = new Because();
    this.panels = new Panels();
    this.spread = new Spread(balls);
    this.charts = new TimeCharts();
    this.distance = new Distance();
    this.curve = new Curve(picked);
    this.ruler = new Ruler($(".far-view"), { guessed });
    this.clock = new Clock(document, { show: (t) => this.show(t), stops: () => this.stops(), locked: isCovered, say });
    this.film = new Film({ ruler: this.ruler, clock: this.clock });
    printsWell(this);
  }

  // At first and while a slider moves, what is judged and dragged is drawn at once, the rest a moment later; what is hidden
  // not at all.
  load(report, { name, values }, isMove = false) {
    const span = spanOf(report.soft, report.hard), samples = samplesOf(report, span), watched = watchedPair(report, span);
    this.report = report;
    this.safe = safeGap(report);
    this.stage.load(report, span, samples, watched);
    const inTime = this.inTime(report, span, samples, watched);
    this.because.load(report, reasonOf(report));
    const panels = this.panels.load(report, SETUPS[name]);
    this.film.load(report, span, document.body.classList.contains("hard-only") ? ["hard"] : ["hard", "soft"]);
    set($(".film-button"), { disabled: !this.film.isPossible });
    this.clock.setSpan(span);
    this.later.plan({ ...panels, curve: () => this.curve.load(name, values, this.safe), ...inTime });
    if (!isMove) this.later.flush();
    this.spread.load(name, values);
  }

  // What is to be drawn later of charts over time, by name, if they are on the screen.
  inTime(report, span, samples, watched) {
    const charts = this.charts.load(report, span, samples), axis = { clock: (t) => this.charts.clock(t), end: this.charts.end, unitName: this.charts.unitName };
    if ($(".charts").classList.contains("off")) return {};
    return { distance: () => this.distance.load(report, watched, axis), ...charts, heads: () => this.showHeads(this.clock.time) };
  }

  show(t) {
    this.stage.show(t);
    this.showHeads(t);
    if (!this.clock?.playing) this.stopped();
  }

  showHeads(t) {
    this.charts.show(t);
    this.distance.show(t);
  }

  stops() {
    return [...this.report.hard.contacts, ...this.report.soft.contacts].flatMap((c) => [c.begin, c.end]).filter(Number.isFinite);
  }

  reveal() {
    this.clock.restart();
    if (this.film.isPossible) this.film.play();
    else this.clock.play();
    $(".stage-box").scrollIntoView({ block: "nearest" });
  }

  measure() {
    Chart.measure([...this.charts.all, this.distance.chart, this.panels.rises, this.curve.chart]);
    this.stage.measure();
  }
}
