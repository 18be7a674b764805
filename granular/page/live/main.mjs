// The teaching page: one state (screen, scene and values), one report, everything else drawn from it.
import { Chart } from "../shell/axes.mjs";
import { $, save, set, text } from "../shell/dom.mjs";
import { Clock } from "../shell/clock.mjs";
import { AT_LEISURE, AT_ONCE, compareEngines } from "../physics/outcome.mjs";
import { reasonOf, safeGap } from "../physics/reason.mjs";
import { cleaned, contactsIn, offer, sceneOf, SETUPS } from "../physics/setups.mjs";
import { samplesOf, spanOf } from "../physics/traces.mjs";
import { Because } from "./because.mjs";
import { TimeCharts } from "./charts.mjs";
import { Controls } from "./controls.mjs";
import { Curve } from "./curve.mjs";
import { Distance } from "./distance.mjs";
import { Film } from "./film.mjs";
import { explainTerms } from "./glossary.mjs";
import { copyLink, follow, read, write, written } from "./link.mjs";
import { contactsCsv, Panels } from "./panels.mjs";
import { Later } from "./later.mjs";
import { Predict } from "./predict.mjs";
import { printsWell } from "./print.mjs";
import { Spread } from "./real.mjs";
import { whenResized } from "./resize.mjs";
import { Ruler } from "./ruler.mjs";
import { Spoken } from "./spoken.mjs";
import { Stage } from "./stage.mjs";
import { LAB, screenOf, startOf, Story } from "./story.mjs";
import { Tongue } from "./tongue.mjs";
import { watchedPair } from "./watched.mjs";
import { languageNow, say, speak } from "./words.mjs";

const REST = 350; // ms without a change before what takes long is computed
const data = JSON.parse($("#data").textContent);

class Page {
  constructor() {
    offer(data);
    this.state = read(location.hash || document.body.dataset.start || "");
    speak(this.state.lang);
    this.makeParts();
    this.predict.set(this.isAsking);
    this.listen();
    this.run(true);
  }

  makeParts() {
    this.tongue = new Tongue((language) => this.translate(language));
    this.story = new Story((screen) => this.turnTo(screen));
    this.controls = new Controls({ changed: (values) => this.change(values), chosen: (name) => this.choose(name) });
    this.stage = new Stage($(".stage"));
    this.later = new Later();
    this.charts = new TimeCharts();
    this.distance = new Distance();
    this.because = new Because();
    this.spoken = new Spoken();
    this.curve = new Curve((gap) => this.change({ gap: Number(gap.toPrecision(3)) }));
    this.panels = new Panels();
    this.spread = new Spread(data.balls);
    this.ruler = new Ruler($(".far-view"), { guessed: (guess) => this.predict.take(guess) });
    this.clock = new Clock(document, { show: (t) => this.show(t), stops: () => this.stops(), locked: () => this.predict.covered, say });
    this.film = new Film({ ruler: this.ruler, clock: this.clock });
    this.predict = new Predict({ ruler: this.ruler, reveal: () => this.reveal(), switched: () => this.clock.restart() });
    this.clock.share = this.state.at;
  }

  get isAsking() {
    return this.state.predict || Boolean(screenOf(this.state.screen).predict);
  }

  listen() {
    $(".csv").addEventListener("click", () => save("contacts.csv", "text/csv", contactsCsv(this.report)));
    $(".link-button").addEventListener("click", () => copyLink($(".link-button"), this.current()));
    $(".film-button").addEventListener("click", () => this.reveal());
    $(".print-button").addEventListener("click", () => print());
    whenResized(() => this.redraw());
    window.addEventListener("hashchange", () => this.arrive());
    window.addEventListener("popstate", () => this.arrive());
    printsWell(this);
    explainTerms();
  }

  translate(lang) {
    this.state.lang = lang;
    speak(lang);
    this.run();
  }

  change(values) {
    this.state.values = cleaned(this.state.name, { ...this.state.values, ...values });
    this.state.told = [];
    this.runSoon();
  }

