// The state of the page in its link: #scene=three-balls&gap=0.0001&… , #screen=3&… , and back.
import { ballCalled, ballKeys, ballNames, cleaned, FIRST, refused, SETUPS, settingsOf, withNames, withoutNames } from "../physics/setups.mjs";
import { guessesIn, HIGHEST } from "./classroom.mjs";
import { LAB, OPENING, startOf } from "./story.mjs";
import { inWords } from "./controls.mjs";
import { told } from "./words.mjs";
import { floor } from "../physics/numbers.mjs";

const PAGE_KEYS = ["scene", "screen", "at", "predict", "lang", "guess", "guesses"];
const RANGES = { screen: LAB, at: 1, guess: HIGHEST }; // of numbers, from 0 on
const QUIET = 250; // ms without a change before the link follows: browsers limit how often it may change

// A link with nothing but a language opens what the file was made for, `start`.
export function read(hash, start = "") {
  const own = parsed(hash), given = { ...(Object.keys(own).every((key) => key === "lang") ? parsed(start) : {}), ...own };
  const isEmpty = Object.keys(given).every((key) => key === "lang"), screen = isEmpty ? OPENING : floor(numberIn(given, "screen") ?? LAB);
  const begin = screen < LAB ? startOf(screen) : { name: Object.hasOwn(SETUPS, given.scene ?? "") ? given.scene : FIRST, values: {} };
  const { name } = begin, values = cleaned(name, { ...begin.values, ...withoutNames(name, given) }), isUnknown = screen === LAB && given.scene !== undefined && name !== given.scene;
  const notes = [...(isUnknown ? [{ say: "no-scene", name: given.scene }] : []), ...unknown(name, given, values), ...beyond(given), ...refused(name, given).map(refusal)];
  return { screen, name, values, told: notes, plays: screen === LAB && given.at === undefined && !("scene" in own || "screen" in own), at: numberIn(given, "at") ?? null, predict: given.predict === "1", lang: given.lang, guesses: guessesIn(given.guesses ?? ""), guess: numberIn(given, "guess") };
}

// Told first: notes on the rest are in that language.
export const languageIn = (hash, start = "") => parsed(hash).lang ?? parsed(start).lang;

const parsed = (hash) => Object.fromEntries(new URLSearchParams(hash.replace(/^#/, "")));

// A number of the page in its range, else undefined.
function numberIn(given, key) {
  const x = Number(given[key]?.replace(",", ".") || NaN);
  return x >= 0 && x <= RANGES[key] ? x : undefined;
}

const beyond = (given) => Object.keys(RANGES).filter((key) => key in given && numberIn(given, key) === undefined)
  .map((symbol) => ({ say: "refused", symbol, asked: given[symbol] || "–", range: `0 – ${RANGES[symbol]}`, shown: symbol === "screen" ? { say: "s7-title" } : "–" }));

// Keys and balls that there are not.
function unknown(scene, given, values) {
  const keys = ballKeys(scene), known = [...PAGE_KEYS, ...Object.keys(keys), ...settingsOf(scene)], names = ballNames();
  const balls = Object.entries(keys).filter(([key]) => key in given && !names.includes(given[key]));
  return [...Object.keys(given).filter((key) => !known.includes(key)).map((name) => ({ say: "no-setting", name })),
    ...balls.map(([key, i]) => ({ say: "refused", symbol: key, asked: given[key] || "–", range: names.join(", "), shown: ballCalled(scene, values, i) }))];
}

const refusal = ({ slider, asked, shown }) => {
  const { symbol, range, shown: instead } = inWords(slider, shown);
  return { say: "refused", symbol, asked: asked || "–", range, shown: instead };
};

// `guess` is a pupil's own, kept on every screen; `guesses` are those of a class.
export function written({ screen, name, values, at, predict, lang, guesses = [], guess }) {
  const place = screen < LAB ? { screen } : { scene: name };
  const start = cleaned(name, screen < LAB ? startOf(screen).values : {}), own = withNames(name, values, start);
  const pairs = { ...place, ...own, ...(at === null ? {} : { at: Number(at.toFixed(3)) }), ...(predict ? { predict: 1 } : {}), ...(guess >= 0 ? { guess } : {}), ...(guesses.length ? { guesses: guesses.join(" ") } : {}), ...(lang ? { lang } : {}) };
  return `#${new URLSearchParams(pairs)}`;
}

let waiting = 0;

export function follow(state) {
  clearTimeout(waiting);
  waiting = setTimeout(() => write(state()), QUIET);
}

// Inside an iframe's srcdoc there is no link of one's own: addresses are taken to be the host's.
const hasLink = () => location.protocol !== "about:";

export function write(state, isStep = false) {
  const hash = written(state);
  if (hash === location.hash || !hasLink()) return;
  try {
    history[isStep ? "pushState" : "replaceState"](null, "", hash);
  } catch {
    location.replace(hash); // some browsers allow no history on file://
  }
}

export async function copyLink(button, state) {
  write(state);
  const isFile = location.protocol === "file:", link = isFile ? written(state) : location.href; // nobody else has that path
  const done = hasLink() && await navigator.clipboard?.writeText(link).then(() => true, () => false);
  told(button, !hasLink() ? "no-link" : !done ? "in-address-bar" : isFile ? "copied-state" : "copied");
  setTimeout(() => told(button, "copy-link"), 1600);
}
