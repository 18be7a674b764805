// One film in three times: the fall as fast as life, a moment's stop, the contacts slowed down, the flight as fast as life.
//
// Both engines run on to the highest point of the top ball; fall and flight are shown against a ruler, the contacts on the
// stage, moved by the page's clock.
import { $ } from "../shell/dom.mjs";
import { simulateHard } from "../physics/hard.mjs";
import { isEarly } from "../physics/measures.mjs";
import { simulateSoft } from "../physics/soft.mjs";
import { hardHeights, softHeights } from "../physics/traces.mjs";

const FREEZE = 0.9, SLOW = 7, LONGEST = 6, STEPS = 6000; // s, and steps of the soft spheres

export class Film {
  constructor({ ruler, clock, ended = () => {} }) {
    Object.assign(this, { ruler, clock, ended, playing: false });
    this.theatre = $(".theatre");
    $(".transport").addEventListener("pointerdown", () => this.stop());
    $(".transport").addEventListener("input", () => this.stop());
  }

  load(report, span, lanes) {
    Object.assign(this, { report, span, lanes });
    this.stop();
  }

  get isPossible() {
    return this.report.scene.gravity > 0 && !isEarly(this.report.soft) && !isEarly(this.report.hard);
  }

  play() {
    if (!this.isPossible) return;
    this.prepare();
    this.theatre.classList.add("far");
    const { scene } = this.report, most = Math.max(1, this.ruler.guess ?? 0, ...this.lanes.map((e) => this.report.finals[e].at(-1).rise / scene.drop).filter(Number.isFinite));
    this.ruler.layout({ scene, most: 1.05 * most, lanes: this.lanes });
    this.playing = true;
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) return this.still();
    const start = performance.now(), step = (now) => this.playing && (this.frame(Math.max(0, now - start) / 1000), requestAnimationFrame(step));
    requestAnimationFrame(step);
  }

  // The runs of the page end with the contacts: these go on.
  prepare() {
    const { scene, eps, k, finals, soft, hard } = this.report, top = (engine) => finals[engine].at(-1).velocity / scene.gravity;
    const flight = Math.max(0.2, ...["hard", "soft"].map(top).filter(Number.isFinite));
    const begin = Math.min(...[...soft.contacts, ...hard.contacts].map((c) => c.begin)), end = this.span[1] + Math.min(LONGEST, 1.04 * flight);
    const whole = { ...scene, until: null, tEnd: end };
    this.runs = { soft: simulateSoft(whole, eps, k, { record: true, maxSteps: STEPS }), hard: simulateHard(whole, eps, { record: true, maxEvents: STEPS }) };
    this.end = Math.min(end, ...Object.values(this.runs).filter(isEarly).map((run) => Math.max(this.span[1], run.time)));
    this.acts = { fall: begin, freeze: begin + FREEZE, slow: begin + FREEZE + SLOW, fly: begin + FREEZE + SLOW + this.end - this.span[1] };
  }

  frame(now) {
    const { acts, span, clock } = this;
    if (now < acts.freeze) this.far(Math.min(now, acts.fall), now < acts.fall ? "film-fall" : "film-freeze");
    else if (now < acts.slow) {
      const share = (now - acts.freeze) / SLOW, slower = SLOW / (span[1] - span[0]);
      this.theatre.classList.remove("far");
      this.ruler.tell(slower > 1.5 ? "film-slow" : "film-real", { times: [slower, "", 2] });
      clock.go(share);
    } else {
      this.far(Math.min(this.end, span[1] + now - acts.slow), "film-fly");
      if (now > acts.fly) this.finish();
    }
  }

  far(t, caption) {
    this.theatre.classList.add("far");
    this.ruler.show(this.lanes.map((engine) => (engine === "hard" ? hardHeights : softHeights)(this.runs[engine], t)));
    this.ruler.tell(caption);
  }

  still() {
    this.clock.go(1);
    this.far(this.end, "film-still");
    this.finish();
  }

  // The last picture stays until something else is asked for.
  finish() {
    this.playing = false;
    this.clock.share = 1;
    this.ended();
  }

  stop() {
    this.playing = false;
    this.theatre.classList.remove("far");
    this.ruler.tell("");
  }
}
