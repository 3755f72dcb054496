"use strict";
// The page's player: one slider over the cycles of one run, or of several with one range of colours.

const PACES = [0.25, 0.5, 1, 2, 4], PER_SECOND = 12;
const HELP = [["Space", "play, pause"], ["← →", "one cycle back, on"], ["Shift ← →", "ten cycles"], ["Home End", "first, last cycle"],
  ["+ −", "zoom"], ["0", "the whole model"], ["f F", "next, previous field"], ["[ ]", "half, twice the magnification"],
  ["o c t j", "outlines, cracks, tips, joints"], ["r", "range of this cycle"], ["Esc", "end the selection"], ["?", "this list"]];

function inks(element) {
  const style = getComputedStyle(element), ink = {};
  for (const name of ["page", "text", "soft", "line", "card", "outline", "idle", "halo", "crack", "growing", "force", "select", "water"])
    ink[name] = style.getPropertyValue(`--gm-${name}`).trim();
  ink.curves = Array.from({ length: INKS }, (_, k) => style.getPropertyValue(`--gm-curve-${k}`).trim());
  return ink;
}
Run.prototype.gapBefore = function (frame) {
  const k = this.frames.indexOf(frame);
  return k > 0 ? frame.cycle - this.frames[k - 1].cycle - 1 : 0;
};

class Player {
  constructor(root, live) {
    this.root = root; this.live = live; this.runs = []; this.at = 0; this.pace = 1; this.ranges = new Map(); this.own = new Set();
    root.classList.add("gm");
    this.message = el("p", { class: "gm-message" }, "Reading …");
    root.replaceChildren(this.message);
  }
  say(words) { this.message.textContent = words; this.message.hidden = !words; }

  async open(records) {
    this.runs = await Promise.all(records.map((record) => Run.of(record)));
    for (const run of this.runs) this.prepare(run);
    this.field = FIELDS.find((f) => f.key === this.startField()) || FIELDS[0];
    this.joints = JOINT_FIELDS[0]; this.cracks = CRACK_FIELDS[0];
    this.shown = { outlines: true, cracks: true, tips: true, labels: false, forces: false, bolts: true, water: true, monitors: true, events: false, reference: false };
    this.scale = this.defaultScale(); this.flip = false; this.selected = null;
    this.build();
    this.say("");
    this.history.set([], "time", "s");
    this.layout(); this.fit(); this.chosen(); this.go(this.startAt());
    new ResizeObserver(() => { this.layout(); this.redraw(); }).observe(this.stage);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
    window.addEventListener("beforeprint", () => { this.stop(); this.root.classList.add("gm-print"); this.layout(2); this.redraw(true); });
    window.addEventListener("afterprint", () => { this.root.classList.remove("gm-print"); this.layout(); this.redraw(); });
    document.addEventListener("keydown", (event) => this.key(event));
  }
  prepare(run) {
    run.someMove = run.frames.some((f) => f.blocks && f.blocks.fixed.some((x) => !x));
    run.rockOnly = rockMaterials(run);
    run.has = (name) => run.frames.some((f) => f.arrays.has(name));
  }
  // What a run came to: its last cycle, or the last one before its rock was cut.
  startAt() {
    if (this.runs.length > 1 || this.live) return this.count - 1;
    const k = this.runs[0].frames.findIndex((f) => f.cycle >= this.runs[0].final);
    return k < 0 ? this.count - 1 : k;
  }
  // Slopes that move show movement, what is pressed its stress.
  startField() {
    const run = this.runs[0], last = run.frames[run.frames.length - 1];
    if (!last.blocks) return "none";
    let most = 0;
    for (const name of ["ux", "uy"]) for (const u of last.get(name)) most = Math.max(most, Math.abs(u));
    const moves = !run.led && most > 0.005 * Math.max(...run.size);
    return moves || (!run.someMove && !run.frames.some((f) => f.rock)) ? "displacement" : run.component;
  }

