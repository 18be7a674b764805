// In which language the page speaks, and whether somebody has read it in that.
import { $, h, set } from "../shell/dom.mjs";
import { LANGUAGES, languageNow, nameOf, plain } from "./words.mjs";

const READ = ["en"]; // by native speakers

export class Tongue {
  constructor(chosen) {
    this.select = $(".language");
    this.select.append(...LANGUAGES.map((one) => h("option", { value: one }, nameOf(one))));
    set(this.select, { onchange: () => chosen(this.select.value) });
  }

  load() {
    set(this.select, { "aria-label": plain("language-label") });
    this.select.value = languageNow();
    $(".unread").hidden = READ.includes(languageNow());
  }
}
