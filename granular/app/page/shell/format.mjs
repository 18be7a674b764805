// Numbers for people: few digits, SI prefixes, a true minus sign.

let decimal = ".";

// The sign before decimals, as the reader's language has it.
export function writeDecimalsWith(sign) {
  decimal = sign;
}

const PREFIX = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];

export function digits(x, n = 3) {
  if (!Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  const text = size >= 1e6 || size < 1e-4 ? power(x, n) : String(Number(x.toPrecision(n)));
  return text.replace(/^-/, "−").replace(".", decimal);
}

const power = (x, n) => {
  const [mantissa, exponent] = x.toExponential(n - 1).split("e");
  return `${Number(mantissa)}·10${superscript(exponent.replace("+", ""))}`;
};

export const superscript = (text) => [...text].map((d) => (d === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[d])).join("");

// A quantity with its unit: 0.0001 m → 0.1 mm. Stiffness takes prefixes too: 50 MN/m; a mass below 1 kg is in g.
export function quantity(x, unit, n = 3) {
  if (!unit) return digits(x, n);
  if (unit === "kg") return Math.abs(x) < 1 ? quantity(1000 * x, "g", n) : `${digits(x, n)} kg`;
  if (x === 0) return `0 ${unit}`;
  if (!Number.isFinite(x)) return "–";
  const size = Math.abs(x) * (1 + 1e-12);
  if (size >= 0.1 && size < 1) return `${digits(x, n)} ${unit}`;
  const [factor, prefix] = PREFIX.find(([f]) => size >= f) ?? [1e-9, "n"];
  return `${digits(x / factor, n)} ${prefix}${unit}`;
}

// The unit of time or force that writes `span` with few digits: [factor, name].
export function unitFor(span, unit) {
  const [factor, prefix] = PREFIX.find(([f]) => span >= 2 * f) ?? [1e-9, "n"];
  return [factor, prefix + unit];
}

// A whole number, its thousands apart.
export const inThousands = (x) => String(Math.round(x)).replace(/\B(?=(\d{3})+$)/g, "\u00a0");