  // -- time ----------------------------------------------------------------------------------------------------
  // One run steps by its cycles; several by the times of all of them, or, where time goes back in one, by their parts.
  // ``rows[k]``: which frame each run shows at step k; ``times[k]``: the time then, if there is one.
  setTimeline() {
    const runs = this.runs, order = (a, b) => a[0] - b[0] || a[1] - b[1];
    if (runs.length > 1 && runs.every((run) => run.goesOn)) {
      const moments = runs.map((run) => run.moments()), seen = new Set(), at = runs.map(() => 0);
      const all = moments.flat().filter((m) => !seen.has(m.join()) && seen.add(m.join())).sort(order);
      this.rows = all.map((m) => moments.map((own, k) => { while (at[k] + 1 < own.length && order(own[at[k] + 1], m) <= 0) at[k]++; return at[k]; }));
      this.times = all.map((m) => m[0]);
    } else {
      const n = Math.max(...runs.map((run) => run.frames.length));
      this.rows = Array.from({ length: n }, (_, k) => runs.map((run) => (n > 1 ? Math.round(k * (run.frames.length - 1) / (n - 1)) : 0)));
      this.times = runs.length === 1 ? runs[0].frames.map((f) => f.time) : null;
    }
  }
  get count() { return this.rows.length; }
  frameOf(run) { return run.frames[this.rows[Math.min(this.at, this.count - 1)][this.runs.indexOf(run)]]; }
  go(at) {
    this.at = Math.max(0, Math.min(this.count - 1, Math.round(at)));
    this.slider.value = String(this.at);
    this.redraw();
  }
  // To the cycle nearest to a place on a curve.
  goTo(value, of) {
    let best = 0, least = Infinity;
    for (let k = 0; k < this.count; k++) for (const [i, run] of this.runs.entries()) {
      const d = Math.abs(of(run.frames[this.rows[k][i]]) - value);
      if (d < least) { least = d; best = k; }
    }
    this.stop(); this.go(best);
  }
  play() {
    if (this.playing) return this.stop();
    if (this.at >= this.count - 1) this.go(0);
    this.playing = true; this.playButton.textContent = "❚❚"; this.playButton.setAttribute("aria-label", "pause");
    let before = null, way = this.at;
    const step = (now) => {
      if (!this.playing) return;
      if (before !== null) way += (now - before) / 1000 * this.pace * PER_SECOND * Math.max(1, this.count / 180);
      before = now;
      if (way >= this.count - 1) {
        if (!this.loop.checked) { this.go(this.count - 1); return this.stop(); }
        way = 0;
      }
      if (Math.floor(way) !== this.at) this.go(Math.floor(way));
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
  stop() { this.playing = false; this.playButton.textContent = "▶"; this.playButton.setAttribute("aria-label", "play"); }

  // -- page ----------------------------------------------------------------------------------------------------
  build() {
    this.setTimeline();
    this.stage = el("div", { class: "gm-stage" });
    this.drawings = this.runs.map((run) => {
      const canvas = el("canvas", { class: "gm-canvas", role: "img", tabindex: "0" });
      const drawing = new Drawing(run, canvas);
      const note = el("div", { class: "gm-note" });
      drawing.note = note;
      drawing.holder = el("div", { class: "gm-holder" }, canvas, note);
      this.stage.append(drawing.holder);
      this.mouse(drawing);
      return drawing;
    });
    this.stage.dataset.runs = String(Math.min(this.runs.length, 4));
    this.legend = el("div", { class: "gm-legend" });
    this.tip = el("div", { class: "gm-tip", hidden: true });
    this.stage.append(this.tip);
    this.charts = el("div", { class: "gm-charts" });
    this.chart = new Chart("", (x) => this.goTo(x, this.curveX));
    this.history = new Chart("", (x) => this.goTo(x, (f) => f.time));
    this.historyNote = el("div", { class: "gm-facts" });
    this.history.element.append(this.historyNote);
    this.buildCurveChoice();
    this.hint = el("p", { class: "gm-hint" }, "Click a block, joint, crack, tip, bolt or monitor in the drawing: its history appears here.");
    this.charts.append(this.chart.element, el("div", {}, this.history.element, this.hint));
    this.root.replaceChildren(this.message, el("div", { class: "gm-main" },
      el("div", { class: "gm-left" }, this.stage, this.legend, this.transport()), this.panel = this.controls()), this.charts, this.help());
    this.featuresOf = this.features();
  }
  // What there is to choose from: a run that goes on comes to have contacts, cracks and columns that it had not.
  features() {
    const names = ["vx", "c_gap", "k_x", "t_x", "c_fx", "w_x"].filter((name) => this.runs.some((run) => run.has(name)));
    return [...names, this.runs.some((run) => run.events.length), ...this.runs.flatMap((run) => [!!run.joints, ...Object.keys(run.units)])].join();
  }
  button(text, label, action) { return el("button", { type: "button", "aria-label": label, title: label, onclick: action }, text); }
  transport() {
    this.playButton = this.button("▶", "play", () => this.play());
    this.playButton.classList.add("gm-play");
    this.slider = el("input", { type: "range", min: "0", step: "1", "aria-label": "cycle", class: "gm-slider", oninput: () => { this.stop(); this.go(Number(this.slider.value)); } });
    this.slider.max = String(this.count - 1); this.slider.value = String(this.at);
    this.moment = el("output", { class: "gm-moment" });
    this.marks = el("div", { class: "gm-marks" });
    this.markEvents();
    this.loop = el("input", { type: "checkbox" });
    const pace = el("select", { "aria-label": "speed", onchange: () => { this.pace = Number(pace.value); } },
      ...PACES.map((p) => el("option", { value: String(p), selected: p === 1 }, `× ${p}`)));
    return el("div", { class: "gm-transport" },
      el("div", { class: "gm-track" }, this.slider, this.marks),
      el("div", { class: "gm-row" },
        this.button("|◀", "first cycle", () => { this.stop(); this.go(0); }), this.button("◁", "one cycle back", () => { this.stop(); this.go(this.at - 1); }),
        this.playButton, this.button("▷", "one cycle on", () => { this.stop(); this.go(this.at + 1); }),
        this.button("▶|", "last cycle", () => { this.stop(); this.go(this.count - 1); }), pace, el("label", { class: "gm-check" }, this.loop, "loop"),
        this.moment));
  }
  markEvents() {
    const marks = [];
    if (this.runs.length === 1) {
      const run = this.runs[0], seen = new Set();
      for (const [kind, cycle] of run.events) {
        const k = run.frames.findIndex((f) => f.cycle >= cycle);
        if (k < 0 || seen.has(`${kind}${k}`) || marks.length > 60) continue;
        seen.add(`${kind}${k}`);
        const mark = el("button", { type: "button", tabindex: "-1", title: `${kind}, cycle ${cycle}`, "aria-label": `${kind}, cycle ${cycle}`, onclick: () => { this.stop(); this.go(k); } });
        mark.style.left = `${100 * k / Math.max(this.count - 1, 1)}%`;
        marks.push(mark);
      }
    }
    this.marks.replaceChildren(...marks);
  }
  fieldsHere() {
    return FIELDS.filter((field) => field.key === "none" || this.runs.some((run) => {
      if (!run.frames.some((f) => f.blocks || f.rock)) return false;
      if (field.pair && field.pair[0] === "vx") return run.has("vx");
      if (field.key === "key") return run.frames.some((f) => f.get("key") && f.get("key").some((k) => k > 0));
      return true;
    }));
  }
  select(label, options, chosen, change, groups = false) {
    const made = el("select", { onchange: () => change(made.value) }), byGroup = new Map();
    for (const option of options) {
      const item = el("option", { value: option.key, selected: option.key === chosen }, option.label);
      if (!groups) { made.append(item); continue; }
      if (!byGroup.has(option.group)) { byGroup.set(option.group, el("optgroup", { label: option.group })); made.append(byGroup.get(option.group)); }
      byGroup.get(option.group).append(item);
    }
    return { input: made, row: el("label", { class: "gm-field" }, el("span", {}, label), made) };
  }
  check(key, label, there = true) {
    if (!there) return null;
    const box = el("input", { type: "checkbox", checked: this.shown[key], "data-key": key, onchange: () => { this.shown[key] = box.checked; this.redraw(); } });
    this.boxes = this.boxes || {};
    this.boxes[key] = box;
    return el("label", { class: "gm-check" }, box, label);
  }
  controls() {
    const has = (name) => this.runs.some((run) => run.has(name));
    const field = this.select("Colour", this.fieldsHere(), this.field.key, (key) => this.setField(key), true);
    this.fieldInput = field.input; field.input.dataset.role = "field";
    const rows = [field.row];
    this.lowInput = el("input", { type: "text", inputmode: "decimal", "aria-label": "least value", onchange: () => this.setRange() });
    this.highInput = el("input", { type: "text", inputmode: "decimal", "aria-label": "largest value", onchange: () => this.setRange() });
    this.rangeUnit = el("span", { class: "gm-unit" });
    const flip = el("input", { type: "checkbox", onchange: () => { this.flip = flip.checked; this.redraw(); this.writeRange(); } });
    this.flipRow = el("label", { class: "gm-check" }, flip, "compression positive");
    this.rangeRow = el("div", { class: "gm-field" }, el("span", {}, "Range"), el("div", { class: "gm-range" }, this.lowInput, "to", this.highInput, this.rangeUnit),
      el("div", { class: "gm-row" }, this.button("all cycles", "range over all cycles", () => { this.ranges.delete(this.field.key); this.own.delete(this.field.key); this.chosen(); }),
        this.button("this cycle", "range of this cycle", () => this.rangeOfThis()), this.flipRow));
    rows.push(this.rangeRow);
    this.scaleInput = el("input", { type: "range", min: "-1", max: "5", step: "0.01", "aria-label": "magnification", oninput: () => this.setScale(this.fromSlider(Number(this.scaleInput.value))) });
    this.scaleText = el("input", { type: "text", inputmode: "decimal", "aria-label": "displacements times", onchange: () => { const v = Number(this.scaleText.value); if (v >= 0 && Number.isFinite(v)) this.setScale(v); else this.writeScale(); } });
    rows.push(el("div", { class: "gm-field" }, el("span", {}, "Displacements ×"), el("div", { class: "gm-range" }, this.scaleInput, this.scaleText),
      el("div", { class: "gm-row" }, ...[["0", 0], ["1", 1]].map(([text, v]) => this.button(text, `displacements × ${text}`, () => this.setScale(v))),
        this.button("default", "magnified so that they are visible", () => { this.setScale(this.defaultScale()); this.scaleChosen = false; }))));
    if (has("c_gap")) {
      const joints = this.select("Joints", JOINT_FIELDS, this.joints.key, (key) => { this.joints = JOINT_FIELDS.find((f) => f.key === key); this.redraw(); });
      this.jointInput = joints.input; joints.input.dataset.role = "joints"; rows.push(joints.row);
    }
    if (has("k_x")) {
      const cracks = this.select("Cracks", CRACK_FIELDS, this.cracks.key, (key) => { this.cracks = CRACK_FIELDS.find((f) => f.key === key); this.redraw(); });
      cracks.input.dataset.role = "cracks"; rows.push(cracks.row);
    }
    rows.push(el("div", { class: "gm-checks" }, this.check("outlines", "outlines"), this.check("reference", "undeformed"), this.check("cracks", "cracks", has("k_x")),
      this.check("tips", "tips", has("t_x")), this.check("labels", "K at tips", has("t_x")), this.check("forces", "contact forces", has("c_fx")),
      this.check("bolts", "bolts", this.runs.some((run) => (run.bolts || []).length)), this.check("water", "water table", has("w_x")), this.check("monitors", "monitors", this.runs.some((run) => run.monitors.length)),
      this.check("events", "events", this.runs.some((run) => run.events.length))));
    rows.push(el("div", { class: "gm-row gm-tools" }, this.button("whole model", "show the whole model (0)", () => { this.fit(); this.redraw(); }),
      this.button("save picture", "save what is shown as a PNG", () => this.save()), this.button("light / dark", "change between light and dark", () => this.theme()),
      this.button("?", "keys", () => this.helpBox.showModal())));
    const panel = el("details", { class: "gm-controls", open: true }, el("summary", {}, "Show"), ...rows);
    if (matchMedia("(max-width: 760px)").matches) panel.open = false;
    this.writeScale();
    return panel;
  }
  help() {
    this.helpBox = el("dialog", { class: "gm-help" }, el("h3", {}, "Keys"), el("table", {}, el("tbody", {}, ...HELP.map(([key, does]) => el("tr", {}, el("td", {}, el("kbd", {}, key)), el("td", {}, does))))),
      el("p", {}, "Drag to move the model, turn the wheel or pinch to zoom, double-click for the whole model. Click a block, joint, crack, tip, bolt or monitor for its history."),
      this.button("close", "close", () => this.helpBox.close()));
    return this.helpBox;
  }
  theme() {
    const dark = getComputedStyle(this.root).colorScheme.includes("dark");
    document.documentElement.dataset.theme = dark ? "light" : "dark";
    this.redraw();
  }
  save() {
    const parts = this.drawings.map((d) => d.canvas), width = parts.reduce((sum, c) => sum + c.width, 0);
    const out = el("canvas"); out.width = width; out.height = Math.max(...parts.map((c) => c.height)) + 0;
    const c = out.getContext("2d");
    let x = 0;
    for (const part of parts) { c.drawImage(part, x, 0); x += part.width; }
    out.toBlob((blob) => {
      const link = el("a", { href: URL.createObjectURL(blob), download: `${this.runs[0].name}_${this.frameOf(this.runs[0]).cycle}.png` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  // -- what is shown -------------------------------------------------------------------------------------------
  setField(key) { this.field = FIELDS.find((f) => f.key === key); this.fieldInput.value = key; this.chosen(); }
  range() {
    const key = this.field.key, stored = this.runs.map((run) => (run.ranges || {})[key]);  // as in the pictures, where they are known
    if (!this.ranges.has(key)) {
      const known = stored.every(Boolean);
      this.ranges.set(key, known ? [Math.min(...stored.map((r) => r[0])), Math.max(...stored.map((r) => r[1]))] : robustRange(this.runs, this.field));
    }
    return this.ranges.get(this.field.key);
  }
  rangeOfThis() { this.own.add(this.field.key); this.ranges.set(this.field.key, robustRange(this.runs, this.field, (run) => this.frameOf(run))); this.writeRange(); this.redraw(); }
  chosen() {
    const plain = this.field.category || this.field.key === "none";
    this.rangeRow.hidden = plain; this.flipRow.hidden = !(this.field.of && this.field.signed);
    if (!plain) this.writeRange();
    this.redraw();
  }
  get unit() { const [low, high] = this.range(); return unitFor(this.field.unit, Math.max(Math.abs(low), Math.abs(high))); }
  get sign() { return this.flip && this.field.of && this.field.signed ? -1 : 1; }
  writeRange() {
    if (this.field.category || this.field.key === "none") return;
    const unit = this.unit, ends = this.range().map((v) => this.sign * v / unit.factor);
    if (this.sign < 0) ends.reverse();
    [this.lowInput.value, this.highInput.value] = ends.map((v) => String(Number(v.toPrecision(4))));
    this.rangeUnit.textContent = unit.name;
  }
  setRange() {
    const unit = this.unit, ends = [this.lowInput, this.highInput].map((i) => this.sign * Number(i.value.replace("−", "-")) * unit.factor).sort((a, b) => a - b);
    if (ends.every(Number.isFinite) && ends[1] > ends[0]) { this.ranges.set(this.field.key, ends); this.own.add(this.field.key); }
    this.writeRange(); this.redraw();
  }
  fromSlider(v) { return v <= -0.99 ? 0 : 10 ** v; }
  defaultScale() { return Math.min(...this.runs.map((run) => run.scale)); }
  setScale(scale) { this.scaleChosen = true; this.scale = scale < 100 ? Number(scale.toPrecision(3)) : Number(scale.toPrecision(2)); this.writeScale(); this.redraw(); }
  writeScale() { this.scaleText.value = String(this.scale); this.scaleInput.value = String(this.scale > 0 ? Math.log10(this.scale) : -1); }
  look() {
    const plain = this.field.category || this.field.key === "none", [low, high] = plain ? [0, 1] : this.range();
    const key = `${this.field.key}${low}${high}`;
    if (this.paletteOf !== key) {
      this.paletteOf = key;
      this.colours = palette(low, high, null);
      this.packedColours = Int32Array.from(this.colours, packed);
    }
    const once = (name, make) => { const k = `${name}:${this.joints.key}:${this.cracks.key}`; if (!this.ranges.has(k)) this.ranges.set(k, make()); return this.ranges.get(k); };
    return {
      field: this.field, fill: { low, high, colours: this.packedColours }, scale: this.scale, shown: this.shown, joints: this.joints, cracks: this.cracks,
      jointRange: this.joints.unit ? once("joint", () => lineRange(this.runs, this.joints)) : null,
      crackRange: this.cracks.key === "birth" || this.cracks.unit ? once("crack", () => lineRange(this.runs, this.cracks)) : this.cracks.names ? [0, 2] : null,
      forceRange: this.shown.forces ? once("force", () => this.largestForce()) : 0,
      boltForce, boltMost: once("bolt", () => Math.max(0, ...this.runs.flatMap((run) => (run.bolts || []).map((bolt) => most(run.curves.get(bolt.column)))))),
      selected: this.selected, ink: inks(this.root), font: getComputedStyle(this.root).fontFamily,
    };
  }
  largestForce() {
    const sizes = [];
    for (const run of this.runs) for (const f of run.frames) {
      const fx = f.get("c_fx"), fy = f.get("c_fy");
      if (fx) for (let k = 0; k < fx.length; k += Math.max(1, Math.floor(fx.length / 200))) sizes.push(Math.hypot(fx[k], fy[k]));
    }
    sizes.sort((a, b) => a - b);
    return sizes[Math.floor(0.98 * (sizes.length - 1))] || 0;
  }
  layout(ratio = null) {
    const r = ratio || window.devicePixelRatio || 1;
    // As high as the model is at this width, within bounds; beside each other all alike.
    const highs = this.drawings.map((drawing) => {
      const [x0, x1, y0, y1] = drawing.box(this.scale);
      return drawing.holder.clientWidth * (y1 - y0) / Math.max(x1 - x0, 1e-12) + 60;
    });
    const most = (this.runs.length > 3 ? 0.4 : 0.66) * Math.max(window.innerHeight, 560), high = Math.min(Math.max(...highs, 230), most);
    for (const drawing of this.drawings) {
      if (ratio === null) drawing.holder.style.height = `${Math.round(high)}px`;
      const box = drawing.holder.getBoundingClientRect(), before = [drawing.width, drawing.height];
      if (!box.width) continue;
      drawing.resize(Math.floor(box.width), Math.floor(box.height), r);
      if (before[0] && (before[0] !== drawing.width || before[1] !== drawing.height)) drawing.fitted ? this.fit() : 0;
    }
  }
  fit() {
    // Runs of one size keep one scale, so that they can be compared.
    const boxes = this.drawings.map((d) => d.box(this.scale));
    for (const [k, drawing] of this.drawings.entries()) { drawing.view.fit(boxes[k], drawing.width, drawing.height, 26); drawing.fitted = true; }
    const least = Math.min(...this.drawings.map((d) => d.view.scale));
    for (const drawing of this.drawings) if (drawing.view.scale < 3 * least) drawing.view.zoom(least / drawing.view.scale, drawing.width / 2, drawing.height / 2);
  }
  redraw(now = false) {
    if (now) return this.paint();
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => this.paint());
  }
  paint() {
    cancelAnimationFrame(this.waiting);
    this.waiting = null;
    const began = performance.now(), look = this.look();
    for (const drawing of this.drawings) {
      if (!drawing.width) continue;
      const frame = this.frameOf(drawing.run);
      drawing.draw(frame, look);
      const name = this.runs.length > 1 ? `${drawing.run.name}: ` : "";
      const older = frame.fieldCycle === undefined || look.field.category ? "" : `field inside rock: cycle ${frame.fieldCycle}`;
      drawing.note.textContent = (this.runs.length > 1 ? `${name}cycle ${frame.cycle}  ` : "") + older;
      drawing.canvas.setAttribute("aria-label", `${drawing.run.title}, cycle ${frame.cycle}, ${this.field.label}`);
    }
    this.paintMilliseconds = performance.now() - began;
    const frame = this.frameOf(this.runs[0]);
    const parts = [this.times ? `t = ${digits(this.times[this.at])} s` : `${Math.round(100 * this.at / Math.max(this.count - 1, 1))} % of each run`];
    if (this.runs.length === 1) {
      parts.push(`cycle ${frame.cycle}`);
      if (this.runs[0].led && frame.load !== null) parts.push(`load ${withUnit(Math.abs(frame.load), "Pa")}${frame.load < 0 ? " in tension" : ""}`);
    }
    this.moment.textContent = parts.join("  ·  ");
    this.drawLegend(look);
    const cursors = new Map(this.runs.map((run) => [run, this.frameOf(run)]));
    this.chart.draw(cursors, look.ink, look.font);
    this.history.draw(cursors, look.ink, look.font);
    this.root.dataset.cycle = String(frame.cycle);
    this.root.dataset.ready = "yes";
  }
  drawLegend(look) {
    const bar = (title, range, unit, stops, note = "") => {
      const steps = Array.from({ length: 33 }, (_, k) => (stops ? css(ramp(stops, k / 32)) : css(this.colours[Math.round(k * 255 / 32)])));
      const strip = el("div", { class: "gm-strip" });
      const ends = [...range];
      if (!stops && this.sign < 0) { steps.reverse(); ends.reverse(); }
      strip.style.background = `linear-gradient(to right, ${steps.join(",")})`;
      const signed = stops ? 1 : this.sign, low = signed * ends[0] / unit.factor, high = signed * ends[1] / unit.factor;
      const marks = el("div", { class: "gm-ticks" });
      for (const t of ticks(low, high, 4)) {
        const mark = el("span", {}, digits(t, 3));
        mark.style.left = `${100 * (t - low) / (high - low)}%`;
        marks.append(mark);
      }
      return el("div", { class: "gm-bar" }, el("div", { class: "gm-bar-title" }, title + (unit.name ? `, ${unit.name}` : ""), el("small", {}, note)), strip, marks);
    };
    const chips = (title, names, colours) => el("div", { class: "gm-bar" }, el("div", { class: "gm-bar-title" }, title), el("div", { class: "gm-keys" }, ...names.map((name, k) => {
      const swatch = el("span", { class: "gm-swatch" });
      swatch.style.background = colours[k % colours.length];
      return el("span", { class: "gm-key" }, swatch, name);
    })));
    const parts = [], field = this.field;
    if (field.key === "material") parts.push(chips("Material", this.runs[0].materials, CLASSES));
    else if (field.names) parts.push(chips(field.label, field.names, CLASSES));
    else if (!field.category && field.key !== "none") {
      const sign = field.of && field.signed ? (this.flip ? "compression positive" : "tension positive") : "";
      parts.push(bar(field.label, this.range(), this.unit, null, sign));
    }
    const lines = (title, what, range) => {
      if (what.names) parts.push(chips(title, what.names, STATES));
      else if (range && (what.unit || what.key === "birth")) parts.push(bar(`${title}: ${what.label}`, range, what.unit ? unitFor(what.unit, Math.max(Math.abs(range[0]), Math.abs(range[1]))) : { name: "", factor: 1 }, what.unit ? SIZES : LINES));
    };
    if (look.joints.key !== "none") lines("Joints", look.joints, look.jointRange);
    if (this.shown.cracks && this.runs.some((run) => run.has("k_x")) && look.cracks.key !== "plain") lines("Cracks", look.cracks, look.crackRange);
    const key = `${this.paletteOf}|${this.sign}|${look.joints.key}|${look.cracks.key}|${look.jointRange}|${look.crackRange}|${this.shown.cracks}`;
    if (key !== this.legendOf) { this.legendOf = key; this.legend.replaceChildren(...parts); }
  }

  // -- curves --------------------------------------------------------------------------------------------------
  buildCurveChoice(before = null) {
    const columns = new Map();
    for (const run of this.runs) for (const name of Object.keys(run.units)) if (name !== "time") columns.set(name, run.units[name]);
    const has = (...names) => names.filter((name) => columns.has(name)), single = this.runs.length === 1;
    const energies = has("elastic_energy", "contact_energy", "kinetic_energy", "fracture_energy", "friction_loss", "damping_loss", "impact_loss", "bond_loss", "crushing_loss");
    const options = [];
    const add = (key, label, group, x, names) => { if (names.length) options.push({ key, label, group, x, names }); };
    if (columns.has("strain") && columns.has("load")) add("load_strain", "load against strain", "Curves", "strain", ["load"]);
    add("load", "load", "Curves", "time", has("load"));
    if (single) {
      const monitors = [...columns.keys()].filter((name) => /_u[xy]$/.test(name));
      add("monitors", "displacement of monitors", "Curves", "time", monitors.slice(0, 8));
      add("bolts", "forces in bolts", "Curves", "time", (this.runs[0].bolts || []).map((b) => b.column).filter((n) => columns.has(n)).slice(0, 8));
      add("energies", "energies", "Curves", "time", energies);
    }
    for (const [name, label] of [["crack_length", "length of all cracks"], ["max_k_eq", "largest K_eq"], ["kinetic_energy", "kinetic energy"], ["gravity_work", "work of gravity"], ["friction_loss", "work of friction"]])
      add(name, label, "Curves", "time", has(name));
    if (this.runs.some((run) => run.joints)) for (const [name, label] of [["max_opening", "largest opening"], ["max_slip", "largest slip"], ["mobilised", "mobilised strength"]])
      options.push({ key: `joint:${name}`, label: `joints: ${label}`, group: "Curves", x: "time", joints: name });
    for (const name of columns.keys()) if (!options.some((o) => o.key === name)) add(name, name.replaceAll("_", " "), "All columns", "time", [name]);
    this.curveOptions = options;
    if (!options.length) return;
    const wanted = this.runs[0].led ? ["load_strain", "load"] : ["monitors", "kinetic_energy", "crack_length"];
    const first = options.find((o) => o.key === before) || wanted.map((key) => options.find((o) => o.key === key)).find(Boolean) || options[0];
    const choice = this.select("", options, first.key, (key) => this.setCurve(key), true);
    choice.input.setAttribute("aria-label", "curve"); choice.input.dataset.role = "curve";
    this.chart.heading.replaceChildren(choice.input);
    this.setCurve(first.key, false);
  }
  setCurve(key, draw = true) {
    const option = this.curveOptions.find((o) => o.key === key), lines = [];
    this.curve = key;
    const single = this.runs.length === 1;
    for (const run of this.runs) {
      if (option.joints) {
        if (run.joints) for (const [k, name] of run.jointNames.entries()) {
          const own = rowsOf(run.joints, { joint: k });
          lines.push(this.line(run, single ? name : `${run.name}: ${name}`, own.map((i) => run.joints.get("time")[i]), own.map((i) => (run.joints.get(option.joints) || [])[i]),
            option.joints.endsWith("opening") || option.joints.endsWith("slip") ? "m" : "", lines.length, own.map((i) => run.joints.get("cycle")[i])));
        }
        continue;
      }
      for (const name of option.names) {
        const y = run.curves.get(name), x = run.curves.get(option.x);
        if (y && x) lines.push(this.line(run, single ? name.replaceAll("_", " ") : run.name, x, y, run.units[name], lines.length, run.curves.get("cycle")));
      }
    }
    const time = option.x === "time";
    this.curveX = time ? (f) => f.time : (f) => f.strain;
    this.chart.set(lines, time ? "time" : "strain", time ? "s" : "");
    if (draw) this.redraw();
  }
  line(run, name, x, y, unit, k, cycle) {
    return { name, x, y, unit, colour: k % INKS, dashed: k >= INKS, row: (cursors) => nearest(cycle, cursors.get(run).cycle) };
  }

  // -- pointing ------------------------------------------------------------------------------------------------
  mouse(drawing) {
    const canvas = drawing.canvas, down = new Map();
    const place = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    const together = (action) => { for (const d of this.drawings) action(d.view, d); this.redraw(); };
    let moved = 0, spread = null, middle = null;
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); down.set(event.pointerId, place(event)); moved = 0; spread = null; this.hideTip(); });
    canvas.addEventListener("pointermove", (event) => {
      const now = place(event), before = down.get(event.pointerId);
      if (!before) { if (event.pointerType === "mouse") this.hover(drawing, now); return; }
      moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
      down.set(event.pointerId, now);
      const all = [...down.values()];
      if (all.length === 2) {
        const wide = Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]), centre = [(all[0][0] + all[1][0]) / 2, (all[0][1] + all[1][1]) / 2];
        if (spread) together((view) => { view.x += centre[0] - middle[0]; view.y += centre[1] - middle[1]; view.zoom(wide / spread, centre[0], centre[1]); });
        spread = wide; middle = centre;
      } else if (moved > 4) together((view, d) => { view.x += now[0] - before[0]; view.y += now[1] - before[1]; d.fitted = false; });
    });
    const up = (event) => {
      const at = down.get(event.pointerId);
      down.delete(event.pointerId);
      if (at && moved <= 4 && event.type === "pointerup") this.choose(drawing, drawing.pick(...at));
    };
    canvas.addEventListener("pointerup", up); canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("pointerleave", () => this.hideTip());
    // With Ctrl, or once the reader has clicked into the drawing: else the wheel scrolls the page.
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !this.root.classList.contains("gm-alone") && document.activeElement !== canvas) return;
      event.preventDefault();
      const [x, y] = place(event), factor = Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015));
      together((view, d) => { view.zoom(factor, x, y); d.fitted = false; });
    }, { passive: false });
    canvas.addEventListener("dblclick", () => { this.fit(); this.redraw(); });
  }
  hideTip() { this.tip.hidden = true; }
  hover(drawing, [x, y]) {
    const found = drawing.pick(x, y);
    if (!found) return this.hideTip();
    this.tip.replaceChildren(...this.describe(found, drawing.frame).map((line, k) => el(k ? "div" : "strong", {}, line)));
    this.tip.hidden = false;
    const stage = this.stage.getBoundingClientRect(), own = drawing.canvas.getBoundingClientRect();
    const left = own.left - stage.left + x, top = own.top - stage.top + y, w = this.tip.offsetWidth, h = this.tip.offsetHeight;
    this.tip.style.left = `${left + 16 + w > stage.width ? Math.max(0, left - w - 12) : left + 16}px`;
    this.tip.style.top = `${Math.max(0, Math.min(top + 14, stage.height - h))}px`;
  }
  // Description of the object under the pointer, in the frame shown.
  describe(found, frame) {
    const { run, k } = found;
    if (found.kind === "tip") return [`Tip of ${run.crackName(frame.get("t_crack")[k])}, ${["start", "end"][frame.get("t_end")[k]] || ""}`,
      `K_I ${withUnit(frame.get("t_k1")[k], "Pa √m")}`, `K_II ${withUnit(frame.get("t_k2")[k], "Pa √m")}`, `K_eq ${withUnit(frame.get("t_keq")[k], "Pa √m")}`];
    if (found.kind === "crack") return [run.crackName(found.crack), found.birth ? `grew in cycle ${found.birth}` : "drawn in the scene", `opening ${withUnit(frame.get("k_open")[k], "m")}`,
      `slip ${withUnit(frame.get("k_slip")[k], "m")}`, `normal traction ${withUnit(frame.get("k_n")[k], "Pa")}`, ["open", "sticks", "slips"][frame.get("k_state")[k]]];
    if (found.kind === "joint") return [`Joint of blocks ${found.pair.replace("|", " and ")}`, ["open", "sticks", "slips"][frame.get("c_state")[k]], `gap ${withUnit(frame.get("c_gap")[k], "m")}`,
      `slip ${withUnit(frame.get("c_slip")[k], "m")}`, `normal force ${withUnit(frame.get("c_n")[k], "N/m")}`, `shear force ${withUnit(frame.get("c_s")[k], "N/m")}`];
    if (found.kind === "monitor") {
      const at = nearest(run.curves.get("cycle"), frame.cycle);
      return [`Monitor ${found.point.name}`, ...["ux", "uy"].map((d) => `${d} ${withUnit((run.curves.get(`${found.point.name}_${d}`) || [])[at], "m")}`)];
    }
    if (found.kind === "bolt") return [`Bolt ${found.bolt.name}`, `force ${withUnit(boltForce(run, found.bolt.column, frame), "N/m")}`];
    const lines = [`Block ${found.id}`], field = this.field;
    const material = found.place !== null && found.place !== undefined && frame.blocks ? run.materials[frame.blocks.material[found.place]] : null;
    if (material) lines[0] += ` · ${material}`;
    if (field.category && found.place !== undefined && frame.blocks) { if (field.names) lines.push(field.names[field.category(frame, found.place)]); }
    else if (Number.isFinite(found.value)) lines.push(`${field.label.split(" ")[0]}${field.label.includes(",") ? field.label.slice(field.label.indexOf(",")) : ""} ${withUnit(this.sign * found.value, field.unit)}`);
    if (found.u) lines.push(`moved ${withUnit(Math.hypot(...found.u), "m")}`);
    lines.push(`x ${digits(found.x + run.origin[0], 5)}, y ${digits(found.y + run.origin[1], 5)} m`);
    return lines;
  }
  choose(drawing, found) {
    this.selected = null;
    if (found) this.selected = { ...found, ...this.historyOf(found, drawing.frame) };
    if (!this.selected || !this.selected.lines.length) { this.history.set([], "time", "s"); this.historyNote.replaceChildren(); }
    else {
      this.history.heading.replaceChildren(this.selected.title, " ");
      if (this.selected.choices) {
        const choice = this.select("", this.selected.choices.map((c) => ({ key: c.key, label: c.label })), this.selected.choices[0].key, (key) => {
          this.history.set(this.selected.choices.find((c) => c.key === key).lines, "time", "s"); this.redraw();
        });
        choice.input.setAttribute("aria-label", "history of"); choice.input.dataset.role = "history";
        this.history.heading.append(choice.input);
      }
      this.historyNote.replaceChildren(...this.describe(found, drawing.frame).slice(1).map((line) => el("span", {}, line)));
      this.history.set(this.selected.lines, "time", "s");
    }
    this.hint.hidden = !this.history.element.hidden;
    this.root.dataset.selected = this.selected ? this.selected.kind : "";
    this.redraw();
  }
  historyOf(found, frame) {
    const { run } = found, times = run.frames.map((f) => f.time), cycles = run.frames.map((f) => f.cycle);
    const make = (parts) => parts.map(([name, unit, y, x, own], k) => this.line(run, name, x || times, y, unit, k, own || cycles));
    const group = (title, place, choices) => ({ title, place, choices: choices.map(([key, label, parts]) => ({ key, label, lines: make(parts) })), lines: make(choices[0][2]) });
    if (found.kind === "tip") {
      const crack = frame.get("t_crack")[found.k], end = frame.get("t_end")[found.k], where = (f) => { const c = f.get("t_crack"), e = f.get("t_end"); return c ? c.findIndex((v, k) => v === crack && e[k] === end) : -1; };
      const rows = run.tips ? rowsOf(run.tips, { crack, end }) : [], col = (name) => rows.map((i) => run.tips.get(name)[i]);
      const place = (d, f) => { const k = where(f), p = d.tipPlaces(); return k >= 0 && p ? [p[2 * k], p[2 * k + 1]] : null; };
      return group(`Tip of ${run.crackName(crack)}, ${["start", "end"][end] || ""}`, place,
        [["K", "K_I, K_II, K_eq", [["K_I", "Pa √m", col("K_I"), col("time"), col("cycle")], ["K_II", "Pa √m", col("K_II"), col("time"), col("cycle")], ["K_eq", "Pa √m", col("K_eq"), col("time"), col("cycle")]]]]);
    }
    if (found.kind === "monitor") {
      const x = run.curves.get("time"), own = run.curves.get("cycle"), { point } = found;
      return group(`Monitor ${point.name}`, () => point.screen, [["u", "displacement", ["ux", "uy"].map((d) => [d, "m", run.curves.get(`${point.name}_${d}`), x, own])]]);
    }
    if (found.kind === "bolt") return group(`Bolt ${found.bolt.name}`, () => null, [["force", "force", [["force", "N/m", run.curves.get(found.bolt.column), run.curves.get("time"), run.curves.get("cycle")]]]]);
    if (found.kind === "crack") {
      const per = (name) => run.frames.map((f) => { const c = f.get("k_crack"), v = f.get(name), l = f.get("k_lines"); let top = NaN; if (c) for (let i = 0; i < c.length; i++) if (c[i] === found.crack) for (const p of [l[2 * i], l[2 * i + 1]]) if (Number.isFinite(v[p]) && !(Math.abs(v[p]) <= top)) top = Math.abs(v[p]); return top; });
      return group(run.crackName(found.crack), () => null, [["opening", "largest opening", [["opening", "m", per("k_open")]]], ["slip", "largest slip", [["slip", "m", per("k_slip")]]]]);
    }
    if (found.kind === "joint") {
      const rows = run.frames.map((f) => { const own = [], v = f.get("c_owner"); if (v && f.blocks) for (let i = 0; i < v.length; i++) if (pairOf(f, i) === found.pair) own.push(i); return own; });
      const over = (name, of) => run.frames.map((f, i) => (rows[i].length ? of(rows[i].map((r) => f.get(name)[r])) : NaN)), sum = (v) => v.reduce((a, b) => a + b, 0), largest = (v) => Math.max(...v.map(Math.abs));
      return group(`Joint of blocks ${found.pair.replace("|", " and ")}`, () => null, [["force", "forces", [["normal", "N/m", over("c_n", sum)], ["shear, sum of sizes", "N/m", over("c_s", (v) => sum(v.map(Math.abs)))]]],
        ["gap", "largest gap", [["gap", "m", over("c_gap", (v) => Math.max(...v))]]], ["slip", "largest slip", [["slip", "m", over("c_slip", largest)]]]]);
    }
    const id = found.id, at = run.frames.map((f) => (f.blocks && f.blocks.place.has(id) ? f.blocks.place.get(id) : -1));
    const mean = (name) => run.frames.map((f, i) => {
      const v = f.get(name);
      if (at[i] < 0) return NaN;
      if (!v) return 0;
      let s = 0, n = 0;
      for (let p = 0; p < v.length; p++) if (f.blocks.ofPoint[p] === at[i]) { s += v[p]; n++; }
      return n ? s / n : NaN;
    });
    const of = (name) => run.frames.map((f, i) => (at[i] < 0 ? NaN : f.get(name)[at[i]])), ux = mean("ux"), uy = mean("uy");
    const choices = [["u", "displacement", [["size", "m", ux.map((v, i) => Math.hypot(v, uy[i]))], ["ux", "m", ux], ["uy", "m", uy]]],
      ["s", "stress", [["σxx", "Pa", of("sxx")], ["σyy", "Pa", of("syy")], ["σxy", "Pa", of("sxy")]]]];
    if (run.has("vx")) { const vx = mean("vx"), vy = mean("vy"); choices.push(["v", "speed", [["speed", "m/s", vx.map((v, i) => Math.hypot(v, vy[i]))]]]); }
    return { ...group(`Block ${id}`, () => null, choices), kind: "block", id };
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || this.helpBox.open) return;
    const typed = event.target.tagName;
    if (typed === "TEXTAREA" || (typed === "INPUT" && event.target.type === "text")) return;
    if ((typed === "SELECT" || typed === "SUMMARY" || typed === "BUTTON") && [" ", "ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "Enter"].includes(event.key)) return;
    if (typed === "INPUT" && event.target.type === "range" && event.target !== this.slider && event.key.startsWith("Arrow")) return;
    if (typed === "SELECT" && /^[a-z]$/i.test(event.key)) return;
    const toggle = (name) => { if (this.boxes[name]) this.boxes[name].click(); };
    const fields = this.fieldsHere(), place = fields.findIndex((f) => f.key === this.field.key), far = event.shiftKey ? 10 : 1;
    const zoom = (factor) => { for (const d of this.drawings) { d.view.zoom(factor, d.width / 2, d.height / 2); d.fitted = false; } this.redraw(); };
    const actions = {
      " ": () => this.play(), ArrowLeft: () => { this.stop(); this.go(this.at - far); }, ArrowRight: () => { this.stop(); this.go(this.at + far); },
      Home: () => { this.stop(); this.go(0); }, End: () => { this.stop(); this.go(this.count - 1); }, "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), "−": () => zoom(0.8),
      0: () => { this.fit(); this.redraw(); }, f: () => this.setField(fields[(place + 1) % fields.length].key), F: () => this.setField(fields[(place + fields.length - 1) % fields.length].key),
      "[": () => this.setScale(this.scale / 2), "]": () => this.setScale(this.scale ? this.scale * 2 : 1), o: () => toggle("outlines"), c: () => toggle("cracks"), t: () => toggle("tips"),
      j: () => { if (this.jointInput) { const k = JOINT_FIELDS.indexOf(this.joints); this.joints = JOINT_FIELDS[(k + 1) % JOINT_FIELDS.length]; this.jointInput.value = this.joints.key; this.redraw(); } },
      r: () => this.rangeOfThis(), Escape: () => this.choose(this.drawings[0], null), "?": () => this.helpBox.showModal(),
    };
    if (actions[event.key]) { event.preventDefault(); actions[event.key](); }
  }

  // -- a run that goes on --------------------------------------------------------------------------------------
  async extend(records) {
    const follows = this.at >= this.count - 1;
    for (const [k, record] of records.entries()) {
      if (!record) continue;
      const run = this.runs[k];
      await run.append(record); await run.update(record);
      this.prepare(run);
    }
    for (const key of [...this.ranges.keys()]) if (!this.own.has(key)) this.ranges.delete(key);
    if (!this.scaleChosen) { this.scale = this.defaultScale(); this.writeScale(); }
    this.setTimeline();
    this.slider.max = String(this.count - 1);
    this.markEvents();
    if (this.featuresOf !== this.features()) {
      this.featuresOf = this.features();
      const fresh = this.controls();
      fresh.open = this.panel.open;
      this.panel.replaceWith(fresh);
      this.panel = fresh;
      this.buildCurveChoice(this.curve);
      this.chosen();
    } else if (this.curve) this.setCurve(this.curve, false);
    if (follows && !this.playing) this.at = this.count - 1;
    this.slider.value = String(this.at);
    if (this.drawings.every((d) => d.fitted)) { this.layout(); this.fit(); }
    this.writeRange();
    this.redraw();
  }
}

