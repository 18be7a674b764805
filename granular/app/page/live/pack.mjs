// A lesson of 45 minutes on paper, in the page's words: a sheet for the six screens, with the code of a `link` to them, and
// a page for the teacher.
import { $, h, marked } from "../shell/dom.mjs";
import { board } from "./board.mjs";
import { code } from "./print.mjs";
import { plain } from "./words.mjs";

const TASKS = [1, 2, 3, 4, 5, 6, 7];
const PLAN = [["0–5", "pack-drop"], ["5–10", "s1-title"], ["10–18", "s2-title", "s3-title"], ["18–25", "s4-title"], ["25–35", "s5-title"], ["35–42", "s6-title"], ["42–45", "pack-7"]];

const p = (key) => h("p", {}, ...marked(plain(key)));

export function printPack(link) {
  const plan = PLAN.map(([minutes, ...keys]) => h("tr", {}, h("td", {}, minutes), h("td", {}, ...marked(keys.map((key) => plain(key)).join(" – ")))));
  const sheet = h("div", {}, ...code(link), h("h1", {}, plain("title")), h("h2", {}, plain("pack-sheet")), h("ol", {}, ...TASKS.map((n) => h("li", {}, p(`pack-${n}`)))));
  const page = h("div", {}, h("h2", {}, plain("pack-teacher")), p("pack-goals"), h("table", {}, ...plan), p("pack-with"), p("pack-answers"), h("h2", {}, plain("pack-board")), board());
  $(".pack").replaceChildren(sheet, page);
  document.body.classList.add("packed");
  addEventListener("afterprint", () => document.body.classList.remove("packed"), { once: true });
  print();
}
