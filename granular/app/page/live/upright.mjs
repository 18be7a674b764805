// One engine's balls above their floor, as the camera sees them: a ruler from far, gaps and pressed balls from near.
import { markup, set, svg, text } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { ticks } from "../shell/axes.mjs";
import { bulge, Camera } from "./camera.mjs";
import { dots } from "./classroom.mjs";
import { face } from "./drawn.mjs";
import { Lens } from "./lens.mjs";
import { plain } from "./words.mjs";
import { abs, max, min } from "../physics/numbers.mjs";

const LEFT = 44, GAUGE = 26, NARROW = 260; // pixels: of the ruler, of the gauge, and a stage that is too small for all its words
const NAME_SIZE = 13, DIGIT = 10, NUMBER_SIZE = 18, TICK_SIZE = 12, LEAST_SIZE = 0.54, LENS_WORDS = 104; // pixels, of a digit too; share of a name's size below which it is hidden; pixels
const widthOf = (words) => [...words].reduce((wide, sign) => wide + (sign > "\u2e80" ? 1 : 0.6), 0); // in sizes of a font
const smaller = (size, share) => (share < 1 ? `font-size: ${(size * share).toFixed(1)}px` : "");

export class Upright {
  constructor(engine, host) {
    Object.assign(this, { engine, svg: host, lens: new Lens(engine) });
    const part = (name, tag = "g") => (this[name] = svg(tag, { class: name }));
    this.layers = ["ruler", "ghosts", "shadow", "balls", "base", "tops", "marks", "gauge", "grips", "title", "note"].map((name) => part(name, { shadow: "ellipse", base: "line", title: "text", note: "text" }[name]));
    set(this.title, { x: 10, y: 22, class: "stage-name" });
  }

  // `look`: what the screen wants to be seen: kinds and names of the balls, greatest height, ghosts, gauge. Heights are in drop
  // heights in the laboratory, and in metres in the story.
  layout(report, film, look, [w, tall]) {
    const { scene } = report;
    Object.assign(this, { scene, film, look, w, tall, per: look.inLab ? scene.drop : 1, top: scene.mass.length - 1, isNarrow: w < NARROW, upNow: null, x: w * (look.asks || look.opens ? 0.5 : 0.42) });
    this.camera = new Camera({ scene, wide: w, tall, most: look.most, reach: look.reach, size: look.opens ? 1.6 : 1, fullest: look.fullest });
    const shape = JSON.stringify([look.kinds, scene.radius, w, tall]);
    if (shape !== this.shape) this.build();
    this.shape = shape;
    set(this.svg, { viewBox: `0 0 ${w} ${tall}` }); // balls that lie share it
    if (this.svg.firstChild !== this.ruler) this.svg.replaceChildren(...this.layers, this.lens.element);
    set(this.lens.element, { display: look.watched ? null : "none" });
    this.drawRuler();
    this.drawGauge(report.finals[this.engine]);
    this.name(report[this.engine].contacts.length);
    if (look.watched) this.layLens();
  }

  build() {
    const { w, tall, engine, camera } = this, floor = camera.down(0);
    set(this.base, { x1: 8, x2: w - 8, y1: floor, y2: floor, class: "floor" });
    this.each = this.look.kinds.map((kind, i) => (i === 0 ? null : ballOf(kind, `${engine}-${i}`)));
    this.balls.replaceChildren(...this.each.slice(1).map((ball) => ball.element));
    this.lines = this.each.slice(1).map(() => svg("line", { class: "mark" }));
    this.marks.replaceChildren(...this.lines);
  }

  name(count) {
    const { look, engine } = this;
    text(this.title, look.asks || look.opens ? "" : plain(`${engine}-spheres`));
    this.each.forEach((ball, i) => ball && text(ball.label, i === this.top && look.handles[1]?.kind === "m2" ? "" : look.names[i]));
    set(this.svg, { "aria-label": plain("stage-said", { engine: { say: `${engine}-spheres` }, n: count }) });
  }

