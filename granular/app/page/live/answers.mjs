// The numbers of the lesson sheets, from the page's own physics.
import { quantity, digits } from "../shell/format.mjs";
import { compareEngines } from "../physics/outcome.mjs";
import { reachOf, reasonOf } from "../physics/reason.mjs";
import { cleaned, contactsIn, sceneOf, SETUPS } from "../physics/setups.mjs";
import { screenOf, startOf } from "./story.mjs";
import { plain } from "./words.mjs";
import { round, sqrt } from "../physics/numbers.mjs";

const PAIRS = "real-balls", HALVINGS = 8, EXIT_GAP = 0.02; // m

const reportOf = (name, values) => {
  const { eps, k } = contactsIn(name, values);
  return compareEngines(sceneOf(name, values), eps, k);
};
const risesIn = (report, name = PAIRS) => [report.hard, report.soft].map(SETUPS[name].measure);
const risesFrom = (values) => risesIn(reportOf(PAIRS, values));

// The smallest gap with the answer yes, below that at which no contacts overlap.
function enoughGap(values, report) {
  let low = values.gap, high = reachOf(report);
  for (let i = 0; i < HALVINGS; i++) {
    const gap = (low + high) / 2;
    if (reportOf(PAIRS, { ...values, gap }).answer === "yes") high = gap;
    else low = gap;
  }
  return high;
}

// By task: what is to be filled in; of the drawings, what they show.
export function answers() {
  const { values } = startOf(4), near = reportOf(PAIRS, values), reason = reasonOf(near), [hard, soft] = risesIn(near);
  const alone = startOf(2), steps = screenOf(3).presets(), from = cleaned(PAIRS, values);
  const [nine, seven, four] = ["textbook", "masses", "losses"].map((name) => risesFrom({ ...from, ...steps[name] })[0]);
  const touching = startOf(6).values.gap, speed = sqrt(2 * 9.81 * values.height), ms = (t) => digits(1000 * t, 2);
  const table = Object.entries(screenOf(6).presets()).map(([name, pair]) => [name, [1, 2].flatMap((bounces) => risesFrom({ ...pair, bounces }))]);
  return {
    hard, soft, reason, table, steps: [nine, seven, four],
    1: { guess: plain("pack-own"), hard: digits(hard), soft: digits(soft), own: plain("pack-own") },
    2: { drop: quantity(alone.values.height, "m"), height: digits(risesIn(reportOf(alone.name, alone.values), alone.name)[0] * alone.values.height, 2), share: round(100 * values.e1), time: ms(values.t1) },
    3: { up: "v", down: "v", meet: "2v", leave: "3v", nine: round(nine), seven: round(seven), four: round(four) },
    4: { share: round(100 * reason.share) },
    5: { drop: quantity(values.height, "m"), gap: Math.ceil(1000 * enoughGap(values, near)), v: digits(speed, 2), time: ms(values.t1), reach: ms(speed * values.t1) },
    7: { gap: quantity(EXIT_GAP, "m"), far: digits(risesFrom({ ...values, gap: EXIT_GAP })[1]), near: digits(risesFrom({ ...values, gap: touching })[1]) },
  };
}
