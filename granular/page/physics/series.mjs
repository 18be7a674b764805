// Touching pairs move by power series in time: the coefficients of one step of h, for all pairs at once.
//
//   (n+1) ξ_(n+1) = h η_n,   (n+1) η_(n+1) = h (w_c F_(c-1) - (w_c + w_(c+1)) F_c + w_(c+1) F_(c+1))_n   (+ h pull at n = 0)
//
// Rows: x of the overlap ξ, e of its rate η, f of the force. The state a step starts from is kept apart: per pair ξ, η
// and 1 if it pushes, 2 if its φ = kξ + γη is exactly 0, 3 if both. From it any step can be expanded again.
export const ORDER = 20;
const WIDTH = ORDER + 1, REACH = (51090942171709440000 * 1e-17) ** (1 / 21); // 21!
export const [PUSHES, EXACT] = [1, 2];

export class Series {
  constructor(pairs) {
    const m = pairs.length, constants = ["lower", "inverse", "upper", "k", "gamma", "pull"];
    for (const name of constants) this[name] = Float64Array.from(pairs, (p) => p[name]);
    for (const name of ["x", "e", "f"]) this[name] = new Float64Array(m * WIDTH);
    Object.assign(this, { m, state: new Float64Array(3 * m), held: null });
  }

  row(name, c) {
    return this[name].subarray(c * WIDTH, (c + 1) * WIDTH);
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
      a = Math.max(a, stiff);
      b = Math.max(b, damp);
    }
    return REACH / (0.5 * (b + Math.sqrt(b * b + 4 * a)));
  }

  expand(h) {
    const { m, x, e, state, pull } = this;
    this.held = null;
    for (let c = 0; c < m; c++) [x[c * WIDTH], e[c * WIDTH]] = [state[c], state[m + c]];
    this.push(0);
    this.move(0, h);
    for (let c = 0; c < m; c++) e[c * WIDTH + 1] += h * pull[c];
    for (let n = 1; n < ORDER; n++) {
      this.push(n);
      this.move(n, h / (n + 1));
    }
    this.push(ORDER);
  }

  push(n) {
    const { m, x, e, f, k, gamma, state } = this;
    for (let c = 0, i = n; c < m; c++, i += WIDTH) {
      const kind = state[2 * m + c];
      f[i] = kind === PUSHES || (kind === 3 && n > 0) ? k[c] * x[i] + gamma[c] * e[i] : 0;
    }
  }

  move(n, share) {
    const { m, x, e, f, lower, inverse, upper } = this;
    let below = 0, force = f[n];
    for (let c = 0, i = n; c < m; c++, i += WIDTH) {
      const above = c + 1 < m ? f[i + WIDTH] : 0;
      x[i + 1] = share * e[i];
      e[i + 1] = share * (lower[c] * below - inverse[c] * force + upper[c] * above);
      below = force;
      force = above;
    }
  }

  // Coefficients of φ of a pair that does not push.
  phi(c, row) {
    const { m, x, e, k, gamma, state } = this;
    for (let n = 0, i = c * WIDTH; n <= ORDER; n++, i++) row[n] = k[c] * x[i] + gamma[c] * e[i];
    if (state[2 * m + c] & EXACT) row[0] = 0;
    return row;
  }

  at(name, c, tau) {
    const rows = this[name];
    let total = 0;
    for (let i = c * WIDTH + ORDER; i >= c * WIDTH; i--) total = total * tau + rows[i];
    return total;
  }

  impulse(c, h, tau) {
    let total = 0;
    for (let j = ORDER, i = c * WIDTH + ORDER; j >= 0; j--, i--) total = total * tau + this.f[i] / (j + 1);
    return h * total * tau;
  }

  // For drawing: a step that has been kept, expanded once more unless it is the one held.
  recall(piece) {
    if (this.held === piece) return;
    this.state.set(piece.state);
    this.expand(piece.h);
    this.held = piece;
  }
}
