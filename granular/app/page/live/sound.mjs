// A click at every touch while the film runs, off until it is asked for: hard on the left, soft on the right.
//
// Collisions of one instant are heard one after another, as a hard engine treats them; soft contacts that overlap are one
// push and one click. So a cradle rattles on the left and clicks once on the right.
import { $, set, text } from "../shell/dom.mjs";
import { largest } from "../physics/measures.mjs";
import { pushesOf } from "../physics/pushes.mjs";
import { say } from "./words.mjs";
import { max } from "../physics/numbers.mjs";

const APART = 0.07, FAINTEST = 0.1, LEAP = 0.5; // s between clicks of one instant, of the loudest, s of a film that is no step of its clock
const CLICKS = { hard: [1900, 0.03, -0.8], soft: [620, 0.09, 0.8] }; // Hz, s until a click has died away, ear

export class Sound {
  constructor() {
    Object.assign(this, { button: $(".sound-button"), clicks: [], last: 0 });
    set(this.button, { onclick: () => this.turn() });
  }

  // A browser lets a page make sounds when it has been asked to by hand.
  turn() {
    this.context = this.context ? void this.context.close() : new AudioContext();
    set(this.button, { "aria-pressed": String(Boolean(this.context)) });
    text($(".notice"), this.context ? say("sound-key") : "");
  }

  // `only`: the one engine that is shown, if it is one.
  load(report, film, only) {
    this.clicks = Object.keys(CLICKS).filter((engine) => !only || engine === only).flatMap((engine) => {
      const pushes = pushesOf(engine, report[engine].contacts), most = largest(pushes.map(({ speed }) => speed));
      return pushes.map(({ begin, speed }) => ({ engine, now: film.when(begin - film.clock(engine, 0)), loud: max(FAINTEST, speed / most || 0) }));
    });
  }

  // The film has come to `now`.
  hear(now, isPlaying) {
    const { last, context } = this;
    this.last = now;
    if (!context || !isPlaying || now <= last || now - last > LEAP) return;
    for (const engine of Object.keys(CLICKS)) {
      let after = 0;
      for (const click of this.clicks) if (click.engine === engine && click.now >= last && click.now < now) this.click(click, APART * after++);
    }
  }

  click({ engine, loud }, wait) {
    const { context } = this, [pitch, lasts, ear] = CLICKS[engine], begin = context.currentTime + wait;
    const tone = new OscillatorNode(context, { frequency: pitch }), gain = new GainNode(context, { gain: 0 });
    gain.gain.setValueAtTime(0.4 * loud, begin);
    gain.gain.exponentialRampToValueAtTime(1e-4, begin + lasts);
    tone.connect(gain).connect(new StereoPannerNode(context, { pan: ear })).connect(context.destination);
    tone.start(begin);
    tone.stop(begin + lasts);
  }
}
