// What the page says of some cases, in some languages: [key, sentences, slots] of the answer in the laboratory, of the reason,
// and of the answer in the story, by case.
import { readFileSync } from "node:fs";

const [cases, languages, sentences] = JSON.parse(readFileSync(process.argv[2], "utf8"));
const element = { textContent: JSON.stringify(sentences), setAttribute() {} };
globalThis.window = {};
Object.defineProperty(globalThis, "navigator", { value: { languages: [] }, configurable: true });
globalThis.document = { querySelector: () => element, querySelectorAll: () => [], documentElement: element };
const from = (name) => import(`../../../granular/app/page/${name}.mjs`);
const { plain, speak } = await from("live/words"), { compareEngines, AT_LEISURE } = await from("physics/outcome");
const { inHeights } = await from("physics/verdict"), { reasonOf, reasonSaid } = await from("physics/reason"), { contactsIn, sceneOf } = await from("physics/setups");

const inAll = (said) => [said.say, languages.map((language) => (speak(language), plain(said.say, said))), said];
const told = cases.map(({ scene, values, ties }) => {
  const { eps, k } = contactsIn(scene, values), report = compareEngines(sceneOf(scene, values), eps, k, { ties, patience: { ...AT_LEISURE, follow: 3000 } });
  return [inAll(inHeights(report).verdict), inAll(reasonSaid(report, reasonOf(report))), inAll(inHeights(report, true).verdict)];
});
console.log(JSON.stringify(told));
