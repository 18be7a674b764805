// The sheet for pupils, and the same sheet filled in: `known` are the answers.
import { h, marked, svg } from "../shell/dom.mjs";
import { dots } from "./classroom.mjs";
import { digits } from "../shell/format.mjs";
import { CAUSES } from "./predict.mjs";
import { plain } from "./words.mjs";
import { max } from "../physics/numbers.mjs";

const DROP = 36, EDGE = 34, BOTTOM = 390, HIGHEST_MARK = 10; // of the ruler: one drop height, its place, its zero, its end
const R_LOWER = 26, R_UPPER = 8; // radii of its balls

export const p = (key, values) => h("p", {}, ...marked(plain(key, values)));
const stroke = (d, more) => svg("path", { d, fill: "none", stroke: "#000", ...more });
const word = (x, y, words, more) => svg("text", { x, y, "font-size": 11, ...more }, words);

// A sentence whose places are blank or filled in; a drop height is given.
function gaps(key, values, isFilled) {
  const parts = plain(key, Object.fromEntries(Object.entries(values).map(([name, value]) => [name, name === "drop" ? value : `|${value}|`]))).split("|");
  return parts.flatMap((part, i) => (i % 2 ? [h("b", { class: isFilled ? "blank" : "blank open" }, isFilled ? part : "\u2060")] : marked(part)));
}

function ruler({ hard, soft }, guesses) {
  const y = (height) => BOTTOM - DROP * height, ticks = Array.from({ length: 2 * HIGHEST_MARK + 1 }, (_, i) => i / 2), floor = BOTTOM + R_UPPER + 2 * R_LOWER;
  const marks = [["hard", hard], ["soft", soft]].filter(([, height]) => height >= 0);
  return svg("svg", { class: "ruler-sheet", viewBox: "0 0 170 454", role: "img", "aria-label": plain("in-metres") },
    word(EDGE - 20, 12, plain("in-metres")), stroke(`M${EDGE} ${y(HIGHEST_MARK + 0.4)}V${BOTTOM}`, { "stroke-width": 1.5 }),
    ...ticks.map((height) => stroke(`M${EDGE} ${y(height)}h${height % 1 ? 7 : 14}`)), ...ticks.filter((height) => height % 1 === 0).map((height) => word(EDGE - 8, y(height) + 4, height, { "text-anchor": "end", "font-size": 13 })),
    stroke(`M${EDGE + 14} ${y(1)}H168M${EDGE + 14} ${BOTTOM}H168`, { "stroke-dasharray": "2 3" }), word(168, y(1) - 4, plain("pack-here"), { "text-anchor": "end" }), word(168, BOTTOM - 14, plain("ball-tennis-ball"), { "text-anchor": "end" }),
    svg("circle", { cx: EDGE + 60, cy: floor - R_LOWER, r: R_LOWER, fill: "#ddd", stroke: "#000" }), svg("circle", { cx: EDGE + 60, cy: BOTTOM, r: R_UPPER, fill: "#fff", stroke: "#000" }), stroke(`M${EDGE} ${floor}H168`, { "stroke-width": 2.5 }),
    ...marks.flatMap(([engine, height]) => [stroke(`M${EDGE - 4} ${y(height)}H168`, { class: `mark-${engine}`, "stroke-width": 2 }), word(168, y(height) - 4, `${plain(engine)} ${digits(height)}`, { class: "answer", "text-anchor": "end" })]),
    ...dots(guesses).map(([height, place]) => svg("circle", { cx: EDGE + 20 + 3.6 * place, cy: y(height), r: 1.7 })));
}

