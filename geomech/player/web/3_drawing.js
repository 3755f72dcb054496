"use strict";
// Draws one cycle of a run: colours by filling triangles row by row, lines and words by the browser's own canvas.

// Fills triangles of an image with colours; ``image``: 32-bit pixels, row after row.
class Filler {
  constructor(width, height) {
    this.width = width; this.height = height;
    this.data = new ImageData(width, height);
    this.image = new Uint32Array(this.data.data.buffer);
  }
  clear() { this.image.fill(0); }
  // Rows of the triangle as spans of pixels whose middles lie in it.
  spans(ax, ay, bx, by, cx, cy, paint) {
    const top = Math.min(ay, by, cy), bottom = Math.max(ay, by, cy);
    const first = Math.max(0, Math.ceil(top - 0.5)), last = Math.min(this.height - 1, Math.ceil(bottom - 0.5) - 1);
    if (first > last || Math.max(ax, bx, cx) < 0 || Math.min(ax, bx, cx) > this.width) return;
    for (let row = first; row <= last; row++) {
      const y = row + 0.5;
      let left = Infinity, right = -Infinity;
      if ((ay <= y) !== (by <= y)) { const x = ax + (bx - ax) * (y - ay) / (by - ay); left = Math.min(left, x); right = Math.max(right, x); }
      if ((by <= y) !== (cy <= y)) { const x = bx + (cx - bx) * (y - by) / (cy - by); left = Math.min(left, x); right = Math.max(right, x); }
      if ((cy <= y) !== (ay <= y)) { const x = cx + (ax - cx) * (y - cy) / (ay - cy); left = Math.min(left, x); right = Math.max(right, x); }
      const from = Math.max(0, Math.ceil(left - 0.5)), to = Math.min(this.width, Math.ceil(right - 0.5));
      if (from < to) paint(row * this.width, from, to, y);
    }
  }
  plain(ax, ay, bx, by, cx, cy, colour) {
    const image = this.image;
    this.spans(ax, ay, bx, by, cx, cy, (row, from, to) => image.fill(colour, row + from, row + to));
  }
  // Values at the corners, in steps of the colours' table, spread linearly.
  shaded(ax, ay, bx, by, cx, cy, u, v, w, colours) {
    const whole = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    if (!whole) return;
    const gx = ((v - u) * (cy - ay) - (w - u) * (by - ay)) / whole;
    const gy = ((w - u) * (bx - ax) - (v - u) * (cx - ax)) / whole;
    const image = this.image, low = Math.min(u, v, w), high = Math.max(u, v, w);
    this.spans(ax, ay, bx, by, cx, cy, (row, from, to, y) => {
      let value = u + gx * (from + 0.5 - ax) + gy * (y - ay);
      for (let x = from; x < to; x++, value += gx) {
        const held = value < low ? low : value > high ? high : value;
        image[row + x] = colours[held < 0 ? 0 : held > 255 ? 255 : held | 0];
      }
    });
  }
}

// Where the model is on the canvas: x right, y up, in pixels of the screen.
class View {
  constructor() { this.scale = 1; this.x = 0; this.y = 0; }
  fit(box, width, height, margin) {
    const [x0, x1, y0, y1] = box;
    this.scale = Math.min((width - 2 * margin) / Math.max(x1 - x0, 1e-12), (height - 2 * margin) / Math.max(y1 - y0, 1e-12));
    this.x = width / 2 - this.scale * (x0 + x1) / 2;
    this.y = height / 2 + this.scale * (y0 + y1) / 2;
  }
  zoom(factor, px, py) {
    this.x = px + (this.x - px) * factor;
    this.y = py + (this.y - py) * factor;
    this.scale *= factor;
  }
}

