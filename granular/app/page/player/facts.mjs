// What a recorded run was made of and came to, in numbers; what was left out; its contacts as CSV.
import { $, csv, h, save } from "../shell/dom.mjs";
import { digits, quantity } from "../shell/format.mjs";

export function showFacts(runs) {
  const row = (name, value) => h("tr", {}, h("th", { scope: "row" }, name), ...runs.map((run) => h("td", { class: run.engine }, value(run))));
  const named = (of, unit, write) => [...new Set(runs.flatMap((run) => run[of].map(([name]) => name)))]
    .map((name) => row(`${name}${unit}`, (run) => write(new Map(run[of]).get(name))));
  $(".facts").replaceChildren(h("tbody", {},
    row("run", (r) => r.name), row("engine", (r) => (r.engine === "hard" ? "event-driven" : "Newton, contact force")),
    ...named("about", "", (said) => said ?? "–"),
    row("span of time", (r) => quantity(r.span[1] - r.span[0], "s")), row("contacts", (r) => String(r.whole.contacts)),
    row("energy at the start, J", (r) => digits(r.energy[0], 5)), row("energy at the end, J", (r) => digits(r.energy[r.energy.length - 1], 5)),
    ...named("account", ", J", (joule) => digits(joule ?? 0, 5)),
    row("ended because", (r) => r.message)));
  $(".honest").textContent = runs.map(leftOut).join(" ");
  $(".csv-buttons").replaceChildren(...runs.map((run) => h("button", { type: "button", class: "csv", onclick: () => saveContacts(run) }, `Save contacts of ${run.name} as CSV`)));
}

// What was left out when the run was embedded, and what was not recorded in the first place.
function leftOut({ name, status, whole, time, contacts, width, span }) {
  const parts = [[whole.rows - time.length, whole.rows, "row"], [whole.contacts - contacts.pair.length, whole.contacts, "contact"], [whole.bodies - width, whole.bodies, "body"]];
  const gone = parts.filter(([less]) => less > 0).map(([less, all, noun]) => `${less} of ${noun === "body" ? all + " bodies" : plural(all, noun)}`);
  const more = ["collapse", "bounded"].includes(status) ? `with t_end = ${digits(span[1], 6)}, where it ended, and samples=2000` : 'with samples=2000, or samples="contacts" for the hops between contacts,';
  const few = time.length < 20 && span[1] > span[0] ? ` Only ${plural(whole.rows, "row")} of positions were recorded; run it ${more} for smooth lines.` : "";
  const between = time.length > whole.rows ? ` ${plural(whole.rows, "row")} of positions were recorded; those at and between contacts follow from them.` : "";
  const instant = span[1] > span[0] ? "" : " All of it is at one instant.";
  return `${name}: ${gone.length ? "left out evenly, to keep this file small: " + gone.join(", ") : "nothing is left out"}.${few}${between}${instant}`;
}

function saveContacts({ name, contacts: c }) {
  const rows = [...c.pair].map((pair, i) => [pair, c.begin[i], c.end[i], c.before[i], c.after[i], c.impulse[i]]);
  save(`${name}-contacts.csv`, "text/csv", csv([["pair", "begin, s", "end, s", "rate before, m/s", "rate after, m/s", "impulse, N s"], ...rows]));
}

const plural = (n, noun) => `${n} ${noun}${n === 1 ? "" : "s"}`;
