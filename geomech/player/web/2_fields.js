"use strict";
// What can be shown: fields of the rock, of joints and of cracks, with units, ranges and colours.

const UNITS = {  // smallest size, name, factor, as in geomech/output/units.py
  Pa: [[1e9, "GPa", 1e9], [1e5, "MPa", 1e6], [1e2, "kPa", 1e3], [0, "Pa", 1]],
  m: [[1, "m", 1], [1e-4, "mm", 1e-3], [0, "µm", 1e-6]],
  "m/s": [[0.1, "m/s", 1], [1e-4, "mm/s", 1e-3], [0, "µm/s", 1e-6]],
  "N/m": [[1e6, "MN/m", 1e6], [1e2, "kN/m", 1e3], [0, "N/m", 1]],
  "J/m": [[1e6, "MJ/m", 1e6], [1e2, "kJ/m", 1e3], [0, "J/m", 1]],
  "Pa √m": [[1e4, "MPa √m", 1e6], [0, "kPa √m", 1e3]],
};
function unitFor(kind, largest) {
  const found = (UNITS[kind] || []).find(([least]) => Math.abs(largest) >= least && largest);
  if (found) return { name: found[1], factor: found[2] };
  const base = (UNITS[kind] || [[0, kind || "", 1]]).find((u) => u[2] === 1) || [0, kind, 1];
  return { name: base[1], factor: base[2] };
}
function digits(value, n = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const text = size >= 1e6 || size < 1e-4 ? value.toExponential(n - 1) : String(Number(value.toPrecision(n)));
  const [mantissa, power] = text.split("e");
  const raised = power === undefined ? "" : "·10" + String(Number(power)).replace(/./g, (c) => "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"["0123456789-".indexOf(c)]);
  return mantissa.replace("-", "−") + raised;
}
function withUnit(value, kind, n = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const unit = unitFor(kind, Math.abs(value));
  return digits(value / unit.factor, n) + (unit.name && unit.name !== "-" ? " " + unit.name : "");
}

const root = (xx, yy, xy) => Math.hypot(0.5 * (xx - yy), xy);
function principal(xx, yy, zz, xy) {  // largest and smallest of three
  const mean = 0.5 * (xx + yy), r = root(xx, yy, xy);
  return [Math.max(mean + r, zz), Math.min(mean - r, zz)];
}
const mises = (xx, yy, zz, xy) => Math.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy * xy);

// Fields of the rock. ``of``: from (xx, yy, zz, xy), Pa; ``point``: from two components at points.
const STRESSES = [
  ["yy", "σyy vertical stress", (xx, yy) => yy], ["xx", "σxx horizontal stress", (xx) => xx],
  ["xy", "σxy shear stress", (xx, yy, zz, xy) => xy], ["zz", "σzz stress across the plane", (xx, yy, zz) => zz],
  ["principal_max", "σ₁ largest principal stress", (...s) => principal(...s)[0]],
  ["principal_min", "σ₃ smallest principal stress", (...s) => principal(...s)[1]],
  ["tau_max", "τmax largest shear stress", (...s) => { const [a, b] = principal(...s); return 0.5 * (a - b); }],
  ["von_mises", "von Mises stress", mises],
].map(([key, label, of]) => ({ key, label, of, unit: "Pa", group: "Stress", signed: !["tau_max", "von_mises"].includes(key) }));
const ways = (key, name, symbol, unit, x, y) => [
  { key, label: `${name}, size`, unit, group: name, pair: [x, y], point: Math.hypot },
  { key: key + "_x", label: `${name}, ${symbol}x`, unit, group: name, pair: [x, y], point: (a) => a },
  { key: key + "_y", label: `${name}, ${symbol}y`, unit, group: name, pair: [x, y], point: (a, b) => b },
];
const CATEGORIES = [
  { key: "material", label: "Material", group: "Blocks", category: (frame, k) => frame.blocks.material[k] },
  { key: "block", label: "Block", group: "Blocks", category: (frame, k) => frame.blocks.block[k] },
  { key: "key", label: "Key blocks", group: "Blocks", category: (frame, k) => frame.get("key")[k],
    names: ["not known yet", "fixed or dug out", "held by neighbours", "removable, pushed in", "removable, held by strength", "slides", "falls"] },
];
const FIELDS = [...STRESSES, ...ways("displacement", "Displacement", "u", "m", "ux", "uy"),
  ...ways("velocity", "Velocity", "v", "m/s", "vx", "vy"), ...CATEGORIES,
  { key: "none", label: "No colour", group: "Blocks" }];