// The floor's push in time, with axes; the answer is shaded.
function push({ curve, parts, lasts, arrives }, isFilled) {
  const left = 42, base = 82, wide = 450, ms = max(...curve.map(([t]) => t)) * 1000, most = 100 * Math.ceil(max(...curve.map(([, f]) => f)) / 100);
  const x = (t) => left + (t * 1000 / ms) * (wide - left - 30), y = (force) => base - (force / most) * (base - 20), area = (points, from, to) => `M${x(from)} ${base}${points.map(([t, f]) => `L${x(t).toFixed(1)} ${y(f).toFixed(1)}`).join("")}L${x(to)} ${base}z`;
  const shaded = isFilled ? parts.map(([a, b]) => svg("path", { class: "shaded", d: area(curve.filter(([t]) => t >= a && t <= b), a, b) })) : [];
  const times = Array.from({ length: 1 + ms / 2 }, (_, i) => 2 * i), forces = [most / 2, most];
  return svg("svg", { class: "push-sheet", viewBox: `0 0 ${wide + 10} 111`, role: "img", "aria-label": plain("pack-force") },
    ...shaded, stroke(area(curve, 0, lasts), { "stroke-width": 1.6 }), stroke(`M${x(arrives)} ${base + 4}V20`, { "stroke-dasharray": "4 3" }),
    stroke(`M${left} 4V${base}H${wide}m-7 -4l7 4l-7 4M${left - 4} 11l4 -7l4 7`), word(left + 8, 12, plain("pack-force")), word(wide, base + 27, plain("time-in", { unit: "ms" }), { "text-anchor": "end" }),
    ...times.flatMap((t) => [stroke(`M${x(t / 1000)} ${base}v4`), word(x(t / 1000), base + 16, t, { "text-anchor": "middle" })]), ...forces.flatMap((force) => [stroke(`M${left} ${y(force)}h-4`), word(left - 7, y(force) + 4, force, { "text-anchor": "end" })]));
}

export function pairNames(label) {
  return label.split("+").map((name) => plain(`ball-${name.replaceAll(" ", "-")}`)).join(" + ");
}

function table(rows, isFilled) {
  const head = ["first", "second"].map((bounce) => h("th", { colspan: 2 }, plain(`pack-${bounce}`))), kinds = ["hard", "soft", "hard", "soft"].map((engine) => h("th", {}, plain(engine)));
  return h("table", {}, h("tr", {}, h("th", { rowspan: 2 }, plain("pack-pair")), ...head), h("tr", {}, ...kinds),
    ...rows.map(([name, heights]) => h("tr", {}, h("td", {}, pairNames(name)), ...heights.map((height) => h("td", { class: "answer" }, isFilled ? digits(height) : "")))));
}

// Why the models differ, as the page asks after the film: boxes to tick.
const causes = (isFilled) => h("p", { class: "causes" }, `${plain("why")} `, ...CAUSES.map((cause) => h("span", {}, h("b", { class: "answer" }, isFilled && cause === "overlap" ? "✓" : ""), plain(`why-${cause}`))));

// Lines to write on; the answer stands on them.
const lines = (n, answer) => h("p", { class: "lines answer", style: `min-height: ${7 * n}mm` }, answer);

export function sheet(known, code, guesses, isFilled) {
  const heading = (n) => h("h2", {}, `${n} `, plain(`s${n}-title`));
  const task = (n, ...more) => h("section", {}, heading(n), h("p", { class: "fills" }, ...gaps(`pack-${n}`, known[n] ?? {}, isFilled)), ...more);
  const told = (key, values) => (isFilled ? plain(`${key}-answer`, values) : "");
  const field = (key) => h("span", { class: `field ${key}` }, plain(key));
  return h("div", { class: "sheet" },
    h("header", {}, ...code, h("h1", {}, plain("title")), h("p", {}, plain("pack-sheet"), ...(isFilled ? [" – ", h("b", { class: "answer" }, plain("pack-answers"))] : [])), h("p", { class: "fields" }, ...["pack-name", "pack-class", "pack-date"].map(field))),
    h("div", { class: "beside" }, ruler(isFilled ? known : {}, isFilled ? guesses : []),
      h("div", {}, task(1, causes(isFilled)), task(2), task(3), task(4, push(known.reason, isFilled)))), lines(1, told("pack-4")),
    task(5, lines(2, told("pack-5"))), h("div", { class: "beside real" }, task(6, lines(2, told("pack-6"))), table(known.table, isFilled)),
    h("section", { class: "exit" }, h("h2", {}, plain("pack-exit")), " ", p("pack-7", known[7]), lines(2, told("pack-7", known[7]))));
}
