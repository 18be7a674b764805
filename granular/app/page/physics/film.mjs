// One film in three times: the fall in real time, the contacts slowed down, the flight in real time. Between them time
// stands still while the camera comes near and goes away.
//
// Each ball flies to its own highest point and stays there, so that the last picture shows how high each rises. Both engines
// are shown from the bounce that is asked for: the one that comes to it earlier waits at the start.
import { isEarly } from "./measures.mjs";
import { hardHeights, softHeights, spanOf } from "./traces.mjs";
import { max, min } from "./numbers.mjs";

const FREEZE = 0.8, LONGEST = 6, BEYOND = 0.04; // s, s after which the flight is quicker than life, share of the contacts shown beyond their end
export const SLOW = 6; // s that the contacts take
const HEIGHTS = { hard: hardHeights, soft: softHeights };

export function filmOf({ scene, first, cut, soft, hard }, slow = SLOW) {
  if (scene.gravity === 0 || isEarly(soft) || isEarly(hard)) return new Still(scene, { hard, soft }, slow);
  return new Film(scene, { hard: laneOf(scene, first, hardHeights), soft: laneOf(scene, cut, softHeights) }, slow);
}

// A run with the time of the bounce asked for, the end of its contacts, and where and when each ball is highest.
function laneOf({ bounces }, { contacts, run }, heights) {
  const onset = contacts.filter((c) => c.pair === 0)[bounces - 1]?.begin ?? contacts[0]?.begin ?? 0;
  const tops = run.apexAt.map((t) => (t >= onset ? t : Infinity)), firstTop = min(...tops);
  const ends = contacts.filter((c) => c.begin >= onset && c.begin < firstTop).map((c) => c.end).filter(Number.isFinite);
  const held = tops.map((t, i) => (t < Infinity ? heights(run, t)[i] : NaN)), known = tops.filter(Number.isFinite);
  const last = known.length === tops.length - 1 ? 0 : min(run.t, onset + LONGEST); // the floor has none
  return { run, onset, tops, held, touches: max(...ends, onset) - onset, flies: max(...known, last) - onset };
}

class Film {
  constructor(scene, lanes, slow) {
    const both = Object.values(lanes), touches = max(...both.map((lane) => lane.touches)) || 1e-4;
    const fall = max(...both.map((lane) => lane.onset)), span = (1 + BEYOND) * touches;
    const flies = max(0, max(...both.map((lane) => lane.flies)) - span), quicker = max(1, flies / LONGEST);
    Object.assign(this, { quicker, scene, lanes, fall, span, slow, near: fall + FREEZE, far: fall + FREEZE + slow, isFilm: true });
    this.fly = this.far + FREEZE;
    this.length = this.fly + flies / quicker + 0.2;
  }

  // What is shown after `now` seconds: the time since the touch in s, how near the camera is, and how slow time goes.
  at(now) {
    const { fall, near, far, fly, span, slow, quicker } = this, through = (begin) => smooth((now - begin) / FREEZE);
    if (now < fall) return { time: now - fall, zoom: 0, slower: 1, act: "fall" };
    if (now < near) return { time: 0, zoom: through(fall), slower: Infinity, act: "freeze" };
    if (now < far) return { time: ((now - near) / slow) * span, zoom: 1, slower: slow / span, act: "slow" };
    if (now < fly) return { time: span, zoom: 1 - through(far), slower: Infinity, act: "freeze" };
    return { time: span + (now - fly) * quicker, zoom: 0, slower: 1 / quicker, act: "fly" };
  }

  // The other way round: when a time since the touch is shown.
  when(time) {
    const { fall, near, fly, span, slow, quicker } = this;
    return time <= 0 ? fall + time : time < span ? near + (time / span) * slow : fly + (time - span) / quicker;
  }

  // Of the run of an engine, what is its time.
  clock(engine, time) {
    return max(0, this.lanes[engine].onset + time);
  }

  heights(engine, time) {
    const { run, tops, held } = this.lanes[engine], t = this.clock(engine, time);
    return HEIGHTS[engine](run, t).map((y, i) => (t >= tops[i] ? held[i] : y));
  }

  // Which balls are at their highest point.
  isUp(engine, i, time) {
    return this.clock(engine, time) >= this.lanes[engine].tops[i];
  }

  // The picture in which a gap is set: the lower ball touches the floor, seen from near.
  get poise() {
    return this.near / this.length;
  }
}

const smooth = (x) => x * x * (3 - 2 * x);

// Where nothing falls, or a run came to no end: the contacts alone, all in one time.
class Still {
  constructor(scene, runs, slow) {
    const [begin, end] = spanOf(runs.soft, runs.hard);
    Object.assign(this, { scene, runs, begin, slow, length: slow, span: end - begin, fall: 0, far: slow, poise: 0, isFilm: false });
  }

  at(now) {
    return { time: (now / this.slow) * this.span, zoom: 1, slower: this.slow / this.span, act: "slow" };
  }

  when(time) {
    return (time / this.span) * this.slow;
  }

  clock(engine, time) {
    return this.begin + time;
  }

  heights(engine, time) {
    return HEIGHTS[engine](this.runs[engine], this.begin + time);
  }

  isUp() {
    return false;
  }
}
