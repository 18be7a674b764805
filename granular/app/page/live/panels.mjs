// Results in numbers: big figures, rise heights (or velocities), tie rules, tables, CSV.
import { Chart, tickName, ticks } from "../shell/axes.mjs";
import { $, csv, fillTable, h, set, text, whenIdle } from "../shell/dom.mjs";
import { digits, quantity } from "../shell/format.mjs";
import { simulateHard, TIES } from "../physics/hard.mjs";
import { isEarly, SAME } from "../physics/measures.mjs";
import { pairName } from "../physics/verdict.mjs";
import { shortName } from "./charts.mjs";
import { plain, say, told } from "./words.mjs";
import { abs, max, min, round, sqrt } from "../physics/numbers.mjs";

const DEEP = 0.1, LISTED = 400, ENGINES = ["hard", "soft"];

export class Panels {
  constructor() {
    set($(".contacts-box"), { ontoggle: () => this.listContacts() });
    this.rises = new Chart($(".rises"), { height: 225 });
  }

  // Returns what is to be drawn later, by name.
  load(report, setup) {
    this.report = report;
    figures(report, setup);
    told($(".rises-title"), report.scene.gravity ? "rises-title" : "speeds-title");
    text($(".rises-key"), report.scene.gravity ? `┄ ${plain("label-drop")}` : "");
    const touching = report.scene.gravity === 0 && report.scene.gap.includes(0);
    if (!touching) $(".ties-box").hidden = true;
    if (touching) whenIdle(() => this.report === report && tieRules(report)); // six more runs
    return { rises: () => (report.scene.gravity ? drawRises : drawSpeeds)(this.rises, report), ...($(".table-box").matches(".off") ? {} : { table: () => this.tabulate() }) };
  }

  tabulate() {
    finalsTable(this.report);
    text($(".finals-note"), endNotes(this.report));
    this.listContacts();
  }

  // Hundreds of rows, filled in only while they are to be seen.
  listContacts() {
    if (!$(".contacts-box").open) return;
    const counts = {}, counted = (engine) => (counts[engine] = (counts[engine] ?? 0) + 1);
    const rows = contactRows(this.report).slice(0, LISTED).map(([engine, pair, ...values]) => [engine, `${plain(engine)} ${counted(engine)}`, pair, ...values.map((x) => digits(x, 7))]);
    fillTable($(".contacts"), contactHead(), rows);
  }
}

// What is shown of a run that did not get to its end, and of overlaps for which no force law is made, in sentences.
const endNotes = ({ scene, soft, hard }) => [isEarly(hard) ? say("early-hard") : "", isEarly(soft) ? say("early-soft") : "", deepNote(scene, soft.contacts)].join(" ").trim();

function deepNote(scene, contacts) {
  const share = ({ pair, deepest }) => deepest / min(...scene.radius.slice(pair, pair + 2).filter(Boolean)), worst = contacts.reduce((a, b) => (a && share(a) >= share(b) ? a : b), null);
  return worst && share(worst) > DEEP ? say("deep", { pair: pairName(scene, worst.pair), share: { say: "percent", n: [100 * share(worst), "", 2] } }) : "";
}

function figures({ scene, hard, soft, pairs, finals }, setup) {
  const top = pairs.at(-1), last = scene.mass.length - 1, isPair = pairs.length > 1 || !scene.gravity; // of balls
  const number = (run) => digits(setup.measure(run), 3);
  const count = (run) => (isEarly(run) ? `${run.contacts.length}+` : String(run.contacts.length));
  const shared = soft.impulse > 0 ? round((100 * soft.shared) / soft.impulse) : 0;
  const parts = [
    ["figure-contacts", count(hard), count(soft), isPair ? say("figure-contacts-of", top) : ""],
    [`figure-${setup.measured}${isPair ? "" : "-of-one"}`, number(hard), number(soft), undecided(finals, last, scene) || (scene.gravity ? say("figure-drop", { drop: [scene.drop, "m"] }) : say("figure-arrival", { v: [scene.impact, "m/s"] }))],
  ];
  if (isPair) parts.push(["figure-shared", ...[0, shared].map((n) => say("percent", { n })), say("figure-binary")]);
  showFigures($(".figures"), parts);
}

// The speed that takes a ball as high as it rises: that of another moment would contradict it.
const thrown = ({ rise }, { gravity }) => sqrt(2 * gravity * rise);

// Which engines do not tell where ball i gets to.
const undecided = (finals, i, { gravity }) =>
  ENGINES.filter((engine) => Number.isNaN(finals[engine][i][gravity ? "rise" : "velocity"])).map((engine) => plain("undecided", { engine: { say: `${engine}-spheres` } })).join("; ");

function showFigures(host, parts) {
  if (host.children.length !== parts.length) {
    host.replaceChildren(...parts.map(() => h("div", { class: "figure" }, h("p", { class: "figure-name" }), h("p", { class: "hard" }), h("p", { class: "soft" }), h("small"))));
  }
  parts.forEach(([title, ...contents], i) => {
    told(host.children[i].children[0], title);
    contents.forEach((content, j) => text(host.children[i].children[j + 1], content));
    ENGINES.forEach((engine, j) => (host.children[i].children[j + 1].dataset.engine = say(engine)));
  });
}