const JOINT_FIELDS = [
  { key: "none", label: "not shown" }, { key: "state", label: "state", names: ["open", "stick", "slip"] },
  { key: "gap", label: "opening", unit: "m", array: "c_gap", value: (f, k) => Math.max(f.get("c_gap")[k], 0) },
  { key: "slip", label: "slip", unit: "m", array: "c_slip", value: (f, k) => Math.abs(f.get("c_slip")[k]) },
  { key: "pressure", label: "normal force", unit: "N/m", array: "c_n", value: (f, k) => f.get("c_n")[k] },
  { key: "shear", label: "shear force", unit: "N/m", array: "c_s", value: (f, k) => Math.abs(f.get("c_s")[k]) },
];
const CRACK_FIELDS = [
  { key: "birth", label: "cycle they grew in", value: null }, { key: "plain", label: "one colour", value: null },
  { key: "opening", label: "opening", unit: "m", array: "k_open", value: (f, k) => f.get("k_open")[k] },
  { key: "slip", label: "slip", unit: "m", array: "k_slip", value: (f, k) => Math.abs(f.get("k_slip")[k]) },
  { key: "traction", label: "normal traction", unit: "Pa", array: "k_n", value: (f, k) => f.get("k_n")[k] },
  { key: "shear", label: "shear traction", unit: "Pa", array: "k_s", value: (f, k) => Math.abs(f.get("k_s")[k]) },
  { key: "state", label: "state", array: "k_state", names: ["open", "stick", "slip"] },
];

