// What all pages share: requests, messages, and a view of an image that zooms and pans under its overlays.

/** An element; attributes of the name of a property that is a function are listeners. */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

let asked = 0; // requests on their way; the page says so, to people and to tests

/** JSON of the server: GET, or POST where there is a body; what it refuses is an Error in its words. */
export async function request(path, body = undefined) {
  document.body.setAttribute("aria-busy", String(++asked > 0));
  try {
    return await answered(path, body);
  } finally {
    document.body.setAttribute("aria-busy", String(--asked > 0));
  }
}

async function answered(path, body) {
  const options = body === undefined ? {} : { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new Error("the studio does not answer: has it ended?");
  }
  const text = await response.text();
  let answer;
  try { answer = JSON.parse(text); } catch { answer = { error: text }; }
  if (!response.ok) throw new Error(answer.error || response.statusText);
  return answer;
}

let messageTimer;
/** Say something at the foot of the page for some seconds. */
export function say(text, kind = "") {
  document.querySelector(".message")?.remove();
  document.body.append(make("div", { class: `message ${kind}`, role: "status" }, text));
  clearTimeout(messageTimer);
  messageTimer = setTimeout(() => document.querySelector(".message")?.remove(), kind === "bad" ? 9000 : 4000);
}

/** Run something that may fail, and say why where it does. */
export async function attempt(action) {
  try {
    return await action();
  } catch (error) {
    say(error.message, "bad");
    return undefined;
  }
}

/** Whether a key press is meant for a field that is being edited. */
export function isTyping(event) {
  const target = event.target;
  return target.matches?.("input:not([type=range]):not([type=checkbox]), textarea, select") || target.closest?.("dialog") !== null;
}

/** Columns and rows for n views of this aspect (width / height) in a box, such that they are largest. */
export function layoutViews(container, n, aspect) {
  const { width, height } = container.getBoundingClientRect();
  let best = [1, 0];
  for (let columns = 1; columns <= n; columns++) {
    const rows = Math.ceil(n / columns);
    const size = Math.min(width / columns / aspect, height / rows);
    if (size > best[1]) best = [columns, size];
  }
  container.style.gridTemplateColumns = `repeat(${best[0]}, minmax(0, 1fr))`;
  container.style.gridTemplateRows = `repeat(${Math.ceil(n / best[0])}, minmax(0, 1fr))`;
}

/**
 * A camera's image with overlays. Coordinates are image pixels, integers at pixel centers.
 *
 * view.overlays: functions (context, view), called with a context that draws in image pixels; view.px(n) is the length there of n
 * pixels of the screen. view.onpress(pixel, event) may return true to have the drag for itself: view.ondrag(pixel, event), once the
 * pointer has moved, and view.onrelease(pixel, event) then follow; else it pans. view.onhover(pixel, event), view.onleave(), view.onclick(pixel, event): a
 * press that did not move. Wheel and + - zoom, 0 fits, Alt with arrows pans, a double click fits.
 */
export class ImageView {
  constructor(container, { name, width, height }) {
    this.name = name; this.width = width; this.height = height;
    this.overlays = []; this.image = null; this.url = "";
    this.onpress = this.ondrag = this.onrelease = this.onhover = this.onleave = this.onclick = null;
    this.canvas = make("canvas", { tabindex: "0", "aria-label": `camera ${name}` });
    this.label = make("span", { class: "label" }, name);
    this.note = make("span", { class: "label right", hidden: true });
    this.element = make("div", { class: "view" }, this.canvas, this.label, this.note);
    container.append(this.element);
    this.zoom = 1; this.u = (width - 1) / 2; this.v = (height - 1) / 2; // the pixel in the middle
    this._listen();
    new ResizeObserver(() => this._resized()).observe(this.element);
  }

  /** Show another image; resolves when it is there. The newest wins. */
  async setImage(url) {
    if (url && url === this.url) return;
    this.url = url;
    if (!url) { this.image = null; this._tell(false); this.redraw(); return; }
    const image = new Image();
    image.src = url;
    try { await image.decode(); } catch { if (this.url === url) this._tell(false); return; }
    if (this.url === url) { this.image = image; this._tell(true); this.redraw(); }
  }

  _tell(hasImage) { this.label.textContent = hasImage ? this.name : `${this.name}: no image`; }

  setNote(text) { this.note.textContent = text; this.note.hidden = !text; }

  /** Screen pixels of the canvas for one image pixel. */
  get scale() { return this.zoom * Math.min(this.canvas.clientWidth / this.width, this.canvas.clientHeight / this.height); }

  /** How long n pixels of the screen are in the image. */
  px(n) { return n / this.scale; }

  toImage(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = event.clientX - box.left - box.width / 2, y = event.clientY - box.top - box.height / 2;
    return [this.u + x / this.scale, this.v + y / this.scale];
  }

  /** Where on the canvas (CSS pixels) an image pixel is. */
  toScreen([u, v]) {
    return [(u - this.u) * this.scale + this.canvas.clientWidth / 2, (v - this.v) * this.scale + this.canvas.clientHeight / 2];
  }

