// What a move of a slider draws a moment later, one piece at a time when nothing else is to be done: what is judged and
// dragged is painted first. Pieces take turns, so none waits forever while a slider moves.
import { whenIdle } from "../shell/dom.mjs";

const LATEST = 100; // ms

export class Later {
  constructor() {
    Object.assign(this, { jobs: new Map(), isWaiting: false });
  }

  // Jobs by name; one that still waits keeps its turn.
  plan(jobs) {
    for (const [name, job] of Object.entries(jobs)) this.jobs.set(name, job);
    this.wait();
  }

  wait() {
    if (this.isWaiting || !this.jobs.size) return;
    this.isWaiting = true;
    whenIdle(() => {
      this.isWaiting = false;
      this.next();
      this.wait();
      if (!this.jobs.size) performance.mark("settled");
    }, { timeout: LATEST });
  }

  next() {
    const [first] = this.jobs;
    if (!first) return;
    this.jobs.delete(first[0]);
    first[1]();
  }

  flush() {
    while (this.jobs.size) this.next();
  }
}