class Drawing {
  constructor(run, canvas) {
    this.run = run; this.canvas = canvas; this.view = new View();
    this.context = canvas.getContext("2d");
    this.layer = document.createElement("canvas");
  }
  resize(width, height, ratio) {
    this.width = width; this.height = height; this.ratio = ratio;
    this.canvas.width = Math.round(width * ratio); this.canvas.height = Math.round(height * ratio);
    this.layer.width = this.canvas.width; this.layer.height = this.canvas.height;
    this.filler = new Filler(this.canvas.width, this.canvas.height);
  }
  // Places of points on the screen, in the canvas's own pixels.
  placed(x, y, ux, uy, scale) {
    const out = new Float64Array(2 * x.length), { view: v, ratio: r } = this;
    const a = v.scale * r, ox = v.x * r, oy = v.y * r;
    for (let k = 0; k < x.length; k++) {
      out[2 * k] = ox + a * (x[k] + (ux ? scale * ux[k] : 0));
      out[2 * k + 1] = oy - a * (y[k] + (uy ? scale * uy[k] : 0));
    }
    return out;
  }
  at(x, y) { return [this.ratio * (this.view.x + this.view.scale * x), this.ratio * (this.view.y - this.view.scale * y)]; }
  // How far a point that is fixed to the rock has moved.
  moved(frame, point) {
    if (!frame.blocks) return [0, 0];
    point.places = point.places || new Map();
    if (!point.places.has(frame.blocks)) point.places.set(frame.blocks, frame.blocks.attach(point.x, point.y));
    const { at, share } = point.places.get(frame.blocks), ux = frame.get("ux"), uy = frame.get("uy");
    return [0, 1, 2].reduce((sum, c) => [sum[0] + share[c] * ux[at[c]], sum[1] + share[c] * uy[at[c]]], [0, 0]);
  }
  // The box of what is drawn over some cycles.
  box(scale) {
    const key = `${scale}|${this.run.frames.length}`;
    if (this.boxOf !== key) { this.boxOf = key; this.boxIs = this.findBox(scale); }
    return this.boxIs;
  }
  findBox(scale) {
    const box = [Infinity, -Infinity, Infinity, -Infinity];
    const take = (x, y, ux, uy) => {
      for (let k = 0; k < x.length; k++) {
        const px = x[k] + scale * ux[k], py = y[k] + scale * uy[k];
        if (px < box[0]) box[0] = px; if (px > box[1]) box[1] = px;
        if (py < box[2]) box[2] = py; if (py > box[3]) box[3] = py;
      }
    };
    const frames = this.run.frames, step = Math.max(1, Math.floor(frames.length / 8));
    frames.forEach((f, k) => {
      if (k % step && k !== frames.length - 1) return;
      if (f.blocks) take(f.blocks.x, f.blocks.y, f.get("ux"), f.get("uy"));
      if (f.rock) take(f.rock.x, f.rock.y, f.get("iux"), f.get("iuy"));
      if (f.get("k_x")) take(f.get("k_x"), f.get("k_y"), f.get("k_ux"), f.get("k_uy"));
    });
    return Number.isFinite(box[0]) ? box : [-1, 1, -1, 1];
  }

  draw(frame, look) {
    const c = this.context, r = this.ratio;
    this.frame = frame; this.look = look;
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.fillStyle = look.ink.page;
    c.fillRect(0, 0, this.canvas.width, this.canvas.height);
    this.blockPoints = frame.blocks && this.placed(frame.blocks.x, frame.blocks.y, frame.get("ux"), frame.get("uy"), look.scale);
    this.rockPoints = frame.rock && this.placed(frame.rock.x, frame.rock.y, frame.get("iux"), frame.get("iuy"), look.scale);
    this.fill();
    c.lineJoin = c.lineCap = "round";
    if (look.shown.reference && frame.blocks) this.referenceOutlines();
    if (look.shown.outlines) this.outlines();
    if (look.joints.key !== "none" && frame.get("faces") && frame.blocks) this.joints();
    if (look.shown.cracks) this.cracks();
    if (look.shown.forces && frame.get("c_fx")) this.forces();
    if (look.shown.water && frame.get("w_x")) this.water();
    if (look.shown.bolts) this.bolts();
    if (look.shown.events) this.eventsHere();
    if (look.shown.tips) this.tips();
    if (look.shown.monitors) this.monitors();
    if (look.selected && look.selected.run === this.run) this.selection(look.selected);
    this.scaleBar();
    c.setTransform(1, 0, 0, 1, 0, 0);
    return r;
  }