  // Counted from where the top ball stands when all stand on one another.
  drawRuler() {
    const { camera, scene, w, top, per } = this, rest = camera.place(scene.radius.map(() => 0))[top].zero, [scale] = camera.scales(0);
    this.ruler.innerHTML = ticks([0, camera.most / per], 5).map((v) => {
      const y = camera.down(rest + v * per * scale);
      return markup("line", { x1: LEFT, x2: w - 8, y1: y, y2: y, class: v * per === scene.drop ? "drop-line" : "ruler-line" }) + markup("text", { x: LEFT - 6, y: min(y + 4, camera.down(5)), "text-anchor": "end", class: "ruler-tick" }, digits(v, 3));
    }).join("") + [plain(this.look.inLab ? "in-drops" : "in-metres"), plain("zero-is", { ball: this.look.called(top) })].map((words, i) => markup("text", { style: smaller(TICK_SIZE, (w - 16) / (0.9 * TICK_SIZE * widthOf(words))), x: w - 10, y: (this.isNarrow ? 38 : 20) + 15 * i, "text-anchor": "end", class: "ruler-tick" }, words)).join("");
  }

  // How high the top ball will fly, beside the contact that decides it.
  drawGauge(finals) {
    const { camera, scene, w, tall, look, per } = this, { rise } = finals[this.top], { most } = look;
    if (!look.gauge || !(rise >= 0)) return void (this.gauge.innerHTML = "");
    const y = (v) => camera.down((v / most) * (tall - 90)), x = w - GAUGE - 6, floor = y(0);
    const bar = markup("rect", { x, width: GAUGE - 8, y: y(rise), height: max(1, floor - y(rise)), class: `gauge-bar ${this.engine}-bar` });
    const one = markup("line", { x1: x - 4, x2: x + GAUGE - 4, y1: y(scene.drop), y2: y(scene.drop), class: "drop-line" });
    this.gauge.innerHTML = bar + one + markup("text", { x: w - 8, y: y(rise) - 6, "text-anchor": "end", class: `gauge-value ${this.engine}` }, digits(rise / per, 3));
  }

  show(frame, press) {
    const { camera, film, engine } = this, heights = film.heights(engine, frame.time), balls = camera.place(heights, frame.zoom);
    this.isNear = frame.zoom > 2 / 3;
    for (let i = this.top, last = -Infinity; i > 0; i--) last = this.put(this.each[i], balls[i], last);
    this.placed = balls;
    const [first] = balls.slice(1), height = max(0, first.low), fade = max(0, 1 - height / (0.8 * this.tall));
    set(this.shadow, { cx: this.x, cy: camera.down(-3), rx: (first.r * (0.75 + 0.5 * fade)).toFixed(1), ry: max(2, 0.09 * first.r).toFixed(1), opacity: fade.toFixed(2), fill: "url(#ground)" });
    const far = max(0, 1 - 3 * frame.zoom), near = max(0, 3 * frame.zoom - 2);
    for (const part of [this.ruler, this.tops]) set(part, { opacity: far.toFixed(2) });
    set(this.gauge, { opacity: near.toFixed(2) });
    this.drawTops(balls, frame);
    this.drawMarks(balls, press, near);
    this.drawGhosts(balls, frame);
    this.tellScale(frame.zoom);
    if (this.look.watched) this.showLens(heights, balls, near);
  }

