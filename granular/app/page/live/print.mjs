// On paper the film stands at its last picture, where every ball is at its highest point, before a guess at its first; what
// is folded is open; and where the page has an address for others, its code stands beside it.
import { $, svg } from "../shell/dom.mjs";
import { codeOf } from "./qr.mjs";

export function printsWell(page) {
  let before = 0, folded = [];
  addEventListener("beforeprint", () => {
    before = page.clock.share;
    page.clock.pause();
    page.later.flush();
    page.clock.go(1);
    folded = [...document.querySelectorAll(".sliders details:not([open])")];
    folded.forEach((one) => (one.open = true));
    $(".code-box").replaceChildren(...code(location.href));
  });
  addEventListener("afterprint", () => {
    page.clock.go(before);
    folded.forEach((one) => (one.open = false));
    $(".code-box").replaceChildren();
  });
}

// A drawing, or none where nobody else could follow the link.
export function code(link) {
  const rows = /^https?:/.test(link) ? codeOf(link) : null;
  if (!rows) return [];
  const dark = rows.flatMap((row, r) => row.map((bit, c) => (bit ? `M${c} ${r}h1v1h-1z` : ""))).join("");
  return [svg("svg", { class: "code", viewBox: `-4 -4 ${rows.length + 8} ${rows.length + 8}`, role: "img", "aria-label": link }, svg("path", { d: dark, "shape-rendering": "crispEdges" }))];
}