  fill() {
    const { frame, look, filler } = this, field = look.field;
    filler.clear();
    const idle = packed(channels(look.ink.idle)), { low, high, colours } = look.fill;
    const steps = 256 / (high - low), values = valuesOf(frame, field);
    if (frame.blocks) {
      const m = frame.blocks, p = this.blockPoints, t = m.triangles, removed = frame.get("removed");
      const colour = new Array(m.block.length);
      for (let b = 0; b < colour.length; b++) {
        if (removed[b]) { colour[b] = 0; continue; }
        if (!isFilled(this.run, frame, b, field)) colour[b] = idle;
        else if (field.category) colour[b] = packed(channels(CLASSES[field.category(frame, b) % CLASSES.length]));
        else if (values.blocks) colour[b] = colours[Math.max(0, Math.min(255, (values.blocks[b] - low) * steps | 0))];
        else colour[b] = null;  // shaded between its points
        if (frame.solved.has(m.block[b]) && (values.rockPoints || field.key === "none")) colour[b] = 0;
      }
      const v = values.blockPoints;
      for (let k = 0, i = 0; k < m.owner.length; k++, i += 3) {
        const is = colour[m.owner[k]];
        if (is === 0) continue;
        const a = t[i], b = t[i + 1], d = t[i + 2];
        if (is !== null) filler.plain(p[2 * a], p[2 * a + 1], p[2 * b], p[2 * b + 1], p[2 * d], p[2 * d + 1], is);
        else filler.shaded(p[2 * a], p[2 * a + 1], p[2 * b], p[2 * b + 1], p[2 * d], p[2 * d + 1],
          (v[a] - low) * steps, (v[b] - low) * steps, (v[d] - low) * steps, colours);
      }
    }
    if (frame.rock && (values.rockPoints || field.key === "none")) {
      const m = frame.rock, p = this.rockPoints, t = m.triangles, v = values.rockPoints;
      for (let i = 0; i < t.length; i += 3) {
        const a = t[i], b = t[i + 1], d = t[i + 2];
        if (!v) filler.plain(p[2 * a], p[2 * a + 1], p[2 * b], p[2 * b + 1], p[2 * d], p[2 * d + 1], idle);
        else filler.shaded(p[2 * a], p[2 * a + 1], p[2 * b], p[2 * b + 1], p[2 * d], p[2 * d + 1],
          (v[a] - low) * steps, (v[b] - low) * steps, (v[d] - low) * steps, colours);
      }
    }
    this.layer.getContext("2d").putImageData(filler.data, 0, 0);
    this.context.drawImage(this.layer, 0, 0);
  }
  // Strokes outlines a hundred at a time: a browser takes far longer over one path of thousands.
  loops(points, skip) {
    const m = this.frame.blocks, c = this.context, { width, height } = this.canvas;
    let gathered = 0;
    c.beginPath();
    for (let k = 0; k + 1 < m.starts.length; k++) {
      if (skip(m.loop_block[k])) continue;
      const first = m.starts[k], last = m.starts[k + 1];
      let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
      for (let i = first; i < last; i++) {
        const x = points[2 * m.corners[i]], y = points[2 * m.corners[i] + 1];
        if (x < x0) x0 = x; if (x > x1) x1 = x; if (y < y0) y0 = y; if (y > y1) y1 = y;
      }
      if (x1 < 0 || x0 > width || y1 < 0 || y0 > height) continue;
      for (let i = first; i < last; i++) {
        const at = 2 * m.corners[i];
        if (i === first) c.moveTo(points[at], points[at + 1]); else c.lineTo(points[at], points[at + 1]);
      }
      c.closePath();
      if (++gathered % 100 === 0) { c.stroke(); c.beginPath(); }
    }
    c.stroke();
  }
  referenceOutlines() {
    const { frame, context: c } = this, m = frame.blocks;
    c.setLineDash([4 * this.ratio, 4 * this.ratio]);
    c.lineWidth = 0.8 * this.ratio; c.strokeStyle = this.look.ink.soft;
    this.loops(this.placed(m.x, m.y), () => false);
    c.setLineDash([]);
  }
  outlines() {
    const { frame, context: c } = this;
    c.strokeStyle = this.look.ink.outline;
    const blocks = frame.blocks ? frame.blocks.block.length : 0;
    // Thin where blocks are small on the screen, so that lines do not hide colours.
    const size = Math.sqrt(this.run.size[0] * this.run.size[1] / Math.max(blocks, 1)) * this.view.scale;
    c.lineWidth = Math.max(0.35, Math.min(1.3, size / 22)) * this.ratio;
    if (frame.blocks) {
      const removed = frame.get("removed"), m = frame.blocks;
      this.loops(this.blockPoints, (b) => removed[b] || (this.rockPoints && frame.solved.has(m.block[b])));
    }
    if (frame.rock) {
      const e = frame.rock.edges, p = this.rockPoints;
      c.lineWidth = 1.2 * this.ratio;
      c.beginPath();
      for (let k = 0; k < e.length; k += 2) { c.moveTo(p[2 * e[k]], p[2 * e[k] + 1]); c.lineTo(p[2 * e[k + 1]], p[2 * e[k + 1] + 1]); if (k % 800 === 798) { c.stroke(); c.beginPath(); } }
      c.stroke();
    }
  }
  // Line pieces, gathered by colour so that each colour is one stroke.
  strokes(pieces, width) {
    const c = this.context;
    c.lineWidth = width * this.ratio;
    for (const [colour, lines] of pieces) {
      c.strokeStyle = colour; c.beginPath();
      for (let k = 0; k < lines.length; k += 4) {
        c.moveTo(lines[k], lines[k + 1]); c.lineTo(lines[k + 2], lines[k + 3]);
        if (k % 800 === 796) { c.stroke(); c.beginPath(); }
      }
      c.stroke();
    }
  }
  lineColour(field, range, k) {
    if (field.names) return STATES[this.frame.get(field.array || "c_state")[k]] || STATES[0];
    const share = (field.value(this.frame, k) - range[0]) / (range[1] - range[0]);
    return css(ramp(SIZES, Number.isFinite(share) ? Math.round(24 * share) / 24 : 0));
  }
  joints() {
    const { frame, look, context: c } = this, faces = frame.get("faces"), at = frame.get("c_vertex"), p = this.blockPoints;
    const pieces = new Map(), field = look.joints;
    for (let k = 0; k < faces.length; k += 2) {
      const a = at[faces[k]], b = at[faces[k + 1]];
      const mean = [0, 1].map((i) => faces[k + i]);
      const worse = field.names ? Math.max(...mean.map((i) => frame.get("c_state")[i]))
        : 0.5 * (field.value(frame, mean[0]) + field.value(frame, mean[1]));
      const share = field.names ? 0 : (worse - look.jointRange[0]) / (look.jointRange[1] - look.jointRange[0]);
      const colour = field.names ? STATES[worse] : css(ramp(SIZES, Math.round(24 * share) / 24));
      if (!field.names && share < 0.02) continue;  // nothing to see: the outline stays as it is
      if (!pieces.has(colour)) pieces.set(colour, []);
      pieces.get(colour).push(p[2 * a], p[2 * a + 1], p[2 * b], p[2 * b + 1]);
    }
    c.lineCap = "butt";  // round ends of thousands of lines take several times as long
    this.strokes(pieces, 2.6);
    c.lineCap = "round";
  }
  crackPoints() {
    const { frame, look } = this, x = frame.get("k_x"), y = frame.get("k_y");
    if (!x) return null;
    return [this.placed(x, y, frame.get("k_ux"), frame.get("k_uy"), look.scale), this.placed(x, y, frame.get("k_lx"), frame.get("k_ly"), look.scale)];
  }
  cracks() {
    const { frame, look, context: c } = this, faces = this.crackPoints();
    if (!faces) return;
    const [upper, lower] = faces, lines = frame.get("k_lines"), birth = frame.get("k_birth"), field = look.cracks;
    const r = this.ratio, pieces = new Map(), gaps = new Map();
    c.lineWidth = 5 * r; c.strokeStyle = look.ink.halo; c.beginPath();
    for (let k = 0; k < lines.length; k += 2) {
      const a = 2 * lines[k], b = 2 * lines[k + 1];
      c.moveTo((upper[a] + lower[a]) / 2, (upper[a + 1] + lower[a + 1]) / 2);
      c.lineTo((upper[b] + lower[b]) / 2, (upper[b + 1] + lower[b + 1]) / 2);
    }
    c.stroke();
    for (let k = 0; k < lines.length; k += 2) {
      const a = lines[k], b = lines[k + 1], old = birth[k / 2] === 0;
      const colour = field.key === "plain" || !look.crackRange ? look.ink.crack
        : field.key === "birth" ? (old ? look.ink.crack : css(ramp(LINES, (birth[k / 2] - look.crackRange[0]) / (look.crackRange[1] - look.crackRange[0]))))
          : this.lineColour(field, look.crackRange, a);
      const wide = Math.hypot(upper[2 * a] - lower[2 * a], upper[2 * a + 1] - lower[2 * a + 1])
        + Math.hypot(upper[2 * b] - lower[2 * b], upper[2 * b + 1] - lower[2 * b + 1]);
      if (wide > 2 * r) {
        if (!gaps.has(colour)) gaps.set(colour, []);
        gaps.get(colour).push([upper[2 * a], upper[2 * a + 1], upper[2 * b], upper[2 * b + 1], lower[2 * b], lower[2 * b + 1], lower[2 * a], lower[2 * a + 1]]);
      }
      if (!pieces.has(colour)) pieces.set(colour, []);
      pieces.get(colour).push((upper[2 * a] + lower[2 * a]) / 2, (upper[2 * a + 1] + lower[2 * a + 1]) / 2, (upper[2 * b] + lower[2 * b]) / 2, (upper[2 * b + 1] + lower[2 * b + 1]) / 2);
    }
    for (const [colour, quads] of gaps) {
      c.fillStyle = c.strokeStyle = colour; c.lineWidth = 0.8 * r; c.beginPath();
      for (const q of quads) { c.moveTo(q[0], q[1]); for (let i = 2; i < 8; i += 2) c.lineTo(q[i], q[i + 1]); c.closePath(); }
      c.fill(); c.stroke();  // the line closes the seams between neighbours
    }
    this.strokes(pieces, 2.4);
  }
  tipPlaces() {
    const { frame, look } = this;
    const x = frame.get("t_x");
    return x ? this.placed(x, frame.get("t_y"), frame.get("t_ux"), frame.get("t_uy"), look.scale) : null;
  }
  tips() {
    const { frame, look, context: c, ratio: r } = this, p = this.tipPlaces();
    if (!p) return;
    const k1 = frame.get("t_k1"), k2 = frame.get("t_k2"), grown = frame.get("t_grown"), n = k1.length;
    for (let k = 0; k < n; k++) {
      c.beginPath(); c.arc(p[2 * k], p[2 * k + 1], 4.2 * r, 0, 7);
      c.fillStyle = grown[k] > 0 ? look.ink.growing : look.ink.page; c.fill();
      c.lineWidth = 1.6 * r; c.strokeStyle = look.ink.text; c.stroke();
    }
    if (look.shown.labels) {
      // Of many tips the ten that are nearest to growing.
      const order = Array.from({ length: n }, (_, k) => k).sort((a, b) => frame.get("t_keq")[b] - frame.get("t_keq")[a]).slice(0, 10);
      for (const k of order) {
        const largest = Math.max(Math.abs(k1[k]), Math.abs(k2[k]), 1) / 1e6, places = Math.min(6, Math.max(0, 2 - Math.floor(Math.log10(largest))));
        const text = `K_I ${(k1[k] / 1e6).toFixed(places)}  K_II ${(k2[k] / 1e6).toFixed(places)} MPa √m`.replace(/-/g, "−");
        // Words go outwards from the middle of the drawing.
        this.label(text, p[2 * k], p[2 * k + 1], p[2 * k] < this.canvas.width / 2 ? -1 : 1);
      }
    }
  }
  label(text, x, y, side) {
    const { context: c, ratio: r, look } = this;
    c.font = `${11 * r}px ${look.font}`; c.textBaseline = "middle";
    const width = c.measureText(text).width + 10 * r, high = 18 * r;
    let left = side > 0 ? x + 9 * r : x - 9 * r - width;
    left = Math.max(2 * r, Math.min(left, this.canvas.width - width - 2 * r));
    c.fillStyle = look.ink.card; c.strokeStyle = look.ink.line; c.lineWidth = r;
    c.beginPath(); c.roundRect(left, y - high / 2, width, high, 4 * r); c.fill(); c.stroke();
    c.fillStyle = look.ink.text; c.textAlign = "left"; c.fillText(text, left + 5 * r, y);
  }
  forces() {
    const { frame, look, context: c, ratio: r } = this, fx = frame.get("c_fx"), fy = frame.get("c_fy"), at = frame.get("c_vertex"), p = this.blockPoints;
    const most = look.forceRange || 1e-30, long = 0.06 * Math.min(this.canvas.width, this.canvas.height);
    c.strokeStyle = c.fillStyle = look.ink.force; c.lineWidth = 1.1 * r;
    for (let k = 0; k < fx.length; k++) {
      const size = Math.hypot(fx[k], fy[k]) / most;
      if (!(size > 0.02)) continue;
      const length = long * Math.min(size, 1.5), dx = fx[k] / Math.hypot(fx[k], fy[k]), dy = -fy[k] / Math.hypot(fx[k], fy[k]);
      // The arrow pushes the block that owns the corner: its point is at the corner.
      arrow(c, p[2 * at[k]] - dx * length, p[2 * at[k] + 1] - dy * length, p[2 * at[k]], p[2 * at[k] + 1], 4 * r);
    }
  }
  water() {
    const { frame, look } = this, lines = frame.get("w_lines"), found = [];
    const p = this.placed(frame.get("w_x"), frame.get("w_y"), frame.get("w_ux"), frame.get("w_uy"), look.scale);
    for (let k = 0; k < lines.length; k += 2) found.push(p[2 * lines[k]], p[2 * lines[k] + 1], p[2 * lines[k + 1]], p[2 * lines[k + 1] + 1]);
    this.strokes(new Map([[look.ink.halo, found]]), 4.5);
    this.strokes(new Map([[look.ink.water, found]]), 2);
  }
  bolts() {
    const { frame, look, context: c, ratio: r } = this;
    for (const bolt of this.run.bolts || []) {
      const ends = [bolt.from, bolt.to].map((end) => {
        const [ux, uy] = end.ground ? [0, 0] : this.moved(frame, end);
        return this.at(end.x + look.scale * ux, end.y + look.scale * uy);
      });
      c.lineWidth = 3.4 * r; c.strokeStyle = look.ink.halo;
      c.beginPath(); c.moveTo(...ends[0]); c.lineTo(...ends[1]); c.stroke();
      const force = look.boltForce(this.run, bolt.column, frame), share = look.boltMost ? Math.abs(force || 0) / look.boltMost : 0;
      c.lineWidth = 2.2 * r; c.strokeStyle = css(ramp(["#7a7f87", "#0072B2", "#D55E00"], share));
      c.beginPath(); c.moveTo(...ends[0]); c.lineTo(...ends[1]); c.stroke();
      bolt.screen = ends;
    }
  }
  monitors() {
    const { frame, look, context: c, ratio: r } = this;
    for (const point of this.run.monitors) {
      const [ux, uy] = this.moved(frame, point), [x, y] = this.at(point.x + look.scale * ux, point.y + look.scale * uy);
      point.screen = [x, y];
      c.beginPath(); c.moveTo(x, y); c.lineTo(x - 5 * r, y - 9 * r); c.lineTo(x + 5 * r, y - 9 * r); c.closePath();
      c.fillStyle = look.ink.force; c.fill(); c.strokeStyle = look.ink.page; c.lineWidth = r; c.stroke();
    }
  }
  eventsHere() {
    const { context: c, ratio: r, look, frame } = this;
    for (const [kind, cycle, , x, y] of this.run.events) {
      if (cycle > frame.cycle || cycle < frame.cycle - this.run.gapBefore(frame) || x === null) continue;
      const [px, py] = this.at(x, y);
      c.beginPath(); c.arc(px, py, 9 * r, 0, 7); c.lineWidth = 2 * r; c.strokeStyle = look.ink.growing; c.stroke();
      this.label(kind, px, py - 18 * r, px < this.canvas.width / 2 ? 1 : -1);
    }
  }
  selection(selected) {
    const { frame, context: c, ratio: r, look } = this;
    c.strokeStyle = look.ink.select; c.lineWidth = 2.6 * r;
    const place = selected.place(this, frame);
    if (selected.kind === "block" && frame.blocks && frame.blocks.place.has(selected.id)) {
      const own = frame.blocks.place.get(selected.id);
      this.loops(this.blockPoints, (b) => b !== own);
    } else if (selected.kind === "joint" && frame.get("faces")) {
      const { pair } = selected, faces = frame.get("faces"), at = frame.get("c_vertex"), p = this.blockPoints;
      c.lineWidth = 4 * r; c.beginPath();
      for (let k = 0; k < faces.length; k += 2) {
        if (pairOf(frame, faces[k]) !== pair) continue;
        c.moveTo(p[2 * at[faces[k]]], p[2 * at[faces[k]] + 1]); c.lineTo(p[2 * at[faces[k + 1]]], p[2 * at[faces[k + 1]] + 1]);
      }
      c.stroke();
    } else if (place) { c.beginPath(); c.arc(place[0], place[1], 9 * r, 0, 7); c.stroke(); }
  }
  scaleBar() {
    const { context: c, ratio: r, look } = this, metres = 110 / this.view.scale;
    const power = 10 ** Math.floor(Math.log10(metres)), long = [5, 2, 1].map((k) => k * power).find((m) => m <= metres);
    const width = long * this.view.scale * r, x = 14 * r, y = this.canvas.height - 14 * r;
    c.strokeStyle = c.fillStyle = look.ink.text; c.lineWidth = 1.4 * r; c.lineCap = "butt";
    c.beginPath(); c.moveTo(x, y - 5 * r); c.lineTo(x, y); c.lineTo(x + width, y); c.lineTo(x + width, y - 5 * r); c.stroke();
    c.font = `${11.5 * r}px ${look.font}`; c.textAlign = "center"; c.textBaseline = "bottom";
    c.lineWidth = 3 * r; c.strokeStyle = look.ink.page;
    const text = withUnit(long, "m", 3);
    c.strokeText(text, x + width / 2, y - 4 * r); c.fillText(text, x + width / 2, y - 4 * r);
    c.lineCap = "round";
  }

