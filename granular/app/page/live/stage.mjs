// The two engines side by side: upright where balls fall, in a row where they do not.
import { $, classes, svg } from "../shell/dom.mjs";
import { largestForce, softForces } from "../physics/traces.mjs";
import { Handle } from "./handle.mjs";
import { Lying } from "./lying.mjs";
import { Upright } from "./upright.mjs";
import { shareColours } from "./drawn.mjs";
import { told } from "./words.mjs";
import { max, sqrt } from "../physics/numbers.mjs";

const FLASH = 0.02; // share of the contacts' time for which a hard collision stays visible

export class Stage {
  constructor(host, { taken, poised }) {
    this.host = host;
    shareColours();
    this.hosts = ["hard", "soft"].map((engine) => svg("svg", { role: "group", class: engine }));
    host.append(...this.hosts);
    this.upright = this.hosts.map((one) => new Upright(one.getAttribute("class"), one));
    this.lying = this.hosts.map((one) => new Lying(one.getAttribute("class"), one));
    this.handles = [0, 1].map(() => this.upright.map((view) => new Handle(view, { taken, poised })));
  }

  load(report, film, look) {
    const falls = report.scene.gravity > 0, depth = depthIn(look.samples.soft, report.scene);
    Object.assign(this, { report, film, views: falls ? this.upright : this.lying, falls });
    classes(this.host, { upright: falls, lying: !falls, asks: look.asks, opens: look.opens });
    const kind = `${falls} ${look.asks} ${look.opens}`;
    if (kind !== this.kind || !this.sizes) this.measure();
    this.kind = kind;
    const [times] = this.views.map((view, i) => view.layout(report, film, { ...look, samples: { ...look.samples, depth } }, this.sizes[i]));
    told($(".scale-note"), falls ? "" : "scale-note", { times: [times, "", 2] });
    this.forceMax = largestForce(report.soft);
    this.hosts.forEach((one) => classes(one, { grabs: look.asks && falls }));
    this.handles.forEach((both, n) => both.forEach((handle, i) => handle.load({ ...((falls && look.handles[n]) || { kind: "" }), isFirst: i === this.visible() })));
  }

  // Of the two, the first that is to be seen.
  visible() {
    return this.sizes[0][2] ? 0 : 1;
  }

  // Asking for sizes makes the browser lay out the page: both at once, only at the start and when what is shown changes.
  measure() {
    this.sizes = this.seen();
  }

  seen() {
    return this.hosts.map((one) => [one.clientWidth || 280, one.clientHeight || 320, one.clientWidth > 0]);
  }

  get isOff() {
    return `${this.seen()}` !== `${this.sizes}`;
  }

  show(frame) {
    const { report, film } = this, fade = FLASH * film.span, hardly = film.clock("hard", frame.time);
    const press = softForces(film.isFilm ? report.cut : report.soft, film.clock("soft", frame.time)).map((f) => sqrt(f / this.forceMax));
    const flash = press.map((_, c) => {
      const last = report.hard.contacts.reduce((s, one) => (one.pair === c && one.begin <= hardly ? max(s, one.begin) : s), -Infinity);
      return max(0, 1 - (hardly - last) / fade);
    });
    this.views[0].show(frame, flash);
    this.views[1].show(frame, press);
    if (this.falls) for (const handle of this.handles.flat()) handle.show(frame);
  }
}

// How deep each pair sinks in.
const depthIn = (rows, scene) => scene.gap.map((_, c) => rows.reduce((most, y) => max(most, y[c] - y[c + 1]), 0));
