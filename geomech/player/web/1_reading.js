"use strict";
// Reads what packing.py has written: deflated bytes in base 64, arrays byte by byte.

const HALF = (() => {  // 16-bit floating-point numbers by their bits
  const table = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, fraction = bits & 1023;
    table[bits] = exponent === 31 ? (fraction ? NaN : sign * Infinity)
      : exponent === 0 ? sign * fraction * 2 ** -24 : sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
  }
  return table;
})();
const WIDTH = { q: 2, h: 2, f: 4, B: 1, H: 2, I: 4 };

async function inflate(text) {
  const binary = atob(text), bytes = new Uint8Array(binary.length);
  for (let k = 0; k < binary.length; k++) bytes[k] = binary.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Arrays of one record, each made when it is first asked for.
class Arrays {
  constructor(record, bytes) { this.index = record.arrays; this.bytes = bytes; this.made = new Map(); }
  static async of(record) { return new Arrays(record, await inflate(record.data)); }
  has(name) { return name in this.index; }
  get(name) {
    if (!this.made.has(name)) this.made.set(name, this.has(name) ? this.decode(name) : null);
    return this.made.get(name);
  }
  decode(name) {
    const [kind, offset, count, factor, shift] = this.index[name], width = WIDTH[kind];
    const plain = new Uint8Array(count * width);
    for (let b = 0; b < width; b++)
      for (let k = 0, at = offset + b * count; k < count; k++) plain[k * width + b] = this.bytes[at + k];
    if (kind === "B") return plain;
    if (kind === "H") return new Uint16Array(plain.buffer);
    if (kind === "I") return new Uint32Array(plain.buffer);
    if (kind === "f") return new Float32Array(plain.buffer);
    const coded = new Uint16Array(plain.buffer), values = new Float64Array(count);
    if (kind === "h") for (let k = 0; k < count; k++) values[k] = HALF[coded[k]] * factor;
    else for (let k = 0; k < count; k++) values[k] = coded[k] === 65535 ? NaN : coded[k] * factor + shift;
    return values;
  }
}

// Triangles that stand for several cycles. Which block, by its place in ``block``, each point belongs to.
class Mesh {
  constructor(arrays) {
    this.arrays = arrays;
    for (const name of ["x", "y", "triangles", "owner", "corners", "starts", "loop_block", "block", "material",
      "fixed", "edges"]) this[name] = arrays.get(name);
    const n = this.x.length;
    this.ofPoint = new Uint32Array(n);
    for (let t = 0; t < this.owner.length; t++)
      for (let c = 0; c < 3; c++) this.ofPoint[this.triangles[3 * t + c]] = this.owner[t];
    if (this.block) this.place = new Map(Array.from(this.block, (id, k) => [id, k]));
  }
  // Area of every triangle in the reference, m².
  get areas() {
    if (!this._areas) {
      const { x, y, triangles: t } = this;
      this._areas = new Float64Array(this.owner.length);
      for (let k = 0; k < this._areas.length; k++) {
        const a = t[3 * k], b = t[3 * k + 1], c = t[3 * k + 2];
        this._areas[k] = 0.5 * Math.abs((x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a]));
      }
    }
    return this._areas;
  }
  // [a, b, c, shares] of the triangle at a place of the reference; of the nearest corner where there is none.
  attach(px, py) {
    const { x, y, triangles: t } = this;
    for (let k = 0; k < t.length; k += 3) {
      const inside = within(x[t[k]], y[t[k]], x[t[k + 1]], y[t[k + 1]], x[t[k + 2]], y[t[k + 2]], px, py, 1e-9);
      if (inside) return { at: [t[k], t[k + 1], t[k + 2]], share: inside };
    }
    let best = 0, least = Infinity;
    for (let k = 0; k < x.length; k++) {
      const d = (x[k] - px) ** 2 + (y[k] - py) ** 2;
      if (d < least) { least = d; best = k; }
    }
    return { at: [best, best, best], share: [1, 0, 0] };
  }
}

// Shares of the corners at a point of a triangle; null outside it.
function within(ax, ay, bx, by, cx, cy, px, py, slack = 0) {
  const whole = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
  if (!whole) return null;
  const b = ((px - ax) * (cy - ay) - (cx - ax) * (py - ay)) / whole;
  const c = ((bx - ax) * (py - ay) - (px - ax) * (by - ay)) / whole;
  return b >= -slack && c >= -slack && b + c <= 1 + slack ? [1 - b - c, b, c] : null;
}

class Frame {
  constructor(record, arrays, meshes) {
    Object.assign(this, { cycle: record.cycle, time: record.time, load: record.load, strain: record.strain, fieldCycle: record.field_cycle, arrays });
    this.blocks = record.blocks === undefined ? null : meshes[record.blocks];
    this.rock = record.interior === undefined ? null : meshes[record.interior];
    // Blocks that are solved inside are drawn by their mesh, the others as they are.
    this.solved = new Set(this.rock ? this.rock.owner : []);
  }
  get(name) { return this.arrays.get(name); }
}

class Run {
  static async of(record) {
    const run = Object.assign(new Run(), record, { frames: [], meshes: [] });
    await run.append(record);
    await run.update(record);
    return run;
  }
  async append(record) {
    for (const mesh of await Promise.all(record.meshes.map(Arrays.of))) this.meshes.push(new Mesh(mesh));
    const arrays = await Promise.all(record.frames.map(Arrays.of));
    record.frames.forEach((each, k) => this.frames.push(new Frame(each, arrays[k], this.meshes)));
  }
  // What grows with a run: curves, tips, joints, events and how it ended.
  async update(record) {
    Object.assign(this, { version: record.version, ranges: record.ranges || {}, scale: record.scale, led: record.led, final: record.final, end: record.end, ended: record.ended, events: record.events, cracks: record.cracks });
    const [curves, tips, joints] = await Promise.all([record.curves, record.tips, record.joints].map(
      (each) => each && Arrays.of(each)));
    this.curves = curves;
    this.units = record.curves.units;
    this.tips = tips;
    this.joints = joints;
    this.jointNames = record.joints ? record.joints.names : [];
  }
  // Whether time goes on only: a crack that grows under less and less load takes it back.
  get goesOn() { return this.frames.every((f, k) => !k || f.time >= this.frames[k - 1].time); }
  // [time, how many frames before it have the same time] of every frame.
  moments() {
    let same = 0;
    return this.frames.map((f, k) => { same = k && f.time === this.frames[k - 1].time ? same + 1 : 0; return [f.time, same]; });
  }
  crackName(k) { return (this.cracks && this.cracks[k]) || `crack ${k + 1}`; }
}
