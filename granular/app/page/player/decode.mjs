// Embedded runs: base64 columns back to typed arrays.

const KINDS = { f4: Float32Array, f8: Float64Array, i4: Int32Array, u2: Uint16Array, i1: Int8Array };

function unpack(base64, kind) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new KINDS[kind](bytes.buffer);
}

export function decoded(raw) {
  const { contacts: c, map, field } = raw, begin = unpack(c.begin, "f8");
  const run = {
    ...raw, bodies: unpack(raw.bodies, "i4"), radius: unpack(raw.radius, "f4"), time: unpack(raw.time, "f8"),
    offset: unpack(raw.offset, "f4"), path: unpack(raw.path, "f4"), energy: unpack(raw.energy, "f8"),
    contacts: {
      pair: unpack(c.pair, "i4"), begin, end: c.end === null ? begin : unpack(c.end, "f8"), before: unpack(c.before, "f4"),
      after: unpack(c.after, "f4"), impulse: unpack(c.impulse, "f4"),
    },
    map: map && { ...map, counts: unpack(map.counts, "u2") },
    field: { ...field, time: unpack(field.time, "f8"), values: unpack(field.values, "i1") },
  };
  run.width = run.bodies.length;
  return run;
}

// Positions at any time between the rows kept: straight lines. Displacements and overlaps can be drawn `times` larger than balls.
export function positionsAt(run, t, out, times = 1) {
  const { time, width, path, offset } = run;
  let low = 0, high = time.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle] <= t) low = middle;
    else high = middle;
  }
  const step = time[high] - time[low], share = step > 0 ? Math.min(1, Math.max(0, (t - time[low]) / step)) : 0;
  for (let i = 0; i < width; i++) out[i] = offset[i] + times * ((1 - share) * path[low * width + i] + share * path[high * width + i]);
  return out;
}

// The contacts kept that are under way at t, or for hard spheres have just been.
export function underWay({ contacts }, t, glow) {
  const found = [];
  for (let i = 0; i < contacts.pair.length; i++) {
    if (contacts.begin[i] > t) break;
    if (contacts.end[i] + glow >= t) found.push(i);
  }
  return found;
}
