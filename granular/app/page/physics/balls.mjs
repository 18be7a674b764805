// Real balls: from what each does on a floor to what two do to each other. Twin of granular/cases/balls.py.
import { dampingRatio, duration } from "./dashpot.mjs";
import { sqrt } from "./numbers.mjs";

const LENS = 0; // of the rules; the other is in series

const stiffnessOf = (mass, time, eps) => mass * (duration(dampingRatio(eps)) / time) ** 2;

// Stiffness and restitution of the floor contact and of the contact of the two balls.
export function contactsOf({ m1, r1, t1, e1, air1, m2, r2, t2, e2, air2, rule }) {
  const [k1, k2] = [stiffnessOf(m1, t1, e1), stiffnessOf(m2, t2, e2)], [soft1, soft2] = [1 / k1, 1 / k2];
  const lost = (1 - e1 * e1) * soft1 + (1 - e2 * e2) * soft2, between = sqrt(1 - lost / (soft1 + soft2));
  const patch = rule === LENS && air1 ? (soft1 * (r1 + r2)) / r2 : soft1;
  const softness = rule === LENS && air1 && air2 ? patch : patch + soft2;
  return { eps: [e1, between], k: [k1, 1 / softness] };
}

export const aloneOf = ({ m1, t1, e1 }) => ({ eps: [e1], k: [stiffnessOf(m1, t1, e1)] });
