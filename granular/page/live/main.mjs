// The teaching page: one state (scene and values), one report, everything else drawn from it.
import { $, save, text } from "../shell/dom.mjs";
import { Clock } from "../shell/clock.mjs";
import { AT_LEISURE, AT_ONCE, compareEngines } from "../physics/outcome.mjs";
import { cleaned, sceneOf, SETUPS } from "../physics/setups.mjs";
import { samplesOf, spanOf } from "../physics/traces.mjs";
import { TimeCharts } from "./charts.mjs";
import { Controls } from "./controls.mjs";
import { Curve } from "./curve.mjs";
import { follow, hasLink, read, write, written } from "./link.mjs";
import { contactsCsv, Panels } from "./panels.mjs";
import { Predict } from "./predict.mjs";
import { Stage } from "./stage.mjs";

const REST = 350; // ms without a change before the verdict is spoken

class Page {
  constructor() {
    this.state = read(location.hash || document.body.dataset.start || "");
    this.controls = new Controls({ changed: (values) => this.change(values), chosen: (name) => this.choose(name) });
    this.stage = new Stage($(".stage"));
    this.charts = new TimeCharts();
    this.curve = new Curve((gap) => this.change({ gap: Number(gap.toPrecision(3)) }));
    this.panels = new Panels();
    this.predict = new Predict({ reveal: () => this.reveal(), switched: () => this.clock.restart() });
    this.clock = new Clock(document, { show: (t) => this.show(t), stops: () => this.stops(), locked: () => this.predict.covered });
    this.clock.share = this.state.at;
    this.predict.set(this.state.predict);
    this.width = innerWidth;
    this.listen();
    this.run();
  }

  listen() {
    $(".csv").addEventListener("click", () => save("contacts.csv", "text/csv", contactsCsv(this.report)));
    $(".link-button").addEventListener("click", () => this.copyLink());
    window.addEventListener("hashchange", () => this.arrive());
    window.addEventListener("resize", () => this.redrawSoon());
  }

  change(values) {
    this.state.values = cleaned(this.state.name, { ...this.state.values, ...values });
    this.state.told = "";
    this.runSoon();
  }

  choose(name) {
    const { eps, gap, k } = this.state.values;
    this.state.values = name === this.state.name ? this.state.values : cleaned(name, { eps, gap, k });
    Object.assign(this.state, { name, told: "" });
    this.clock.restart();
    this.runSoon();
  }

  arrive() {
    if (location.hash === written(this.current())) return;
    this.state = read(location.hash);
    this.predict.set(this.state.predict);
    this.clock.share = this.state.at;
    this.run();
  }

  runSoon() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => this.run());
  }

  run() {
    this.pending = false;
    const { name, values } = this.state;
    this.controls.load(name, values);
    text($(".notice"), this.state.told);
    this.compare(AT_ONCE);
    clearTimeout(this.seeking);
    if (this.report.isHasty) this.seeking = setTimeout(() => this.compare(AT_LEISURE), REST);
    follow(() => this.current());
    performance.mark("drawn");
  }

  compare(patience) {
    const { name, values } = this.state, setup = SETUPS[name];
    this.report = compareEngines(sceneOf(name, values), values.eps, values.k, { patience });
    this.draw(setup);
    if (patience === AT_ONCE) this.predict.load(this.report, setup);
    else this.predict.report = this.report;
    this.speak();
  }

  draw(setup) {
    const span = spanOf(this.report.soft, this.report.hard);
    const samples = samplesOf(this.report, span);
    this.stage.load(this.report, span, samples);
    this.charts.load(this.report, span, samples);
    this.panels.load(this.report, setup);
    this.clock.setSpan(span);
    this.curve.load(this.state.name, this.state.values);
  }

  // While a slider moves the verdict changes at once for the eye, but is announced only when it rests.
  speak() {
    const element = $(".verdict");
    element.setAttribute("aria-live", "off");
    text(element, this.report.verdict);
    element.classList.toggle("yes", this.report.verdict.startsWith("Yes"));
    clearTimeout(this.speaking);
    this.speaking = setTimeout(() => {
      element.setAttribute("aria-live", "polite");
      element.textContent = "";
      element.textContent = this.report.verdict;
    }, REST);
  }

  show(t) {
    this.stage.show(t);
    this.charts.show(t);
    if (!this.clock?.playing) follow(() => this.current());
  }

  stops() {
    return [...this.report.hard.contacts, ...this.report.soft.contacts].flatMap((c) => [c.begin, c.end]).filter(Number.isFinite);
  }

  reveal() {
    this.clock.restart();
    this.clock.play();
  }

  redrawSoon() {
    clearTimeout(this.redrawing);
    this.redrawing = setTimeout(() => {
      if (innerWidth === this.width) return;
      this.width = innerWidth;
      for (const chart of [...this.charts.all, this.panels.rises, this.curve.chart]) chart.measure();
      this.draw(SETUPS[this.state.name]);
    }, 80);
  }

  current() {
    return { ...this.state, at: this.clock?.share ?? 0, predict: this.predict.on };
  }

  async copyLink() {
    write(this.current());
    if (!hasLink()) return text($(".link-button"), "No link: open the page itself");
    const done = await navigator.clipboard?.writeText(location.href).then(() => true, () => false);
    text($(".link-button"), done ? "Copied" : "It is in the address bar");
    setTimeout(() => text($(".link-button"), "Copy link"), 1600);
  }
}

new Page();
