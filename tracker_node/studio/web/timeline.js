// Strips and curves over the time of a run, under one cursor.

import { clamp } from "/common.js";

const style = getComputedStyle(document.documentElement); // of palette.css
const STATES = ["initializing", "tracking", "degraded", "lost", "unseen"];
export const STATUS_COLOR = Object.fromEntries(STATES.map((state) => [state, style.getPropertyValue(`--${state}`).trim()]));
export const CURVE_COLORS = ["#1667c7", "#c2551e", "#7a3fb5", "#1d8a7a", "#b8336a", "#6b6b00"];
const WIDE = { left: 150, right: 56 }, NARROW = { left: 88, right: 44 }, NARROW_PX = 600;
const TOP = 8, STRIP = 14, LIMB = 9, GAP = 3, PLOT_GAP = 16;

/**
 * Draws { seconds, strips: [{name, colors[]}], plots: [{name, unit, curves: [{values, color, name}]}], cursor } on a canvas.
 * `onseek(row)` when somebody clicks or drags.
 */
export class Timeline {
  constructor(canvas, onseek) {
    this.canvas = canvas; this.data = null; this.cursor = 0;
    new ResizeObserver(() => this.draw()).observe(canvas.parentElement);
    let pressed = false;
    const seek = (event) => onseek(this.rowAt(event.clientX - canvas.getBoundingClientRect().left));
    canvas.addEventListener("pointerdown", (event) => { pressed = true; canvas.setPointerCapture(event.pointerId); seek(event); });
    canvas.addEventListener("pointermove", (event) => { if (pressed) seek(event); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { pressed = false; });
  }

  get n() { return this.data?.seconds.length ?? 0; }
  get margins() { return this.canvas.clientWidth < NARROW_PX ? NARROW : WIDE; }
  get left() { return this.margins.left; }
  get width() { return this.canvas.clientWidth - this.left - this.margins.right; }
  x(row) { return this.left + ((row + 0.5) / Math.max(this.n, 1)) * this.width; }
  rowAt(x) { return clamp(Math.floor(((x - this.left) / this.width) * this.n), 0, Math.max(this.n - 1, 0)); }

  draw() {
    const { canvas } = this, ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio); canvas.height = Math.round(canvas.clientHeight * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    if (!this.n) return;
    let y = TOP;
    for (const [i, strip] of this.data.strips.entries()) {
      const height = i ? LIMB : STRIP;
      this._strip(context, strip, y, height);
      y += height + GAP;
    }
    const below = canvas.clientHeight - y - 20, share = below / Math.max(this.data.plots.length, 1);
    for (const plot of this.data.plots) {
      this._plot(context, plot, y + 6, share - PLOT_GAP + 6);
      y += share;
    }
    this._times(context, canvas.clientHeight - 5);
    const x = this.x(this.cursor);
    context.fillStyle = "#111"; context.fillRect(x - 0.75, TOP - 4, 1.5, canvas.clientHeight - 22);
  }

  _strip(context, { name, colors }, y, height) {
    context.fillStyle = "#637083"; context.textAlign = "right"; context.textBaseline = "middle";
    context.fillText(name, this.left - 8, y + height / 2 + 0.5, this.left - 14);
    for (let from = 0; from < colors.length;) {
      let to = from + 1;
      while (to < colors.length && colors[to] === colors[from]) to++;
      context.fillStyle = colors[from];
      const left = this.x(from - 0.5), right = this.x(to - 0.5);
      context.fillRect(left, y, Math.max(right - left, 1.5), height); // a single set stays visible
      from = to;
    }
  }

  _plot(context, { name, unit, curves }, y, height) {
    const all = curves.flatMap(({ values }) => values.filter((value) => value !== null));
    let low = unit === "px" ? 0 : all.reduce((a, b) => Math.min(a, b), Infinity), high = all.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!all.length) { low = 0; high = 1; }
    if (high - low < 1e-9) { low -= 0.5; high += 0.5; }
    const at = (value) => y + height - ((value - low) / (high - low)) * height;
    context.strokeStyle = "#e6eaef"; context.lineWidth = 1;
    context.fillStyle = "#637083"; context.textBaseline = "middle"; context.textAlign = "left";
    for (const tick of ticks(low, high)) {
      context.beginPath(); context.moveTo(this.left, at(tick)); context.lineTo(this.left + this.width, at(tick)); context.stroke();
      context.fillText(`${+tick.toPrecision(6)} ${unit}`, this.left + this.width + 6, at(tick));
    }
    context.textAlign = "right";
    if (name) context.fillText(name, this.left - 8, y + height / 2, this.left - 14);
    curves.forEach(({ values, color, name: label }, i) => {
      if (label) { context.fillStyle = color; context.fillText(label, this.left - 8, y + 6 + 13 * i, this.left - 14); }
      context.strokeStyle = color; context.lineWidth = 1.4;
      context.beginPath();
      let drawing = false;
      values.forEach((value, row) => {
        if (value === null) { drawing = false; return; }
        if (drawing) context.lineTo(this.x(row), at(value)); else context.moveTo(this.x(row), at(value));
        drawing = true;
      });
      context.stroke();
      const here = values[this.cursor];
      if (here !== null && here !== undefined) {
        context.fillStyle = color; context.beginPath(); context.arc(this.x(this.cursor), at(here), 3, 0, 7); context.fill();
      }
    });
  }

  _times(context, y) {
    const { seconds } = this.data, last = seconds[this.n - 1];
    context.fillStyle = "#637083"; context.textBaseline = "alphabetic"; context.textAlign = "center";
    let row = 0;
    for (const tick of ticks(seconds[0], last, this.width < 400 ? 4 : 8)) {
      while (row < this.n - 1 && seconds[row] < tick - 1e-9) row++;
      context.fillText(`${+tick.toPrecision(6)} s`, this.x(row), y);
    }
  }
}

/** Round numbers between two limits. */
function ticks(low, high, most = 3) {
  const rough = (high - low) / most;
  if (!(rough > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(rough)), step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) ?? 10);
  const found = [];
  for (let tick = Math.ceil(low / step - 1e-9) * step; tick <= high + 1e-9; tick += step) found.push(Math.abs(tick) < step * 1e-6 ? 0 : tick);
  return found;
}
