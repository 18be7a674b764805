// The clipped linear dashpot F = kξ + γξ̇ ≥ 0: its restitution, duration, and the inverse, exact for every damping.
//
//   f(ζ) = acos ζ / √(1-ζ²)  (ζ < 1),  acosh ζ / √(ζ²-1)  (ζ > 1);   ω₀ t_c = 2 f,   ε = exp(-2 ζ f)
import { abs, sqrt } from "./numbers.mjs";

export function dampingRatio(eps) {
  const length = 0.5 * abs(Math.log(eps));
  if (length === 1) return 1;
  if (length > 1) return Math.cosh(newton(coth, length, length));
  if (length > 0.5) return Math.cos(newton(cot, sqrt(3 * (1 - length)), length));
  return Math.sin(newton(cotComplement, (2 * length) / Math.PI, length));
}

export function duration(zeta) {
  const root = sqrt(abs(1 - zeta)) * sqrt(1 + zeta);
  if (root === 0) return 2;
  return (2 * (zeta < 1 ? Math.atan2(root, zeta) : Math.asinh(root))) / root;
}

function newton(curve, y, target) {
  for (let pass = 0; pass < 100; pass++) {
    const [value, slope] = curve(y);
    const step = value !== target ? (value - target) / slope : 0;
    y -= step;
    if (abs(step) <= 1e-16 * abs(y)) break;
  }
  return y;
}

const coth = (y) => [y / Math.tanh(y), 1 / Math.tanh(y) - y / Math.sinh(y) ** 2];
const cot = (y) => [y / Math.tan(y), 1 / Math.tan(y) - y / Math.sin(y) ** 2];
const cotComplement = (z) => {
  const y = 0.5 * Math.PI - z, t = Math.tan(z);
  return [y * t, y * (1 + t * t) - t];
};
