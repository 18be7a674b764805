// A lesson of 45 minutes on paper, in the page's words: a sheet for pupils, the same sheet filled in, and the teacher's page.
import { $, h, marked } from "../shell/dom.mjs";
import { digits } from "../shell/format.mjs";
import { answers } from "./answers.mjs";
import { board } from "./board.mjs";
import { code } from "./print.mjs";
import { p, sheet } from "./sheet.mjs";
import { plain } from "./words.mjs";

const MINUTES = [0, 5, 10, 18, 25, 35, 42, 45], GOALS = [1, 2, 3, 4], SAYINGS = [1, 2, 3, 4, 5, 6];

const title = (key) => h("h2", {}, plain(key));
const row = (first, key) => h("tr", {}, h("td", {}, first), h("td", {}, ...marked(plain(key))));

function teacher({ steps, soft }) {
  const heights = [...steps.map((height, i) => [`preset-${["textbook", "masses", "losses"][i]}`, height]), ["soft-spheres", soft]];
  return h("div", { class: "teacher" },
    h("h1", {}, plain("pack-teacher")), p("pack-goals"), h("ol", {}, ...GOALS.map((n) => h("li", {}, ...marked(plain(`pack-goal-${n}`))))),
    title("pack-plan"), h("table", {}, ...MINUTES.slice(1).map((end, i) => row(`${MINUTES[i]}–${end}`, `pack-plan-${i + 1}`))),
    h("div", { class: "halves" }, h("div", {}, title("pack-material"), p("pack-with")), h("div", {}, title("pack-safety"), p("pack-safe"))),
    h("table", { class: "sayings" }, h("tr", {}, ...["pack-says", "pack-reveals"].map((key) => h("th", {}, plain(key)))), ...SAYINGS.map((n) => row(plain(`pack-say-${n}`), `pack-reveal-${n}`))),
    title("pack-board"), board(), h("p", { class: "heights" }, ...heights.map(([key, height]) => h("span", {}, h("b", {}, `${digits(height, 2)} h`), ` ${plain(key)}`))));
}

// `guesses` of the class stand on the ruler of the answers.
export function printPack(link, guesses) {
  const known = answers();
  $(".pack").replaceChildren(sheet(known, code(link), [], false), sheet(known, [], guesses, true), teacher(known));
  document.body.classList.add("packed");
  addEventListener("afterprint", () => document.body.classList.remove("packed"), { once: true });
  print();
}
