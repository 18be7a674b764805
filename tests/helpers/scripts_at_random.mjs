// Run cases [first module, second module, script] from the standard input, and print the output of both forms of each.
import { readFileSync } from "node:fs";

globalThis.innerWidth = 800;
globalThis.devicePixelRatio = 2;

const address = (text) => `data:text/javascript,${encodeURIComponent(text)}`;

async function output(text) {
  const lines = [];
  globalThis.tell = (...values) => lines.push(JSON.stringify(values));
  try {
    await import(address(text));
  } catch (error) {
    lines.push(error instanceof Error ? error.name : "thrown");
  }
  return lines;
}

const told = [];
for (const [number, [first, second, script]] of JSON.parse(readFileSync(0, "utf8")).entries()) {
  const modules = second.replace('"./first.mjs"', `"${address(`${first}// ${number}`)}"`);
  told.push([await output(`${modules.startsWith("import") ? "" : first}${modules}// ${number}`), await output(`${script}\n// ${number}`)]);
}
console.log(JSON.stringify(told));
