// Results in numbers: three big figures, rise heights (or velocities), tie rules, tables, CSV.
import { Chart, tickName, ticks } from "../shell/axes.mjs";
import { $, csv, fillTable, h, marked, text, whenIdle } from "../shell/dom.mjs";
import { digits, quantity } from "../shell/format.mjs";
import { RULES, simulateHard, TIES } from "../physics/hard.mjs";
import { isEarly, SAME } from "../physics/measures.mjs";
import { shortName } from "./charts.mjs";

export class Panels {
  constructor() {
    $(".contacts-box").addEventListener("toggle", () => this.listContacts());
    this.rises = new Chart($(".rises"), { height: 310, label: "rise heights" });
  }

  load(report, setup) {
    this.report = report;
    figures(report, setup);
    if (report.scene.gravity) drawRises(this.rises, report);
    else drawSpeeds(this.rises, report);
    finalsTable(report);
    text($(".finals-note"), endNotes(report));
    text($(".rises-title"), report.scene.gravity ? "Rise heights, to scale" : "Velocities after the last contact");
    const touching = report.scene.gravity === 0 && report.scene.gap.includes(0);
    $(".ties-box").hidden = !touching;
    if (touching) whenIdle(() => this.report === report && tieRules(report)); // six more runs
    this.listContacts();
  }

  // Hundreds of rows, filled in only while they are to be seen.
  listContacts() {
    if (!$(".contacts-box").open) return;
    const rows = contactRows(this.report).slice(0, LISTED).map(([engine, pair, ...values]) => [engine, engine, pair, ...values.map((x) => digits(x, 7))]);
    fillTable($(".contacts"), CONTACT_HEAD, rows);
  }
}

const LISTED = 400;

// What is shown of a run that did not get to its end, in a sentence.
const endNotes = ({ soft, hard }) => [
  isEarly(hard) ? "Hard spheres collide without end: they have no final velocities, and only the first contacts are listed." : "",
  isEarly(soft) ? "Soft spheres are too stiff to follow here: they have no final velocities, and only the first contacts are listed." : "",
].join(" ").trim();

function figures({ scene, hard, soft, pairs, eps, finals }, setup) {
  const top = pairs[pairs.length - 1], last = scene.mass.length - 1, measure = setup.measure(eps);
  const number = (run) => (isEarly(run) ? "–" : digits(measure(run), 3));
  const count = (run) => (isEarly(run) ? `${run.contacts.length}+` : String(run.contacts.length));
  const shared = soft.impulse > 0 ? Math.round((100 * soft.shared) / soft.impulse) : 0;
  const parts = [
    ["contacts in all", count(hard), count(soft), `of the top pair: ${top.hard.contacts} and ${top.soft.contacts}`.replace("top", scene.gravity ? "top" : "last")],
    [setup.measureName, number(hard), number(soft), `ε = ${digits(eps, 3)} in every contact`],
  ];
  if (scene.gravity) {
    const metres = (engine) => quantity(finals[engine][last].rise, "m");
    parts.push(["top ball rises", metres("hard"), metres("soft"), `dropped from ${quantity(scene.drop, "m")}`]);
  }
  parts.push(["impulse shared with a neighbour", "0 %", `${shared} %`, "0 %: every contact is binary"]);
  showFigures($(".figures"), parts);
}

function showFigures(host, parts) {
  const titles = parts.map(([title]) => title).join();
  if (host.titles !== titles) {
    host.titles = titles;
    host.replaceChildren(...parts.map(([title]) =>
      h("div", { class: "figure" }, h("h2", {}, ...marked(title)), h("p", { class: "hard" }), h("p", { class: "soft" }), h("small"))));
  }
  parts.forEach(([, ...contents], i) => contents.forEach((content, j) => text(host.children[i].children[j + 1], content)));
}

function bars(chart, rows, n, names) {
  rows.forEach(([engine, values], e) => values.forEach((value, i) => {
    if (Number.isNaN(value)) return;
    const width = Math.min(26, (0.34 * (chart.x(1) - chart.x(0)))), x = chart.x(i) + (e ? 1 : -width - 1), y0 = chart.y(0), y = chart.y(value);
    chart.add("rect", { class: `${engine}-bar`, x: x.toFixed(1), width: width.toFixed(1), y: Math.min(y, y0).toFixed(1), height: Math.max(0.8, Math.abs(y - y0)).toFixed(1) });
    const label = { x: (chart.x(i) + (e ? 2 : -2)).toFixed(1), y: (value < 0 ? y + 13 : y - 5).toFixed(1), "text-anchor": e ? "start" : "end", class: `bar-value ${engine}` };
    if (chart.x(1) - chart.x(0) >= 88) chart.note(digits(value, 2), label);
  }));
  chart.xTicks([...Array(n).keys()], names);
  const without = rows.filter(([, values]) => values.every(Number.isNaN)).map(([engine]) => `${engine} spheres: not decided`);
  if (without.length) chart.note(without.join("; "), { x: chart.left + 6, y: chart.top + 24, class: "axis-name" });
}

