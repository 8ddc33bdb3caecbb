// The samples of the last minute at full rate, and their decimation for drawing: minimum and maximum
// of each stretch, so that no spike is lost.

export const KEPT = 120000;

export class Ring {
  constructor() { this.clear(0); }

  clear(rows) {
    this.rows = rows;
    this.values = new Float64Array(rows * KEPT);
    this.end = this.kept = 0;
  }

  // A frame as stagectl/console/samples.py packs it; what is missing before it is a gap.
  take(buffer) {
    const [version, axes, count] = new Uint32Array(buffer, 0, 3);
    const first = new DataView(buffer).getFloat64(16, true);
    const rows = axes ? 2 + 6 * axes : 0;
    if (version !== 1 || !count) return;
    if (rows !== this.rows || first < this.end - count || first - this.end >= KEPT) { this.clear(rows); this.end = first; }
    while (this.end < first) this.put(null, 0);
    const values = new Float64Array(buffer, 24);
    for (let k = this.end - first; k < count; k++) this.put(values, k, count);
  }

  put(values, k, count) {
    const at = this.end % KEPT;
    for (let row = 0; row < this.rows; row++) this.values[row * KEPT + at] = values ? values[row * count + k] : NaN;
    this.end++;
    this.kept = Math.min(KEPT, this.kept + 1);
  }

  get first() { return this.end - this.kept; }

  at(row, number) { return this.values[row * KEPT + (number % KEPT)]; }

  // Numbers [first, end) of `row`, in at most 2 * bins points; bins lie at fixed numbers, so a picture
  // that moves on does not flicker. Returns [numbers, values of each row].
  decimated(rows, first, end, bins) {
    const every = Math.max(1, Math.ceil((end - first) / bins));
    if (every <= 2) {
      const numbers = [];
      for (let n = first; n < end; n++) numbers.push(n);
      return [numbers, rows.map((row) => numbers.map((n) => shown(this.at(row, n))))];
    }
    const numbers = [], found = rows.map(() => []);
    for (let begin = Math.floor(first / every) * every; begin < end; begin += every) {
      const from = Math.max(begin, first), to = Math.min(begin + every, end);
      numbers.push(from, from + (to - from) / 2);
      rows.forEach((row, k) => {
        let low = NaN, high = NaN, lowAt = 0, highAt = 0;
        for (let n = from; n < to; n++) {
          const value = this.at(row, n);
          if (!(value >= low)) if (value === value) { low = value; lowAt = n; }
          if (!(value <= high)) if (value === value) { high = value; highAt = n; }
        }
        if (lowAt <= highAt) found[k].push(shown(low), shown(high));
        else found[k].push(shown(high), shown(low));
      });
    }
    return [numbers, found];
  }
}

const shown = (value) => (value === value ? value : null);
