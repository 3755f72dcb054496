"use strict";
// Curves with a line at the cycle that is shown; a click or a drag on them goes there.

const INKS = 8;  // colours of curves, --gm-curve-0 … in player.css

function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") made.className = value;
    else if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made && typeof value !== "string") made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}
function ticks(low, high, wanted) {
  const raw = (high - low) / Math.max(wanted, 1), power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((k) => k * power).find((s) => s >= raw * 0.999) || 10 * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(Math.abs(k * step) < 1e-9 * step ? 0 : k * step);
  return found;
}

// ``lines``: [{name, x, y, unit, colour}] in SI; ``go``: (x, line) → nothing, when the reader points there.
class Chart {
  constructor(title, go) {
    this.go = go; this.lines = [];
    this.canvas = el("canvas", { class: "gm-chart", role: "img", tabindex: "-1" });
    this.heading = el("div", { class: "gm-chart-title" }, title);
    this.keys = el("div", { class: "gm-keys" });
    this.element = el("div", { class: "gm-card" }, this.heading, this.canvas, this.keys);
    const point = (event) => {
      if (!this.area || !this.lines.length) return;
      const box = this.canvas.getBoundingClientRect(), { left, width, x0, x1 } = this.area;
      const x = x0 + (x1 - x0) * Math.min(1, Math.max(0, (event.clientX - box.left - left) / width));
      this.go(x * this.xUnit.factor);
    };
    this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); this.down = true; point(event); });
    this.canvas.addEventListener("pointermove", (event) => { if (this.down) point(event); });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => { this.down = false; });
  }
  set(lines, xName, xKind) {
    this.lines = lines.filter((line) => line.y && Array.prototype.some.call(line.y, Number.isFinite));
    this.xName = xName; this.xKind = xKind;
    this.keys.replaceChildren(...(this.lines.length > 1 ? this.lines.map((line) => {
      const swatch = el("span", { class: "gm-swatch" });
      swatch.style.background = `var(--gm-curve-${line.colour})`;
      if (line.dashed) swatch.classList.add("gm-dashed");
      return el("span", { class: "gm-key" }, swatch, line.name);
    }) : []));
    this.element.hidden = !this.lines.length;
  }
  draw(cursors, ink, font) {
    this.last = [cursors, ink, font];
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight, r = window.devicePixelRatio || 1;
    if (!width || !this.lines.length) return;
    this.canvas.width = Math.round(width * r); this.canvas.height = Math.round(height * r);
    const c = this.canvas.getContext("2d");
    c.setTransform(r, 0, 0, r, 0, 0);
    c.clearRect(0, 0, width, height);
    const range = (pick) => {
      let low = Infinity, high = -Infinity;
      for (const line of this.lines) for (const v of pick(line)) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
      return [low, high];
    };
    let [x0, x1] = range((line) => line.x), [y0, y1] = range((line) => line.y);
    if (y0 > 0 && y0 < 0.6 * y1) y0 = 0;
    if (y1 < 0 && y1 > 0.6 * y0) y1 = 0;
    if (!(y1 > y0)) { y1 = y0 + (Math.abs(y0) || 1) * 0.5; y0 -= (Math.abs(y0) || 1) * 0.5; }
    if (!(x1 > x0)) x1 = x0 + 1;
    const xUnit = this.xUnit = unitFor(this.xKind, Math.max(Math.abs(x0), Math.abs(x1)));
    const yUnit = unitFor(this.lines[0].unit, Math.max(Math.abs(y0), Math.abs(y1)));
    [x0, x1] = [x0 / xUnit.factor, x1 / xUnit.factor];
    [y0, y1] = [y0 / yUnit.factor, y1 / yUnit.factor];
    const pad = 0.04 * (y1 - y0);
    y0 -= pad; y1 += pad;
    c.font = `11px ${font}`;
    const yTicks = ticks(y0, y1, Math.max(2, height / 45));
    const left = 14 + Math.max(...yTicks.map((t) => c.measureText(digits(t)).width)) + 6, top = 18, right = 18, bottom = 34;
    const w = width - left - right, h = height - top - bottom;
    this.area = { left, width: w, x0, x1 };
    const px = (x) => left + w * (x - x0) / (x1 - x0), py = (y) => top + h * (1 - (y - y0) / (y1 - y0));
    c.lineWidth = 1; c.fillStyle = ink.soft; c.strokeStyle = ink.line; c.textBaseline = "middle"; c.textAlign = "right";
    for (const t of yTicks) {
      c.beginPath(); c.moveTo(left, py(t)); c.lineTo(left + w, py(t)); c.stroke();
      c.fillText(digits(t), left - 6, py(t));
    }
    c.textAlign = "center"; c.textBaseline = "top";
    for (const t of ticks(x0, x1, Math.max(2, w / 75))) {
      c.beginPath(); c.moveTo(px(t), top + h); c.lineTo(px(t), top + h + 4); c.strokeStyle = ink.soft; c.stroke();
      c.fillText(digits(t), px(t), top + h + 6);
    }
    c.fillText(this.xName + (xUnit.name ? `, ${xUnit.name}` : ""), left + w / 2, top + h + 20);
    c.textAlign = "left"; c.textBaseline = "top";
    c.fillText(yUnit.name || "", 4, 2);
    c.save(); c.beginPath(); c.rect(left - 1, top - 1, w + 2, h + 2); c.clip();
    c.lineJoin = "round";
    for (const line of this.lines) {
      c.strokeStyle = ink.curves[line.colour]; c.lineWidth = 1.7; c.setLineDash(line.dashed ? [5, 3] : []);
      c.beginPath();
      let pen = false;
      for (let k = 0; k < line.x.length; k++) {
        const x = line.x[k] / xUnit.factor, y = line.y[k] / yUnit.factor;
        if (!Number.isFinite(x) || !Number.isFinite(y)) { pen = false; continue; }
        if (pen) c.lineTo(px(x), py(y)); else c.moveTo(px(x), py(y));
        pen = true;
      }
      c.stroke();
    }
    c.setLineDash([]);
    c.restore();
    // The cycle that is shown, and the values there.
    const labels = [];
    for (const line of this.lines) {
      const k = line.row(cursors);
      if (k < 0 || k >= line.x.length || !Number.isFinite(line.x[k])) continue;
      const x = px(line.x[k] / xUnit.factor), y = py(line.y[k] / yUnit.factor);
      c.strokeStyle = ink.soft; c.lineWidth = 1; c.beginPath(); c.moveTo(x, top); c.lineTo(x, top + h); c.stroke();
      if (Number.isFinite(y)) {
        c.beginPath(); c.arc(x, y, 3.4, 0, 7); c.fillStyle = ink.curves[line.colour]; c.fill();
        labels.push([withUnit(line.y[k], line.unit), ink.curves[line.colour]]);
      }
    }
    if (labels.length && labels.length <= 4) {
      c.textAlign = "right"; c.textBaseline = "top";
      let end = left + w;
      for (const [text, colour] of labels.reverse()) { c.fillStyle = this.lines.length > 1 ? colour : ink.text; c.fillText(text, end, 2); end -= c.measureText(text).width + 12; }
    }
    this.canvas.setAttribute("aria-label", labels.map(([text]) => text).join(", "));
  }
}