  // What lies under a point of the screen (its own pixels): the finest thing first.
  pick(px, py) {
    const { frame, look, ratio: r } = this, x = px * r, y = py * r;
    if (!frame) return null;
    const near = (points, reach) => {
      let best = -1, least = (reach * r) ** 2;
      for (let k = 0; points && k < points.length / 2; k++) {
        const d = (points[2 * k] - x) ** 2 + (points[2 * k + 1] - y) ** 2;
        if (d < least) { least = d; best = k; }
      }
      return best;
    };
    const run = this.run;
    if (look.shown.monitors) for (const point of run.monitors) {
      if (point.screen && Math.hypot(point.screen[0] - x, point.screen[1] - 5 * r - y) < 9 * r) return { kind: "monitor", point, run };
    }
    if (look.shown.tips) { const k = near(this.tipPlaces(), 10); if (k >= 0) return { kind: "tip", k, run }; }
    if (look.shown.bolts) for (const bolt of run.bolts || []) {
      if (bolt.screen && toSegment(x, y, ...bolt.screen[0], ...bolt.screen[1]) < 6 * r) return { kind: "bolt", bolt, run };
    }
    if (look.shown.cracks) {
      const faces = this.crackPoints();
      if (faces) {
        const lines = frame.get("k_lines"), [u, l] = faces;
        for (let k = 0; k < lines.length; k += 2) {
          const a = lines[k], b = lines[k + 1];
          const d = toSegment(x, y, (u[2 * a] + l[2 * a]) / 2, (u[2 * a + 1] + l[2 * a + 1]) / 2, (u[2 * b] + l[2 * b]) / 2, (u[2 * b + 1] + l[2 * b + 1]) / 2);
          if (d < 5 * r) return { kind: "crack", k: a, crack: frame.get("k_crack")[k / 2], birth: frame.get("k_birth")[k / 2], run };
        }
      }
    }
    if (frame.get("faces") && frame.blocks) {
      const faces = frame.get("faces"), at = frame.get("c_vertex"), p = this.blockPoints;
      let best = null, least = 5 * r;
      for (let k = 0; k < faces.length; k += 2) {
        const a = at[faces[k]], b = at[faces[k + 1]];
        const d = toSegment(x, y, p[2 * a], p[2 * a + 1], p[2 * b], p[2 * b + 1]);
        if (d < least) { least = d; best = faces[k]; }
      }
      if (best !== null) return { kind: "joint", k: best, pair: pairOf(frame, best), run };
    }
    return this.pickRock(x, y);
  }
  pickRock(x, y) {
    const { frame, look, run } = this, values = valuesOf(frame, look.field);
    const find = (mesh, p) => {
      const t = mesh.triangles;
      for (let i = 0; i < t.length; i += 3) {
        const a = 2 * t[i], b = 2 * t[i + 1], c = 2 * t[i + 2];
        if (x < Math.min(p[a], p[b], p[c]) || x > Math.max(p[a], p[b], p[c])) continue;
        const share = within(p[a], p[a + 1], p[b], p[b + 1], p[c], p[c + 1], x, y);
        if (share) return { triangle: i / 3, share, at: [t[i], t[i + 1], t[i + 2]] };
      }
      return null;
    };
    const mean = (v, hit) => v ? hit.at.reduce((sum, k, c) => sum + hit.share[c] * v[k], 0) : NaN;
    if (frame.rock) {
      const hit = find(frame.rock, this.rockPoints);
      if (hit) {
        const place = frame.blocks && frame.blocks.place.get(frame.rock.owner[hit.triangle]);
        return { kind: "block", id: frame.rock.owner[hit.triangle], place, value: mean(values.rockPoints, hit), run,
          x: mean(frame.rock.x, hit), y: mean(frame.rock.y, hit), u: [mean(frame.get("iux"), hit), mean(frame.get("iuy"), hit)] };
      }
    }
    if (!frame.blocks) return null;
    const hit = find(frame.blocks, this.blockPoints);
    if (!hit) return null;
    const b = frame.blocks.owner[hit.triangle];
    if (frame.get("removed")[b]) return null;
    return { kind: "block", id: frame.blocks.block[b], place: b, run, x: mean(frame.blocks.x, hit), y: mean(frame.blocks.y, hit),
      value: values.blocks ? values.blocks[b] : mean(values.blockPoints, hit), u: [mean(frame.get("ux"), hit), mean(frame.get("uy"), hit)] };
  }
}

function arrow(c, x0, y0, x1, y1, head) {
  const angle = Math.atan2(y1 - y0, x1 - x0);
  c.beginPath(); c.moveTo(x0, y0); c.lineTo(x1, y1); c.stroke();
  c.beginPath(); c.moveTo(x1, y1);
  c.lineTo(x1 - head * Math.cos(angle - 0.42), y1 - head * Math.sin(angle - 0.42));
  c.lineTo(x1 - head * Math.cos(angle + 0.42), y1 - head * Math.sin(angle + 0.42));
  c.closePath(); c.fill();
}
function toSegment(x, y, ax, ay, bx, by) {
  const dx = bx - ax, dy = by - ay, long = dx * dx + dy * dy;
  const share = long ? Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / long)) : 0;
  return Math.hypot(x - ax - share * dx, y - ay - share * dy);
}
// Two blocks that touch, by their numbers in the run.
function pairOf(frame, contact) {
  const block = frame.blocks.block, a = block[frame.get("c_owner")[contact]], b = block[frame.get("c_other")[contact]];
  return a < b ? `${a}|${b}` : `${b}|${a}`;
}
