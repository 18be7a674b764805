// The lesson's picture for the board, without words but the two models' names: three speeds one after the other, and the
// floor's push in time, with the part during which the light ball presses, too.
import { svg } from "../shell/dom.mjs";
import { plain } from "./words.mjs";
import { min } from "../physics/numbers.mjs";

const GROUND = 185, HEAVY = 30, LIGHT = 11, HIGH = 46;
const BEATS = [[26, 26, -1, -1, "v", "v"], [0, 8, 1, -1, "v", "v"], [12, 38, 1, 3, "v", "3v"]]; // gaps below, up or down, speeds

const line = (d, more = {}) => svg("path", { d, fill: "none", stroke: "#000", "stroke-width": 1.6, ...more });
const note = (x, y, words, more = {}) => svg("text", { x, y, "font-size": 14, ...more }, ...[words].flat());

function arrow(x, y, ways) {
  const tip = y - 16 * ways, back = 5 * Math.sign(ways);
  return line(`M${x} ${y}V${tip}m-4 ${back}l4 ${-back}l4 ${back}`);
}

function balls([below, between, heavy, light, v, w], i) {
  const x = 50 + 112 * i, low = GROUND - below - HEAVY, high = low - HEAVY - between - LIGHT;
  return [
    line(`M${x - 40} ${GROUND}h92`, { "stroke-width": 3 }), ...[[low, HEAVY], [high, LIGHT]].map(([cy, r]) => svg("circle", { cx: x, cy, r, fill: "none", stroke: "#000", "stroke-width": 1.6 })),
    arrow(x + HEAVY + 9, low + 8 * heavy, heavy), note(x + HEAVY + 15, low + 5, v), arrow(x + LIGHT + 9, high + 8 * Math.sign(light), light), note(x + LIGHT + 15, high + 5, w),
  ];
}

// The floor's push, and that of the light ball from `late` on; dark where both press.
function arrows(y, late, words) {
  const x = 400, long = 110, arch = (from, width, height) => `M${from} ${y}q${width / 2} ${-2 * height} ${width} 0`;
  const under = Array.from({ length: 23 }, (_, i) => 5 * i).filter((t) => t >= late).map((t) => `L${x + t} ${(y - 4 * HIGH * (t / long) * (1 - t / long)).toFixed(1)}`);
  return [
    svg("path", { d: `M${x + min(late, long)} ${y}${under.join("")}z`, fill: "#aaa" }),
    line(arch(x, long, HIGH)), line(arch(x + late, 90, 24), { "stroke-dasharray": "4 3" }), line(`M${x} ${y - 60}v60h236m-6 -4l6 4l-6 4`),
    note(x - 14, y - 48, "F"), note(x + 240, y + 4, "t"), note(x + 124, y - 44, words),
  ];
}

const reach = (sign) => [`Δh ${sign} v t`, svg("tspan", { dy: 4, "font-size": 10 }, "c")];

export function board() {
  const [hard, soft] = ["hard-spheres", "soft-spheres"].map((key) => plain(key));
  return svg("svg", { class: "board", viewBox: "0 0 660 196", role: "img", "aria-label": `${hard}, ${soft}` },
    note(10, 14, hard, { "font-weight": 600 }), ...BEATS.flatMap(balls), note(386, 14, soft, { "font-weight": 600 }),
    ...arrows(90, 35, reach("<")), ...arrows(182, 130, reach(">")));
}