  // A name at `last` hides one that would meet it. Where the last name is, is returned.
  put({ element, cut, body, label }, ball, last) {
    const { r, low, below, above } = ball, wide = r * bulge(ball);
    set(element, { transform: `translate(${this.x.toFixed(1)} ${this.camera.down(low + r).toFixed(2)})` });
    set(body, { transform: `scale(${wide.toFixed(2)} ${r.toFixed(2)})` });
    set(cut, { x: -wide - 3, width: 2 * wide + 6, y: (above ? above - r : -r - 3).toFixed(2), height: max(0, 2 * r - below - above + (above ? 0 : 3) + (below ? 0 : 3)).toFixed(2) });
    const isInside = r > 44, isAside = this.look.handles[1]?.kind === "t1" && this.engine === "soft"; // room for a spring
    const y = this.camera.down(low + r), isByLens = this.look.watched && this.isNear && y > this.lens.cy - this.lens.r - 12 && y < this.lens.valueAt + 18, room = isInside ? 2 * r + (this.isNarrow ? -12 : 40) : this.w - (isByLens ? LENS_WORDS : this.look.gauge ? GAUGE + 10 : 4) - this.x - r - 8;
    const share = min(1, room / (NAME_SIZE * widthOf(label.textContent)));
    const isHidden = (this.isNarrow && !isInside) || share < LEAST_SIZE || y < last + NAME_SIZE;
    set(label, { visibility: isHidden ? "hidden" : "visible", style: smaller(NAME_SIZE, share) });
    set(label, isInside ? { x: 0, y: isAside ? -0.68 * r : 0, "text-anchor": "middle" } : { x: (r + 8).toFixed(1), y: 0, "text-anchor": "start" });
    return isHidden ? last : y;
  }

  // From where a ball stands, dotted, to its highest point, with the number: between the ruler and the balls, or where there is
  // no room beyond them.
  drawTops(balls, { time, zoom }) {
    const { film, engine, camera, look, per } = this, widest = max(...balls.map((one) => one.r)), side = this.isNarrow ? 1 : -1;
    const step = min(30, (side > 0 ? this.w - this.x - widest - 34 : this.x - LEFT - 24) / this.top);
    const up = balls.map((_, i) => i > 0 && zoom < 0.3 && !look.asks && film.isUp(engine, i, time)), key = up.join();
    if (key === this.upNow && zoom > 0 === this.wasNear) return;
    Object.assign(this, { upNow: key, wasNear: zoom > 0 });
    const taken = []; // by numbers of higher balls
    this.tops.innerHTML = balls.reduceRight((written, { low, zero }, i) => {
      if (!up[i]) return written;
      const x = (this.x + side * (widest + 10 + step * (this.top - i))).toFixed(1), [y1, y2] = [zero, max(zero, low)].map((z) => camera.down(z).toFixed(1));
      const line = markup("path", { d: `M${x} ${y1}V${y2}m${5 * side} 0h${-side * (i === this.top ? 40 : 10)}M${x - 5} ${y1}h10`, class: "top-line" });
      const words = digits(max(0, film.lanes[engine].held[i]) / per, 3), wide = DIGIT * words.replace(/\D/g, "").length + 4;
      const zeroLine = markup("line", { x1: x, x2: this.x, y1, y2: y1, class: "zero-mark" }), isOut = side > 0 && x > this.w - wide;
      const place = isOut ? { x: this.w - 3, "text-anchor": "end" } : { x: x - 5 * side, "text-anchor": side > 0 ? "start" : "end" };
      const isFree = !taken.some(([x0, y0, span]) => abs(x0 - x) < span && abs(y0 - y2) < NUMBER_SIZE);
      if (isFree) taken.push([x, y2, wide]);
      return zeroLine + line + (look.opens || !isFree ? "" : markup("text", { ...place, y: y2 - 6, class: `top-value ${engine}` }, words)) + written;
    }, "");
  }

  drawMarks(balls, press, near) {
    this.lines.forEach((line, c) => {
      const half = min(6 + 20 * press[c], 1.2 * max(balls[c].r, balls[c + 1].r)), y = this.camera.down(balls[c + 1].low + balls[c + 1].below).toFixed(2);
      set(line, { x1: this.x - half, x2: this.x + half, y1: y, y2: y, opacity: (near * press[c]).toFixed(2) });
    });
  }