const most = (values) => (values || []).reduce((top, v) => (Math.abs(v) > top ? Math.abs(v) : top), 0);
function nearest(sorted, value) {  // row of the last number up to value; numbers go up
  if (!sorted) return -1;
  let low = 0, high = sorted.length - 1;
  while (low < high) { const m = (low + high + 1) >> 1; if (sorted[m] <= value) low = m; else high = m - 1; }
  return high < 0 ? -1 : low;
}
function boltForce(run, name, frame) {
  const forces = run.curves.get(name);
  return forces ? forces[nearest(run.curves.get("cycle"), frame.cycle)] : NaN;
}
function rowsOf(table, wanted) {
  const entries = Object.entries(wanted).map(([name, value]) => [table.get(name), value]), found = [];
  for (let k = 0; k < entries[0][0].length; k++) if (entries.every(([v, value]) => v[k] === value)) found.push(k);
  return found;
}

async function begin() {
  const root = document.getElementById("geomech-player");
  if (!root) return;
  const player = new Player(root, root.dataset.live);
  window.geomechPlayer = player;
  if (typeof DecompressionStream === "undefined") return player.say("This browser is too old to play the run: it needs Chrome 80, Firefox 113, Safari 16.4 or later. Everything below can be read.");
  try {
    if (root.dataset.live) await watch(player, root.dataset.live);
    else await player.open(JSON.parse(document.getElementById("geomech-runs").textContent));
  } catch (error) { player.say(`The run cannot be shown: ${error.message}`); throw error; }
}
// Asks the server for what is new, every second or two.
async function watch(player, address) {
  const ask = async () => {
    const known = player.runs.map((run) => `${run.frames.length},${run.meshes.length},${run.version}`).join(";");
    const answer = await fetch(`${address}&known=${encodeURIComponent(known)}`, { cache: "no-store" });
    if (!answer.ok) throw new RangeError((await answer.text()) || answer.statusText);
    return answer.json();
  };
  const rest = (seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));
  let answer = await ask();
  while (answer.waiting) { player.say(answer.waiting); await rest(1); answer = await ask(); }
  await player.open(answer.runs);
  let lost = 0;
  for (;;) {
    await rest(answer.more ? 0.02 : player.runs.every((run) => run.ended) ? 5 : 1.5);
    try {
      answer = await ask();
      if (answer.began_again) { location.reload(); return; }
      if (answer.runs && answer.runs.some(Boolean)) await player.extend(answer.runs);
      if (lost) player.say("");
      lost = 0;
    } catch (error) { if (++lost >= 2) player.say(error instanceof RangeError ? error.message : "The server no longer answers; the data received so far remain. To continue, start `geomech view` again and reload the page."); }
  }
}
begin();
