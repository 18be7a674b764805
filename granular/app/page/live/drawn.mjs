// Balls as they look: each a disc of radius 1 in its colours, with seams, felt or dimples, light from above and shadow below.
const FACES = {
  basketball: ["#e8843c", `<path class="seam" stroke="#3a1a08" d="M-1 .04H1M.05-1Q-.06 0 .05 1M-.74-.68Q-.12 0-.74 .68M.74-.68Q.12 0 .74 .68"/>`],
  football: ["#f4f4f0", `<path fill="#22262b" d="M0-.36L.34-.11L.21 .29H-.21L-.34-.11zM-.3-.95Q0-.72 .3-.95L.2-1.1H-.2zM.98-.22Q.72-.1 .78 .3L1.1 .2zM-.98-.22Q-.72-.1-.78 .3L-1.1 .2zM.3 .74Q.5 .6 .72 .72L.5 1zM-.3 .74Q-.5 .6-.72 .72L-.5 1z"/><path class="seam thin" stroke="#555" d="M0-.36V-.8M.34-.11L.77-.1M.21 .29L.45 .68M-.21 .29L-.45 .68M-.34-.11L-.77-.1"/>`],
  volleyball: ["#f2ecd8", `<path fill="#2d62a8" d="M-.2-.98Q-.9-.2-.6 .8L-1 .5V-.5z"/><path fill="#e9bb2d" d="M.3-.96Q1-.3 .96 .3Q.5-.3-.1-.4z"/><path class="seam thin" stroke="#7d745c" d="M-.2-.98Q-.5 0 .2 .98M-.1-.4Q.6-.2 .96 .3M-.34 .1Q.3 .1 .8 .6"/>`],
  "tennis-ball": ["#d3e04a", `<circle r=".96" class="felt"/><path class="seam wide" stroke="#fbfdf0" d="M-.98-.3Q-.1-.42-.24 .97M.98 .3Q.1 .42 .24-.97"/>`],
  superball: ["#c2378f", `<path fill="#f4b942" d="M-.95-.2Q-.2-.7 .1 0Q.3 .6 .95 .3Q.6 .9 0 .8Q-.2 .2-.95-.2z" opacity=".85"/><path fill="#4ab3c9" d="M.2-.96Q-.1-.4 .5-.2Q.9-.1 .97-.1Q.8-.8 .2-.96z" opacity=".8"/>`],
  "golf-ball": ["#f7f7f4", `<circle r="1" fill="url(#dimples)"/>`],
  "table-tennis-ball": ["#fbf6e8", `<path class="seam thin" stroke="#d9cdb0" d="M-.97 .22Q0 .5 .97 .22"/><path fill="#c8442e" d="M-.2-.2h.4v.1h-.4zM-.12-.05h.24v.08h-.24z"/>`],
  "steel-ball": ["#aab2ba", `<path fill="#eef3f7" d="M-.92-.36Q0-.72 .92-.36Q.6-.1 0-.14T-.92-.36z" opacity=".9"/><path fill="#3d464f" d="M-.98 .12Q0 .34 .98 .12Q.8 .56 0 .5T-.98 .12z" opacity=".75"/>`],
  "glass-marble": ["#9fd6cf", `<path fill="#1f6f8b" d="M-.6-.5Q.2-.5 0 .1T.6 .6Q-.1 .7-.2 .1T-.6-.5z" opacity=".8"/><path fill="#d8672c" d="M-.2-.7Q.5-.3 .25 .15T.3 .85Q-.1 .4 .05 .05T-.2-.7z" opacity=".7"/>`],
};
const SAME_LOOK = { "small-superball": "superball", "small-steel-ball": "steel-ball" };
const PLAIN = ["#8fa3b5", `<path fill="#6f8598" d="M-1-.22H1V.22H-1z"/>`];

// Colours that all pictures share; light and shadow are two veils over any ball.
const SHARED = `<clipPath id="disc"><circle r="1"/></clipPath><radialGradient id="shade" cx=".38" cy=".3" r=".75"><stop offset=".45" stop-opacity="0"/><stop offset="1" stop-opacity=".5"/></radialGradient>
<radialGradient id="shine" cx=".34" cy=".26" r=".34"><stop offset="0" stop-color="#fff" stop-opacity=".85"/><stop offset="1" stop-color="#fff" stop-opacity="0"/></radialGradient>
<radialGradient id="ground"><stop offset="0" stop-opacity=".42"/><stop offset="1" stop-opacity="0"/></radialGradient>
<pattern id="dimples" width=".22" height=".22" patternUnits="userSpaceOnUse" patternTransform="rotate(20)"><circle cx=".06" cy=".06" r=".058" fill="#c9cac4"/><circle cx=".17" cy=".17" r=".058" fill="#c9cac4"/></pattern>`;

export function shareColours() {
  document.body.insertAdjacentHTML("beforeend", `<svg class="shared" aria-hidden="true"><defs>${SHARED}</defs></svg>`);
}

// The inside of a group: a ball of radius 1.
export function face(kind) {
  const [colour, marks] = FACES[SAME_LOOK[kind] ?? kind] ?? PLAIN;
  return `<circle r="1" fill="${colour}"/><g clip-path="url(#disc)">${marks}</g><circle r="1" fill="url(#shade)"/><circle r="1" fill="url(#shine)"/><circle r="1" class="rim"/>`;
}
