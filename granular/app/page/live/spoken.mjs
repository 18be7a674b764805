// The verdict in one line, as `granular compare` judges: in heights where something rises. While a slider moves it
// changes at once for the eye, but is announced only when it rests.
import { $, text } from "../shell/dom.mjs";
import { inHeights } from "../physics/verdict.mjs";
import { plain, told } from "./words.mjs";

const PAUSE = 350; // ms without a change

export class Spoken {
  load(report, covered, isStory) {
    const { answer, verdict } = inHeights(report, isStory);
    told($(".verdict-words"), verdict.say, verdict);
    $(".verdict").classList.toggle("yes", answer === "yes");
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => text($(".announced"), covered ? "" : plain(verdict.say, verdict)), PAUSE);
  }
}
