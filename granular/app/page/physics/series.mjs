// Touching pairs move by power series in time: the coefficients of one step of h, for all pairs at once.
//
//   (n+1) ξ_(n+1) = h η_n,   (n+1) η_(n+1) = h (w_c F_(c-1) - (w_c + w_(c+1)) F_c + w_(c+1) F_(c+1))_n   (+ h pull at n = 0)
//
// Rows: x of the overlap ξ, e of its rate η, f of the force. The state a step starts from is kept apart: per pair ξ, η
// and the sum of PUSHES, EXACT (its φ = kξ + γη is exactly 0) and HELD (part of a pile at rest: ξ stays, and the ball
// above falls towards it as towards a floor). From it any step can be expanded again.
import { max, sqrt } from "./numbers.mjs";

export const ORDER = 20;
export const WIDTH = ORDER + 1;
const REACH = (51090942171709440000 * 1e-17) ** (1 / 21); // 21!
const SHARES = Float64Array.from({ length: WIDTH }, (_, j) => 1 / (j + 1));
export const PUSHES = 1;
export const EXACT = 2;
export const HELD = 4;

// All series of so many pairs share their tables: one is at work at a time, and none needs what it had.
const tables = new Map();

function tablesFor(m) {
  if (!tables.has(m)) {
    const [x, e, f, state, weight] = [m * WIDTH, m * WIDTH, m * WIDTH, 3 * m, m].map((size) => new Float64Array(size));
    tables.set(m, { x, e, f, state, weight, held: null });
  }
  return tables.get(m);
}

export class Series {
  constructor(pairs) {
    const constants = ["lower", "inverse", "upper", "k", "gamma", "pull"];
    for (const name of constants) this[name] = Float64Array.from(pairs, (p) => p[name]);
    this.m = pairs.length;
    this.tables = tablesFor(this.m);
    [this.kept, this.used] = [new Float64Array(0), 0];
    Object.assign(this, this.tables);
  }

  pushes(c) {
    return c >= 0 && c < this.m && (this.state[2 * this.m + c] & PUSHES) > 0;
  }

  // A step that leaves (λh)^21/21! = 1e-17, where λ = ½ (b + √(b² + 4a)), a and b the largest absolute row sums of M⁻¹K
  // and M⁻¹C over the pairs that push.
  longestStep() {
    const { m, lower, inverse, upper, k, gamma } = this;
    let a = 0, b = 0;
    for (let c = 0; c < m; c++) {
      if (!this.pushes(c)) continue;
      let stiff = inverse[c] * k[c], damp = inverse[c] * gamma[c];
      if (this.pushes(c - 1)) [stiff, damp] = [stiff + lower[c] * k[c - 1], damp + lower[c] * gamma[c - 1]];
      if (this.pushes(c + 1)) [stiff, damp] = [stiff + upper[c] * k[c + 1], damp + upper[c] * gamma[c + 1]];
      a = max(a, stiff);
      b = max(b, damp);
    }
    return REACH / (0.5 * (b + sqrt(b * b + 4 * a)));
  }

  expand(h) {
    const { m, x, e, f, k, gamma, lower, inverse, upper, state, weight } = this;
    this.tables.held = null;
    for (let c = 0; c < m; c++) [x[c * WIDTH], e[c * WIDTH]] = [state[c], state[m + c]];
    for (let n = 0; n <= ORDER; n++) {
      if (n < 2) this.weigh(n);
      const share = h / (n + 1);
      let i = n, below = 0, force = weight[0] * (k[0] * x[i] + gamma[0] * e[i]);
      for (let c = 0; c < m; c++, i += WIDTH) {
        const j = i + WIDTH, above = c + 1 < m ? weight[c + 1] * (k[c + 1] * x[j] + gamma[c + 1] * e[j]) : 0;
        f[i] = force;
        if (n < ORDER) {
          x[i + 1] = share * e[i];
          e[i + 1] = share * (lower[c] * below - inverse[c] * force + upper[c] * above);
        }
        below = force;
        force = above;
      }
      if (n === 0) this.fall(h);
    }
  }

  isHeld(c) {
    return (this.state[2 * this.m + c] & HELD) > 0;
  }

  fall(h) {
    const { m, k, x, e, f, pull } = this;
    for (let c = 0; c < m; c++) {
      if (this.isHeld(c)) f[c * WIDTH] = k[c] * x[c * WIDTH];
      else e[c * WIDTH + 1] += h * (c > 0 && this.isHeld(c - 1) ? pull[0] : pull[c]);
    }
  }

  // 1 for pairs whose φ is a force, 0 for the others, and at order 0 for those whose φ begins at exactly 0.
  weigh(n) {
    const { m, state, weight } = this;
    for (let c = 0; c < m; c++) weight[c] = state[2 * m + c] === PUSHES || (n > 0 && this.pushes(c)) ? 1 : 0;
  }

  // Coefficients of φ of a pair that does not push.
  phi(c, row) {
    const { m, x, e, k, gamma, state } = this;
    for (let n = 0, i = c * WIDTH; n <= ORDER; n++, i++) row[n] = k[c] * x[i] + gamma[c] * e[i];
    if (state[2 * m + c] & EXACT) row[0] = 0;
    return row;
  }

  // The force that pair c has where a kept step begins.
  firstForce({ at }, c) {
    const { kept, m } = this;
    const what = kept[at + 2 * m + c];
    return what === PUSHES || what === HELD ? this.k[c] * kept[at + c] + this.gamma[c] * kept[at + m + c] : 0;
  }

  at(name, c, tau) {
    const rows = this[name];
    let total = 0;
    for (let i = c * WIDTH + ORDER; i >= c * WIDTH; i--) total = total * tau + rows[i];
    return total;
  }

  impulse(c, h, tau) {
    let total = 0;
    for (let j = ORDER, i = c * WIDTH + ORDER; j >= 0; j--, i--) total = total * tau + this.f[i] * SHARES[j];
    return h * total * tau;
  }

  // For drawing: the state a step starts from is kept, all in one growing table; returns where.
  keep() {
    const { state, used } = this;
    if (used + state.length > this.kept.length) {
      const larger = new Float64Array(2 * this.kept.length + 64 * state.length);
      larger.set(this.kept);
      this.kept = larger;
    }
    this.kept.set(state, used);
    this.used += state.length;
    return used;
  }

  // A step that has been kept, expanded once more unless it is the one held.
  recall(piece) {
    if (this.tables.held === piece) return;
    this.state.set(this.kept.subarray(piece.at, piece.at + this.state.length));
    this.expand(piece.h);
    this.tables.held = piece;
  }
}
