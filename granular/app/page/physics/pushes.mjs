// Pushes that are heard apart: collisions of a hard run one by one, soft contacts of neighbours that overlap as one.
import { approach, isOver } from "./measures.mjs";
import { abs, max } from "./numbers.mjs";

// When each begins, and the fastest approach in it; a contact that has not ended is heard at its onset alone.
export function pushesOf(engine, contacts) {
  const pushes = [];
  for (const one of [...contacts].sort((a, b) => a.begin - b.begin)) {
    const { begin, pair } = one, speed = approach(one), end = engine === "soft" && isOver(one) ? one.end : begin;
    const push = pushes.find((other) => begin < other.end && other.pairs.some((next) => abs(next - pair) < 2));
    if (push) Object.assign(push, { end: max(push.end, end), speed: max(push.speed, speed), pairs: [...push.pairs, pair] });
    else pushes.push({ begin, end, speed, pairs: [pair] });
  }
  return pushes;
}
