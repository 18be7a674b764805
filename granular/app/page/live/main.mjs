// The teaching page: one state (screen, scene and values), one report, everything else drawn from it.
import { $, save, set, text } from "../shell/dom.mjs";
import { AT_LEISURE, AT_ONCE, compareEngines } from "../physics/outcome.mjs";
import { cleaned, contactsIn, offer, sceneOf, SETUPS } from "../physics/setups.mjs";
import { Classroom } from "./classroom.mjs";
import { Controls } from "./controls.mjs";
import { explainTerms } from "./glossary.mjs";
import { copyLink, follow, languageIn, read, write, written } from "./link.mjs";
import { printPack } from "./pack.mjs";
import { contactsCsv } from "./panels.mjs";
import { Picture } from "./picture.mjs";
import { Predict } from "./predict.mjs";
import { Spoken } from "./spoken.mjs";
import { another, GUESS, LAB, OPENING, screenOf, startOf, Story } from "./story.mjs";
import { Tongue } from "./tongue.mjs";
import { data, languageNow, say, speak } from "./words.mjs";
import { abs } from "../physics/numbers.mjs";

const REST = 350; // ms without a change before what takes long is computed

class Page {
  constructor() {
    offer(data);
    speak(languageIn(location.hash, document.body.dataset.start));
    this.state = read(location.hash, document.body.dataset.start);
    this.makeParts();
    this.ask();
    this.listen();
    this.run(true);
    this.rest();
  }

  makeParts() {
    this.tongue = new Tongue((language) => this.translate(language));
    this.story = new Story((screen) => this.turnTo(screen));
    this.controls = new Controls({ changed: (values) => this.change(values), chosen: (name) => this.choose(name) });
    this.spoken = new Spoken();
    this.classroom = new Classroom((guesses) => this.collect(guesses));
    this.predict = new Predict({ guessed: () => this.guess(), reveal: () => this.reveal(), switched: () => this.clock.pause() || this.run(), uncovered: () => this.redraw() });
    this.picture = new Picture({
      balls: data.balls, picked: (values) => this.change(values), guessed: (guess) => this.predict.take(guess),
      stopped: () => follow(() => this.current()), ended: () => this.predict.ended(), predict: this.predict,
      resized: () => this.redraw(),
    });
    this.clock = this.picture.clock;
  }

  get isAsking() {
    return this.state.predict || Boolean(screenOf(this.state.screen).predict);
  }

  get isStory() {
    return this.state.screen < LAB;
  }

  get isFar() {
    return screenOf(this.state.screen).grips?.[0] === "height";
  }

  listen() {
    set($(".csv"), { onclick: () => save("contacts.csv", "text/csv", contactsCsv(this.report)) });
    set($(".link-button"), { onclick: () => copyLink($(".link-button"), this.current()) });
    set($(".print-button"), { onclick: () => print() });
    set($(".pack-button"), { onclick: () => printPack(location.href.split("#")[0] + written({ ...startOf(OPENING), screen: OPENING, at: null, lang: languageNow() }), this.state.guesses) });
    set(window, { onhashchange: () => this.arrive(), onpopstate: () => this.arrive() });
    explainTerms();
  }

  // A guess of the story is kept, and in every link.
  ask() {
    this.predict.set(this.isAsking, this.state.screen === GUESS ? this.state.guess : undefined);
  }

  // The stage alone is another while a guess is dragged.
  guess() {
    if (!this.report) return;
    if (this.state.screen === GUESS) this.state.guess = this.predict.guess ?? undefined;
    this.picture.loadStage();
    this.clock.go(this.clock.share);
  }

  // On the teacher's screen.
  collect(guesses) {
    this.state.guesses = guesses;
    this.guess();
    follow(() => this.current());
  }

  reveal() {
    this.run();
    this.picture.reveal();
  }

  translate(lang) {
    this.state.lang = lang;
    speak(lang);
    this.run();
  }

  change(values) {
    this.state.values = cleaned(this.state.name, { ...this.state.values, ...values, ...another(this.state.screen, this.state.values, values) });
    this.state.told = [];
    this.runSoon();
  }

  choose(name) {
    const { eps, gap, k } = this.state.values;
    this.state.values = name === this.state.name ? this.state.values : cleaned(name, { eps, gap, k });
    Object.assign(this.state, { name, told: [] });
    this.run();
    this.rest();
  }

  turnTo(screen) {
    const { name, values } = screen < LAB ? startOf(screen) : this.state;
    Object.assign(this.state, { screen, name, values: cleaned(name, values), told: [], at: null, predict: false });
    this.ask();
    this.run();
    this.rest();
    write(this.current(), true);
  }

  arrive() {
    if (location.hash === written(this.current())) return;
    const lang = languageIn(location.hash, document.body.dataset.start);
    if (lang) speak(lang);
    this.told = ""; // what has a name of its own on a screen, too
    this.state = read(location.hash, document.body.dataset.start);
    this.ask();
    this.run();
    this.rest();
  }

  // Where the film waits: at the moment of a link; at the touch, seen from near; from far where a guess or a drop height is set.
  // The opening plays by itself, and so does a scene with which the file opens, once.
  rest() {
    this.clock.pause();
    this.clock.go(this.state.at ?? (this.isAsking || this.isFar ? 0 : this.picture.film.poise));
    if (this.state.screen === OPENING || (this.state.plays && !this.isAsking)) this.clock.play();
    this.state.plays = false;
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
    this.story.suggest(name);
    this.classroom.load(this.state.guesses);
    this.controls.load(name, values, { only, presets: presets?.() });
    if (isOther) this.picture.measure();
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
    const { name, values } = this.state, { eps, k } = contactsIn(name, values);
    this.report = compareEngines(sceneOf(name, values), eps, k, { patience });
    this.draw(isMove);
    this.spoken.load(this.report, this.predict.covered, this.isStory);
  }

  draw(isMove) {
    this.predict.load(this.report, SETUPS[this.state.name], this.isStory);
    this.picture.load(this.report, this.state, isMove);
    this.controls.markGap(this.state.screen > 4 ? this.picture.safe : NaN);
  }

  redraw() {
    this.picture.measure();
    this.draw();
  }

  current() {
    const { share, film } = this.clock, isResting = abs(share - (this.isFar ? 0 : film.poise)) < 1e-6 || this.state.screen <= GUESS;
    return { ...this.state, at: isResting ? null : share, predict: this.state.screen === LAB && this.predict.on };
  }
}

new Page();
$(".blocked").remove();
