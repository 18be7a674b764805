// A word that is tapped is explained below its paragraph, and put away by another tap.
import { h, set } from "../shell/dom.mjs";
import { told } from "./words.mjs";

export function explainTerms() {
  document.addEventListener("click", (event) => {
    const term = event.target.closest?.(".term");
    if (term) toggle(term);
  });
}

function toggle(term) {
  const paragraph = term.closest("p, li, dt") ?? term.parentElement, next = paragraph.nextElementSibling;
  const shown = next?.classList.contains("meaning") ? next : null, same = shown?.dataset.term === term.dataset.term;
  shown?.remove();
  for (const other of paragraph.querySelectorAll(".term")) set(other, { "aria-expanded": "false" });
  if (same) return;
  const note = h("p", { class: "meaning", role: "note", "data-term": term.dataset.term });
  told(note, `term-${term.dataset.term}`);
  paragraph.after(note);
  set(term, { "aria-expanded": "true" });
}