  // Where the ball would have to be held, and where it is guessed to fly.
  drawGhosts(balls, { zoom, time }) {
    const { look, camera, top } = this, { ghost, guess, asks } = look, { r, zero } = balls[top], parts = [];
    const poised = abs(time) < 1e-9 && zoom > 0.99;
    if (ghost > 0 && poised) parts.push(this.ghostBall(zero + ghost * camera.scales(1)[0], r, plain("gap-mark", { gap: [ghost, "m", 2] }), this.scene.gap[top - 1] > ghost));
    const at = guess ?? (asks ? 1 : null);
    if (at !== null && zoom < 0.3) parts.push(this.ghostBall(zero + at * this.scene.drop * camera.scales(0)[0], asks ? max(12, r) : r, guess === null ? plain("drag-me") : this.guessSaid(guess), asks));
    const step = min(13, this.w / 55); // the widest row stays beside the ball
    if (zoom < 0.3) parts.push(...dots(look.guesses).map(([height, place]) => markup("circle", { cx: this.w - 16 - step * place, cy: camera.down(zero + height * this.scene.drop * camera.scales(0)[0]), r: 0.4 * step, class: "dot" })));
    const written = parts.join("");
    if (this.ghosts.written !== written) this.ghosts.innerHTML = this.ghosts.written = written;
  }

  guessSaid(guess) {
    return plain("your-guess", { guess: guess > 0 ? (guess * this.scene.drop) / this.per : guess });
  }

  // Its words are above it, but where they would meet a ball and its name, at the left end of its line: `isAside`.
  ghostBall(low, r, words, isAside) {
    const y = this.camera.down(low + r), edge = this.camera.down(low), { cx, r: glass } = this.lens, half = 0.5 * NAME_SIZE * widthOf(words);
    const right = this.look.watched ? cx - glass - 6 : this.w, place = isAside ? { x: LEFT, y: edge - 5 } : { x: max(half, min(this.x, right - half)), y: y - r - 7, "text-anchor": "middle" };
    return markup("circle", { cx: this.x, cy: y, r, class: "ghost" }) + markup("line", { x1: LEFT, x2: this.w - 8, y1: edge, y2: edge, class: "ghost-line" })
      + markup("text", { ...place, class: "guess-text" }, words).replace(/_(\w)(.*)<\/text>/, '<tspan dy="3" font-size="0.75em">$1</tspan><tspan dy="-3">$2</tspan></text>');
  }

  tellScale(zoom) {
    const { camera, look } = this, [key, n] = zoom > 0.5 ? ["paths-larger", camera.times] : ["balls-larger", camera.larger];
    set(this.note, { x: 10, y: this.tall - 8, class: "ruler-tick", style: this.isNarrow ? "font-size:10px" : "" });
    text(this.note, n <= 1.05 || look.opens ? "" : plain(key, { times: [n, "", 2] }));
  }

  layLens() {
    const r = min(46, 0.16 * this.w);
    this.lens.layout({ cx: this.w - r - 12, cy: max(r + 46, 0.24 * this.tall), r, upright: true, range: this.look.watched.range, least: this.look.watched.least, natural: this.camera.scales(1)[1] });
  }

  showLens(heights, balls, near) {
    const c = this.look.watched.pair, touch = this.camera.down(balls[c + 1].low);
    set(this.lens.element, { opacity: near.toFixed(2) });
    this.lens.show(heights[c + 1] - heights[c], [this.x, touch.toFixed(1)]);
  }
}

function ballOf(kind, id) {
  const cut = svg("rect"), body = svg("g", { class: "face" }), label = svg("text", { class: "ball-name", dy: "0.36em" });
  body.innerHTML = face(kind);
  const element = svg("g", { class: "ball" }, svg("clipPath", { id: `cut-${id}` }, cut), svg("g", { "clip-path": `url(#cut-${id})` }, body), label);
  return { element, cut, body, label };
}