const known = (rows) => rows.flatMap(([, values]) => values).filter(Number.isFinite);

function drawRises(chart, { scene, finals }) {
  const n = scene.mass.length - 1, rows = ["hard", "soft"].map((e) => [e, finals[e].slice(1).map((f) => f.rise)]);
  const top = Math.max(scene.drop, ...known(rows));
  chart.scales([-0.6, n - 0.4], [0, 1.14 * top]);
  chart.yTicks(ticks([0, top], 4), tickName, "m");
  bars(chart, rows, n, (i) => `ball ${i + 1}`);
  chart.line([[-0.6, scene.drop], [n - 0.4, scene.drop]], { class: "drop-line" });
  if (chart.y(0) - chart.y(scene.drop) > 30) chart.note("drop height", { x: chart.left + 6, y: chart.y(scene.drop) - 5, class: "axis-name" });
  chart.finish();
  const said = rows.map(([e, v]) => `${e}: ${v.map((x) => digits(x, 3)).join(", ")} m`).join("; ");
  chart.svg.setAttribute("aria-label", `rise heights of the balls from below, ${said}`);
}

function drawSpeeds(chart, { scene, finals }) {
  const n = scene.mass.length, rows = ["hard", "soft"].map((e) => [e, finals[e].map((f) => f.velocity / scene.impact)]);
  const all = known(rows), [low, high] = [Math.min(0, ...all), Math.max(1, ...all)];
  chart.scales([-0.6, n - 0.4], [low - 0.1 * (high - low), 1.12 * high]);
  chart.yTicks(ticks([low, high], 4), tickName, "in arrival speeds");
  bars(chart, rows, n, (i) => String(i + 1));
  chart.finish();
  const said = rows.map(([e, v]) => `${e}: ${v.map((x) => digits(x, 3)).join(", ")}`).join("; ");
  chart.svg.setAttribute("aria-label", `velocities of the balls from the left in arrival speeds, ${said}`);
}

function tieRules({ scene, eps, hard, finals, tieErrors }) {
  const row = (engine, name, velocity) => [engine, name, ...velocity.map((v) => digits(v / scene.impact, 3))];
  const rows = TIES.map((ties) => {
    const run = ties === "left" ? hard : simulateHard(scene, eps, { ties, maxEvents: 1000 });
    return row("hard", RULES[ties], isEarly(run) ? run.velocity.map(() => NaN) : run.velocity);
  });
  fillTable($(".ties"), ["rule", ...scene.mass.map((_, i) => `ball ${i + 1}`)], [...rows, row("soft", "soft spheres", finals.soft.map((f) => f.velocity))]);
  text($(".ties-title"), tieErrors.some(([, error]) => error > SAME) ? "No unique hard-sphere answer" : "Touching balls: six rules, one answer");
}

function finalsTable({ scene, finals }) {
  const first = scene.gravity ? 1 : 0, engines = ["hard", "soft"];
  const results = (i) => engines.flatMap((e) => [digits(finals[e][i].velocity, 5), ...(first ? [digits(finals[e][i].rise, 4)] : [])]);
  const rows = scene.mass.map((m, i) => ["", `ball ${i + 1 - first}`, digits(m, 3), digits(2e3 * scene.radius[i], 3), ...results(i)]);
  const heads = engines.flatMap((e) => [`v′ ${e}, m/s`, ...(first ? [`rise ${e}, m`] : [])]);
  fillTable($(".finals"), ["", "mass, kg", "diameter, mm", ...heads], rows.slice(first));
}

const CONTACT_HEAD = ["engine", "pair", "begin, s", "end, s", "v lower before, m/s", "v upper before, m/s", "v lower after, m/s", "v upper after, m/s"];

function contactRows({ scene, hard, soft }) {
  return [["hard", hard], ["soft", soft]].flatMap(([engine, run]) =>
    run.contacts.map((c) => [engine, shortName(scene, c.pair), c.begin, c.end, ...c.vIn, ...c.vOut]));
}

export const contactsCsv = (report) => csv([CONTACT_HEAD, ...contactRows(report), ...(endNotes(report) ? [["note", endNotes(report)]] : [])]);
