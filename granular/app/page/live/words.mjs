// All sentences of the page, by key, in the reader's language; what stands between braces is filled in.
//
// {name} is a number, a text, [number, unit, digits], or another sentence { say: key, … }; {name#one|other} is chosen by the
// plural rules of the language, % in it being the number. [[term|words]] marks words that are explained on tap.
import { $, h, marked, set, text } from "../shell/dom.mjs";
import { digits, quantity, writeDecimalsWith } from "../shell/format.mjs";

export const data = JSON.parse($("#data").textContent);
const keys = data.keys.split(" ");
const BEFORE_UNIT = /([\d}]) (?=(?:[mkµ]?[msg]|m\/s|[%×])(?![\wÀ-ž]))/g; // a number stays beside its unit
const wordsIn = (sentences) => Object.fromEntries(sentences.replace(BEFORE_UNIT, "$1\u00a0").split("\n").map((sentence, i) => [keys[i], sentence]));
const words = Object.fromEntries(Object.entries(data.sentences).map(([one, sentences]) => [one, wordsIn(sentences)]));
export const LANGUAGES = Object.keys(words);
let language = "", plural = null;

export const languageNow = () => language;

export function speak(asked) {
  const known = [asked, ...navigator.languages].map((one) => String(one).slice(0, 2).toLowerCase());
  language = known.find((one) => LANGUAGES.includes(one)) ?? "en";
  plural = new Intl.PluralRules(language);
  writeDecimalsWith(words[language].decimal);
  set(document.documentElement, { lang: words[language].tag });
  for (const element of document.querySelectorAll("[data-say]")) told(element, element.dataset.say, element.dataset);
  for (const element of document.querySelectorAll("[data-label]")) set(element, { "aria-label": plain(element.dataset.label) });
}

export const nameOf = (one) => words[one].language;
export const has = (key) => Object.hasOwn(words[language], key);

export function say(key, values = {}) {
  const sentence = words[language][key] ?? key;
  return sentence.replace(/\{(\w+)(?:#([^}]*))?\}/g, (_, name, forms) => (forms ? chosen(forms.split("|"), values[name]) : shown(values[name])));
}

function chosen(forms, count) {
  return (plural.select(count) === "one" ? forms[0] : forms[forms.length - 1]).replace("%", count);
}

function shown(value) {
  if (Array.isArray(value)) return quantity(...value).replace(" ", "\u00a0");
  if (value !== null && typeof value === "object") return say(value.say, value);
  return typeof value === "number" ? digits(value) : String(value ?? "");
}

const TERM = /\[\[([\w-]+)\|([^\]]*)\]\]/;

// For readers of attributes and charts: without marks.
export const plain = (key, values) => say(key, values).replace(new RegExp(TERM, "g"), "$2");

// Into an element, with its terms as buttons.
export function told(element, key, values) {
  const sentence = key === "" ? "" : say(key, values);
  if (element.told === sentence) return;
  element.told = sentence;
  if (!/\[\[|_/.test(sentence)) return text(element, sentence);
  const parts = sentence.split(/(\[\[[\w-]+\|[^\]]*\]\])/).filter(Boolean);
  element.replaceChildren(...parts.flatMap((part) => {
    const [, term, label] = TERM.exec(part) ?? [];
    return term ? [h("button", { class: "term", "data-term": term, "aria-expanded": "false" }, ...marked(label))] : marked(part);
  }));
}