// What is not known is a question mark.
function bars(chart, rows, n, names) {
  const pitch = chart.x(1) - chart.x(0), longest = max(...finite(rows).map((x) => digits(x, 3).length)), isWide = pitch >= 15 * longest;
  rows.forEach(([engine, values], e) => values.forEach((value, i) => {
    const side = [`bar-value ${engine}`, e ? "start" : "end"], at = chart.x(i) + (e ? 2 : -2);
    if (Number.isNaN(value)) return chart.note("?", at, chart.y(0) - 5, ...side);
    const width = min(26, 0.34 * pitch), x = chart.x(i) + (e ? 1 : -width - 1), y0 = chart.y(0), y = chart.y(value);
    chart.add("rect", { class: `${engine}-bar`, x, width, y: min(y, y0), height: max(0.8, abs(y - y0)) });
    if (isWide) chart.note(digits(value, 3), at, value < 0 ? y + 13 : y - 5, ...side);
  }));
  chart.xTicks([...Array(n).keys()], names);
  const without = rows.filter(([, values]) => values.every(Number.isNaN)).map(([engine]) => plain("undecided", { engine: { say: `${engine}-spheres` } }));
  if (without.length) chart.note(without.join("; "), chart.left + 6, chart.top + 48);
}

const finite = (rows) => rows.flatMap(([, values]) => values).filter(Number.isFinite);

function drawRises(chart, { scene, finals }) {
  const { kinds, mass } = scene, n = mass.length - 1, rows = ENGINES.map((e) => [e, finals[e].slice(1).map((f) => f.rise)]);
  const top = max(scene.drop, ...finite(rows));
  chart.scales([-0.6, n - 0.4], [0, 1.14 * top]);
  chart.yTicks(ticks([0, top], 4), tickName, "m");
  bars(chart, rows, n, (i) => (kinds[i + 1] ? plain(`ball-${kinds[i + 1]}`) : n > 4 ? String(i + 1) : plain("ball", { n: i + 1 })));
  chart.line([[-0.6, scene.drop], [n - 0.4, scene.drop]], { class: "drop-line" });
  describe(chart, "rises-said", rows, "m");
}

function drawSpeeds(chart, { scene, finals }) {
  const n = scene.mass.length, rows = ENGINES.map((e) => [e, finals[e].map((f) => f.velocity / scene.impact)]);
  const all = finite(rows), [low, high] = [min(0, ...all), max(1, ...all)];
  chart.scales([-0.6, n - 0.4], [low - 0.1 * (high - low), 1.12 * high]);
  chart.yTicks(ticks([low, high], 4), tickName, plain("in-arrivals"));
  bars(chart, rows, n, (i) => String(i + 1));
  describe(chart, "speeds-said", rows, "");
}

function describe(chart, key, rows, unit) {
  const [hard, soft] = rows.map(([, values]) => values.map((x) => quantity(x, unit)).join(", "));
  chart.finish(plain(key, { hard, soft }));
}

function tieRules({ scene, eps, hard, finals, tieErrors }) {
  const row = (engine, name, velocity) => [engine, name, ...velocity.map((v) => digits(v / scene.impact, 3))];
  const rows = TIES.map((ties) => {
    const run = ties === "left" ? hard : simulateHard(scene, eps, { ties, maxEvents: 1000 });
    return row("hard", say(`tie-${ties}`), isEarly(run) ? run.velocity.map(() => NaN) : run.velocity);
  });
  const softRow = row("soft", say("soft-spheres"), finals.soft.map((f) => f.velocity));
  fillTable($(".ties"), [say("tie-rule"), ...scene.mass.map((_, i) => say("ball", { n: i + 1 }))], [...rows, softRow]);
  told($(".ties-title"), tieErrors.some(([, error]) => error > SAME) ? "ties-differ" : "ties-agree");
  $(".ties-box").hidden = false;
}

function finalsTable({ scene, finals }) {
  const first = scene.gravity ? 1 : 0;
  const results = (i) => ENGINES.flatMap((e) => (first ? [digits(thrown(finals[e][i], scene), 5), digits(finals[e][i].rise, 4)] : [digits(finals[e][i].velocity, 5)]));
  const rows = scene.mass.map((m, i) => ["", say("ball", { n: i + 1 - first }), digits(m, 3), digits(2e3 * scene.radius[i], 3), ...results(i)]);
  const heads = ENGINES.flatMap((e) => [`${first ? "√(2gh)" : "v′"} ${say(e)}, m/s`, ...(first ? [say("head-rise", { engine: { say: e } })] : [])]);
  fillTable($(".finals"), ["", say("head-mass"), say("head-diameter"), ...heads], rows.slice(first));
}

const contactHead = () => ["engine", "pair", "begin", "end", "lower-before", "upper-before", "lower-after", "upper-after"].map((name) => say(`column-${name}`));

function contactRows({ scene, hard, soft }) {
  return [["hard", hard], ["soft", soft]].flatMap(([engine, run]) =>
    run.contacts.map((c) => [engine, shortName(scene, c.pair), c.begin, c.end, ...c.vIn, ...c.vOut]));
}

export const contactsCsv = (report) => csv([contactHead(), ...contactRows(report), ...(endNotes(report) ? [["note", endNotes(report)]] : [])]);
