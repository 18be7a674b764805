// Curves over time: positions, the distance of one pair, energy.
import { extent, roomy } from "./picture.mjs";

const LOOKS = { hard: [6, 4], soft: [] }, FEW_ROWS = 12, DASHED = 10; // bodies, beyond which dashes confuse

// Rows of a run within a span of time, and the next ones outside.
function rows({ time }, [t0, t1]) {
  let first = 0, last = time.length - 1;
  while (first + 1 < time.length && time[first + 1] <= t0) first++;
  while (last > first && time[last - 1] >= t1) last--;
  return [first, last];
}

// Between rows nothing is known of soft spheres, so those few that are seen are marked and told.
function few(run, span) {
  const [first, last] = rows(run, span);
  return run.engine === "soft" && last - first < FEW_ROWS ? "; only the dots were recorded" : "";
}

function* values(run, span, of) {
  const [first, last] = rows(run, span);
  for (let r = first; r <= last; r++) yield* of(run, r);
}

const positions = ({ path, width }, r) => path.subarray(r * width, (r + 1) * width);
const distance = (pair) => ({ path, width }, r) => [path[r * width + pair + 1] - path[r * width + pair]];
const energy = (run, r) => [run.energy[r]];

function draw(picture, run, of, strong = true) {
  const [first, last] = rows(run, picture.xs), n = of(run, 0).length, stride = Math.max(1, Math.ceil(n / 250));
  picture.inside((pen) => {
    pen.globalAlpha = strong ? (n > 60 ? 0.55 : 0.95) : 0.35;
    for (let i = 0; i < n; i += stride) {
      picture.stroke(`--${run.engine}`, n > 60 ? 0.6 : 1.5, () => {
        for (let r = first; r <= last; r++) pen.lineTo(picture.x(run.time[r]), picture.y(of(run, r)[i]));
      }, n > DASHED ? [] : LOOKS[run.engine]);
    }
    if (last - first < FEW_ROWS) for (let i = 0; i < n; i += stride) for (let r = first; r <= last; r++) dot(pen, picture.x(run.time[r]), picture.y(of(run, r)[i]));
  });
  return stride;
}

function dot(pen, x, y) {
  pen.beginPath();
  pen.arc(x, y, 2.2, 0, 7);
  Object.assign(pen, { fillStyle: pen.strokeStyle }).fill();
}

export function drawPositions(picture, run, runs, span) {
  picture.begin(span, roomy(extent(runs.flatMap((one) => extent(values(one, span, positions))))));
  picture.timeAxis();
  picture.leftAxis("m", "position, radii taken out");
  const stride = draw(picture, run, positions);
  picture.keep();
  return `where lines meet, balls touch${stride > 1 ? "; one line in " + stride + " is drawn" : ""}${few(run, span)}`;
}

// On a scale of its own: what happens between the first and the last contact of the pair, so that hops can be seen.
export function drawDistance(picture, run, runs, span, pair) {
  const met = runs.map((one) => metWithin(one, span, pair)).filter(([a, b]) => b > a), of = distance(pair);
  const within = met.length ? [Math.min(...met.map(([a]) => a)), Math.max(...met.map(([, b]) => b))] : span;
  const soft = runs.filter((one) => one.engine === "soft"), from = met.length && soft.length ? soft : runs;
  picture.begin(span, roomy(extent([0, ...from.flatMap((one) => extent(values(one, within, of)))]), 0.12));
  picture.timeAxis();
  picture.leftAxis("m", "distance of the surfaces");
  picture.inside((pen) => picture.stroke("--muted", 1, () => (pen.moveTo(picture.l, picture.y(0)), pen.lineTo(picture.r, picture.y(0)))));
  draw(picture, run, of);
  picture.keep();
  return `0 is touching, below 0 the balls overlap; scale set by what happens between the first and the last contact of the pair${few(run, span)}`;
}

function metWithin({ contacts }, [t0, t1], pair) {
  const here = [...contacts.pair.keys()].filter((i) => contacts.pair[i] === pair && contacts.end[i] >= t0 && contacts.begin[i] <= t1);
  return [Math.min(...here.map((i) => contacts.begin[i])), Math.max(...here.map((i) => contacts.end[i]))];
}

export function drawEnergy(picture, run, runs, span) {
  const [low, high] = extent(runs.flatMap((one) => extent(values(one, span, energy))));
  const flat = high - low < 1e-6 * Math.abs(high);
  picture.begin(span, roomy(flat || low > 0 ? [Math.min(0, low), high || 1] : [low, high]));
  picture.timeAxis();
  picture.leftAxis("J", "energy");
  for (const one of runs) if (one !== run) draw(picture, one, energy, false);
  draw(picture, run, energy);
  picture.keep();
}