  fit() { this.zoom = 1; this.u = (this.width - 1) / 2; this.v = (this.height - 1) / 2; this.redraw(); }

  /** Magnify such that this rectangle of the image fills most of the view. */
  show(u0, v0, u1, v1, share = 0.8) {
    const whole = this.scale / this.zoom;
    const wanted = share * Math.min(this.canvas.clientWidth / Math.max(u1 - u0, 1), this.canvas.clientHeight / Math.max(v1 - v0, 1));
    this.zoom = clamp(wanted / whole, 1, 60); this.u = (u0 + u1) / 2; this.v = (v0 + v1) / 2;
    this._keepInside(); this.redraw();
  }

  zoomAt([u, v], factor) {
    const before = this.zoom;
    this.zoom = clamp(before * factor, 1, 60);
    this.u = u - (u - this.u) * before / this.zoom; this.v = v - (v - this.v) * before / this.zoom;
    this._keepInside(); this.redraw();
  }

  redraw() {
    if (this._waiting) return;
    this._waiting = true;
    requestAnimationFrame(() => { this._waiting = false; this._draw(); });
  }

  _draw() {
    const context = this.canvas.getContext("2d"), ratio = window.devicePixelRatio || 1, scale = this.scale * ratio;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (!scale) return;
    context.setTransform(scale, 0, 0, scale, this.canvas.width / 2 - this.u * scale, this.canvas.height / 2 - this.v * scale);
    context.imageSmoothingEnabled = scale < 4 * ratio;
    if (this.image) context.drawImage(this.image, -0.5, -0.5, this.width, this.height);
    for (const overlay of this.overlays) { context.save(); overlay(context, this); context.restore(); }
  }

  _resized() {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    this._draw();
  }

  _keepInside() {
    this.u = clamp(this.u, 0, this.width - 1); this.v = clamp(this.v, 0, this.height - 1);
    if (this.zoom <= 1) { this.u = (this.width - 1) / 2; this.v = (this.height - 1) / 2; }
  }

  _listen() {
    const canvas = this.canvas;
    let press = null;
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoomAt(this.toImage(event), Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.fit());
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button > 1) return;
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
      const taken = event.button === 0 && this.onpress?.(this.toImage(event), event) === true;
      press = { x: event.clientX, y: event.clientY, u: this.u, v: this.v, taken, moved: false };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!press) { this.onhover?.(this.toImage(event), event); return; }
      press.moved ||= Math.hypot(event.clientX - press.x, event.clientY - press.y) > 3;
      if (!press.moved) return;
      if (press.taken) { this.ondrag?.(this.toImage(event), event); return; }
      this.u = press.u - (event.clientX - press.x) / this.scale; this.v = press.v - (event.clientY - press.y) / this.scale;
      this._keepInside(); this.redraw();
    });
    canvas.addEventListener("pointerup", (event) => {
      if (!press) return;
      if (press.taken) this.onrelease?.(this.toImage(event), event);
      else if (!press.moved && event.button === 0) this.onclick?.(this.toImage(event), event);
      press = null;
    });
    canvas.addEventListener("pointercancel", () => { press = null; });
    canvas.addEventListener("pointerleave", () => this.onleave?.());
    canvas.addEventListener("keydown", (event) => {
      const middle = [this.u, this.v], step = 40 / this.scale;
      const pan = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
      if (event.key === "+" || event.key === "=") this.zoomAt(middle, 1.25);
      else if (event.key === "-") this.zoomAt(middle, 0.8);
      else if (event.key === "0") this.fit();
      else if (pan && event.altKey) { this.u += pan[0]; this.v += pan[1]; this._keepInside(); this.redraw(); }
      else return;
      event.preventDefault(); event.stopPropagation();
    });
  }
}

/** The views of all cameras, side by side as large as they can be. */
export class ViewGrid {
  constructor(container, cameras) {
    this.container = container;
    this.views = cameras.map((camera) => new ImageView(container, camera));
    new ResizeObserver(() => this._arrange()).observe(container);
  }

  redraw() { this.views.forEach((view) => view.redraw()); }

  /** One camera by its number from 1 alone, or all again; whether there is such a camera. */
  toggleAlone(number) {
    if (!this.views[number - 1]) return false;
    const alone = this.views.some((view) => view.element.hidden);
    this.views.forEach((view, i) => { view.element.hidden = !alone && i !== number - 1; });
    this._arrange();
    return true;
  }

  /** What a key does, if it is the number of a camera. */
  actionOf(key) { return /^[1-9]$/.test(key) ? () => this.toggleAlone(Number(key)) : undefined; }

  _arrange() {
    const seen = this.views.filter((view) => !view.element.hidden);
    if (seen.length) layoutViews(this.container, seen.length, seen[0].width / seen[0].height);
  }
}

export function clamp(x, low, high) { return Math.min(Math.max(x, low), high); }
