// The guesses of a class: typed or pasted on the teacher's screen, one dot each beside the ruler; a pupil's own in its link.
import { min, round } from "../physics/numbers.mjs";

export const HIGHEST = 10; // drop heights
const WIDEST = 14, AS_LINK = /guess=([^&\s]+)/g, SETTING = /\S*=\S*/g, LIST = /\d+(?:,\d+){2,}/g, AS_NUMBER = /-?\d+(?:[.,]\d+)?/g; // dots side by side

// In a text with links only what they say counts; else every number in it that is not in a link. 1,2,3 are three.
export function guessesIn(written) {
  const links = [...written.matchAll(AS_LINK)].map((found) => found[1]), typed = written.replace(SETTING, "").replace(LIST, (list) => list.replaceAll(",", " "));
  const all = links.length ? links : (typed.match(AS_NUMBER) ?? []);
  return all.map((one) => Number(one.replace(",", "."))).filter((x) => x >= 0 && x <= HIGHEST);
}

// A dot each, in rows of half a drop height: [height, place in its row]; closer together in a row of many.
export function dots(guesses) {
  const rows = new Map(), placed = [...guesses].sort((a, b) => a - b).map((guess) => {
    const row = round(2 * guess) / 2, place = rows.get(row) ?? 0;
    rows.set(row, place + 1);
    return [row, place];
  });
  return placed.map(([row, place]) => [row, place * min(1, WIDEST / rows.get(row))]);
}

export class Classroom {
  constructor(changed) {
    this.box = document.querySelector(".class-guesses");
    this.box.addEventListener("input", () => changed(guessesIn(this.box.value)));
  }

  load(guesses) {
    if (guesses.length) this.box.closest("details").open = true;
    if (document.activeElement !== this.box) this.box.value = guesses.join(" ");
  }
}