  choose(name) {
    const { eps, gap, k } = this.state.values;
    this.state.values = name === this.state.name ? this.state.values : cleaned(name, { eps, gap, k });
    Object.assign(this.state, { name, told: [] });
    this.clock.restart();
    this.runSoon();
  }

  turnTo(screen) {
    const { name, values } = screen < LAB ? startOf(screen) : this.state;
    Object.assign(this.state, { screen, name, values: cleaned(name, values), told: [], at: 0, predict: false });
    this.predict.set(this.isAsking);
    this.clock.share = 0;
    this.run();
    write(this.current(), true);
  }

  arrive() {
    if (location.hash === written(this.current())) return;
    this.state = read(location.hash);
    if (this.state.lang) speak(this.state.lang);
    this.predict.set(this.isAsking);
    this.clock.share = this.state.at;
    this.run();
  }

  runSoon() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => this.run(true));
  }

  run(isMove = false) {
    this.pending = false;
    const { screen, name, values } = this.state, { only, presets } = screenOf(screen);
    const isOther = this.told !== `${screen} ${languageNow()}`;
    if (isOther) this.arrange(screen);
    this.controls.load(name, values, { only, presets: presets?.() });
    if (isOther) this.measure();
    text($(".notice"), this.state.told.map((one) => say(one.say, one)).join(" "));
    this.compare(AT_ONCE, isMove);
    clearTimeout(this.seeking);
    if (this.report.isHasty) this.seeking = setTimeout(() => this.compare(AT_LEISURE, true), REST);
    follow(() => this.current());
    performance.mark("drawn");
  }

  // Another screen, or another language: what is shown, and where it stands.
  arrange(screen) {
    this.told = `${screen} ${languageNow()}`;
    this.story.load(screen);
    this.tongue.load();
  }

  compare(patience, isMove) {
    const { name, values } = this.state, setup = SETUPS[name], { eps, k } = contactsIn(name, values);
    this.report = compareEngines(sceneOf(name, values), eps, k, { patience });
    this.draw(setup, isMove);
    this.predict.load(this.report, setup);
    this.spoken.load(this.report, this.state.screen < LAB, this.predict.covered);
  }

  // At first and while a slider moves, what is judged and dragged is drawn at once, the rest a moment later; what is hidden
  // not at all.
  draw(setup, isMove = false) {
    const { report, state } = this, span = spanOf(report.soft, report.hard), samples = samplesOf(report, span), watched = watchedPair(report, span);
    const engines = document.body.classList.contains("hard-only") ? ["hard"] : ["hard", "soft"];
    this.stage.load(report, span, samples, watched);
    const charts = this.charts.load(report, span, samples), axis = { clock: (t) => this.charts.clock(t), end: this.charts.end, unitName: this.charts.unitName };
    this.because.load(report, reasonOf(report));
    const panels = this.panels.load(report, setup), safe = safeGap(report);
    this.film.load(report, span, engines);
    set($(".film-button"), { disabled: !this.film.isPossible });
    this.clock.setSpan(span);
    this.controls.markGap(safe);
    const distance = () => this.distance.load(report, watched, axis), curve = () => this.curve.load(state.name, state.values, safe);
    const inTime = this.story.shows(".charts") ? { distance, ...charts, heads: () => this.showHeads(this.clock.time) } : {};
    this.later.plan({ ...panels, curve, ...inTime });
    if (!isMove) this.later.flush();
    this.spread.load(state.name, state.values);
  }

  show(t) {
    this.stage.show(t);
    this.showHeads(t);
    if (!this.clock?.playing) follow(() => this.current());
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

  redraw() {
    this.measure();
    this.draw(SETUPS[this.state.name]);
    this.predict.load(this.report, SETUPS[this.state.name]);
  }

  current() {
    return { ...this.state, at: this.clock?.share ?? 0, predict: this.state.screen === LAB && this.predict.on };
  }
}

new Page();
$(".blocked").remove();