// ColorBrewer's RdBu and YlGnBu (C. Brewer, colorbrewer2.org), which colour-blind readers can tell apart too.
const DIVERGING = ["#053061", "#2166ac", "#4393c3", "#92c5de", "#d1e5f0", "#f7f7f7", "#fddbc7", "#f4a582", "#d6604d", "#b2182b", "#67001f"];
const SEQUENTIAL = ["#ffffd9", "#edf8b1", "#c7e9b4", "#7fcdbb", "#41b6c4", "#1d91c0", "#225ea8", "#253494", "#081d58"];
const LINES = ["#8f0d33", "#d7263d", "#ff7a1a", "#ffb01f"], SIZES = ["#ffc04d", "#ff7a1a", "#d7263d", "#8f0d33"];
// Okabe and Ito (2008), without black.
const CLASSES = ["#E69F00", "#56B4E9", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#999999"];
const STATES = ["#56B4E9", "#7a7f87", "#D7263D"];

const channels = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
function ramp(stops, at) {
  const place = Math.min(Math.max(at, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(place), stops.length - 2);
  const a = channels(stops[k]), b = channels(stops[k + 1]);
  return a.map((c, i) => Math.round(c + (place - k) * (b[i] - c)));
}
const css = ([r, g, b]) => `rgb(${r},${g},${b})`;
// 256 colours over a range: white at zero, equally deep for equal size, where both signs matter; else from light to deep.
function palette(low, high, stops = null) {
  const both = !stops && low < 0 && high > 0 && Math.min(-low, high) > 0.1 * Math.max(-low, high);
  const most = Math.max(-low, high);
  return Array.from({ length: 256 }, (_, k) => {
    const share = k / 255;
    if (stops) return ramp(stops, share);
    if (both) return ramp(DIVERGING, 0.5 + 0.45 * (low + share * (high - low)) / most);
    return ramp(SEQUENTIAL, low + high >= 0 ? 0.04 + 0.92 * share : 0.96 - 0.92 * share);
  });
}
const packed = ([r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r;

// Values of a field of the rock in one frame: at points (of blocks and meshed rock) and of blocks.
function valuesOf(frame, field) {
  frame.values = frame.values || new Map();
  if (frame.values.has(field.key)) return frame.values.get(field.key);
  const out = { rockPoints: null, blockPoints: null, blocks: null };
  const each = (names, of) => {
    const parts = names.map((name) => frame.get(name));
    if (!parts[0]) return null;
    const values = new Float64Array(parts[0].length), row = new Array(parts.length);
    for (let k = 0; k < values.length; k++) {
      for (let i = 0; i < row.length; i++) row[i] = parts[i][k];
      values[k] = of(...row);
    }
    return values;
  };
  if (field.of) {
    out.blocks = frame.blocks && each(["sxx", "syy", "szz", "sxy"], field.of);
    out.rockPoints = frame.rock && each(["isxx", "isyy", "iszz", "isxy"], field.of);
  } else if (field.point) {
    out.blockPoints = frame.blocks && (each(field.pair, field.point) || new Float64Array(frame.blocks.x.length));
    if (frame.rock && field.pair[0] === "ux") out.rockPoints = each(["iux", "iuy"], field.point);
  }
  frame.values.set(field.key, out);
  return out;
}

// Materials that are filled with the field: those solved inside, else those that can move; all where there are none.
function rockMaterials(run) {
  const found = new Set();
  const solved = run.frames.some((f) => f.rock);
  const seen = new Set();
  for (const frame of run.frames) {
    if (!frame.blocks || (seen.has(frame.blocks) && seen.has(frame.rock))) continue;
    seen.add(frame.blocks).add(frame.rock);
    frame.blocks.block.forEach((id, k) => {
      if (solved ? frame.solved.has(id) : !frame.blocks.fixed[k]) found.add(frame.blocks.material[k]);
    });
  }
  return found;
}
// Whether block ``k`` of a frame is coloured by a field.
function isFilled(run, frame, k, field) {
  if (field.key === "none") return false;
  if (field.category) return true;
  if (frame.blocks.fixed[k] && run.someMove) return false;
  return field.of ? !run.rockOnly.size || run.rockOnly.has(frame.blocks.material[k]) : true;
}

// The range that holds all but 0.7 % of the rock's area at either end, over all cycles of all runs.
function robustRange(runs, field, only = null) {
  const pairs = [];
  for (const run of runs) {
    const frames = only ? [only(run)] : run.frames;
    const cost = frames.length * Math.max(...frames.map((f) => (f.rock ? f.rock.owner.length : 0) + (f.blocks ? f.blocks.owner.length : 0)), 1);
    const step = Math.max(1, Math.ceil(cost / 150000));
    frames.forEach((frame, k) => {
      if (k % step && k !== frames.length - 1) return;
      const values = valuesOf(frame, field);
      if (values.rockPoints && frame.rock) {
        const { triangles: t, areas } = frame.rock, v = values.rockPoints;
        for (let i = 0; i < areas.length; i++) pairs.push([(v[t[3 * i]] + v[t[3 * i + 1]] + v[t[3 * i + 2]]) / 3, areas[i]]);
      }
      if (!frame.blocks) return;
      const { owner, triangles: t, areas, block } = frame.blocks;
      for (let i = 0; i < areas.length; i++) {
        const b = owner[i];
        if (!isFilled(run, frame, b, field) || (values.rockPoints && frame.solved.has(block[b]))) continue;
        const p = values.blockPoints;
        const value = p ? (p[t[3 * i]] + p[t[3 * i + 1]] + p[t[3 * i + 2]]) / 3 : values.blocks ? values.blocks[b] : NaN;
        pairs.push([value, areas[i]]);
      }
    });
  }
  return percentiles(pairs, 0.007, field);
}
function percentiles(pairs, tail, field) {
  const known = pairs.filter((p) => Number.isFinite(p[0]));
  if (!known.length) return [0, 1];
  known.sort((a, b) => a[0] - b[0]);
  const whole = known.reduce((sum, p) => sum + p[1], 0) || 1;
  let sum = 0, low = known[0][0], high = known[known.length - 1][0], begun = false;
  for (const [value, weight] of known) {
    sum += weight;
    if (!begun && sum >= tail * whole) { low = value; begun = true; }
    if (sum >= (1 - tail) * whole) { high = value; break; }
  }
  if (field && !field.signed && field.point === Math.hypot) low = 0;
  if (low > 0 && low < 0.5 * high) low = 0;
  if (high < 0 && high > 0.5 * low) high = 0;
  if (low < 0 && -low < 0.03 * high) low = 0;
  if (high > 0 && high < -0.03 * low) high = 0;
  if (!(high - low > 1e-6 * Math.max(Math.abs(low), Math.abs(high), 1e-30))) {
    const middle = 0.5 * (low + high), half = Math.max(0.05 * Math.abs(middle), 1e-30);
    return middle ? [middle - half, middle + half] : [0, 1e-30];
  }
  return [low, high];
}
// The same of joints and cracks, over all that is drawn of them.
function lineRange(runs, field) {
  const found = [];
  for (const run of runs) {
    if (field.key === "birth") {
      for (const f of run.frames) for (const b of f.get("k_birth") || []) if (b > 0) found.push([b, 1]);
      continue;
    }
    if (!field.array) continue;
    const step = Math.max(1, Math.ceil(run.frames.length / 60));
    run.frames.forEach((f, k) => {
      if (k % step && k !== run.frames.length - 1) return;
      const n = (f.get(field.array) || []).length, every = Math.max(1, Math.ceil(n * Math.min(run.frames.length, 60) / 40000));
      for (let i = 0; i < n; i += every) found.push([field.value(f, i), 1]);
    });
  }
  if (field.key === "birth") {
    let low = Infinity, high = -Infinity;
    for (const [b] of found) { low = Math.min(low, b); high = Math.max(high, b); }
    return found.length ? [low, Math.max(high, low + 1)] : null;
  }
  const range = percentiles(found, 0.01, null);
  return field.key === "traction" ? range : [0, Math.max(range[1], 1e-30)];
}
