// The state of the page in its link: #scene=three-balls&gap=0.0001&… , and back.
import { cleaned, refused, SETUPS } from "../physics/setups.mjs";

const QUIET = 250; // ms without a change before the link follows: browsers limit how often it may change

export function read(hash) {
  const given = Object.fromEntries(new URLSearchParams(hash.replace(/^#/, "")));
  const name = Object.hasOwn(SETUPS, given.scene ?? "") ? given.scene : Object.keys(SETUPS)[0];
  const told = [...(given.scene === undefined || name === given.scene ? [] : [`There is no scene “${given.scene}” here.`]), ...refused(name, given)];
  return { name, values: cleaned(name, given), told: told.join(" "), at: Math.min(1, Math.max(0, Number(given.at) || 0)), predict: given.predict === "1" };
}

export function written({ name, values, at, predict }) {
  const pairs = { scene: name, ...values, ...(at > 0 ? { at: Number(at.toFixed(3)) } : {}), ...(predict ? { predict: 1 } : {}) };
  return `#${new URLSearchParams(pairs)}`;
}

let waiting = 0;

export function follow(state) {
  clearTimeout(waiting);
  waiting = setTimeout(() => write(state()), QUIET);
}

// Inside an iframe's srcdoc there is no link of one's own: addresses are taken to be the host's.
export const hasLink = () => location.protocol !== "about:";

export function write(state) {
  const hash = written(state);
  if (hash === location.hash || !hasLink()) return;
  try {
    history.replaceState(null, "", hash);
  } catch {
    location.replace(hash); // some browsers allow no history on file://
  }
}
