"use strict";
// Bodies in space: turned by the mouse or a finger, played over time. Drawn on a plain canvas, the farthest parts first,
// dots before all.

const scenes = JSON.parse(document.getElementById("scenes-data").textContent);

class SceneView {
  constructor(element, scene) {
    this.scene = scene;
    this.canvas = element.querySelector("canvas");
    this.slider = element.querySelector("input");
    this.button = element.querySelector(".play");
    this.speed = element.querySelector(".speed");
    this.said = element.querySelector(".said");
    this.slider.max = String(Math.max(scene.times.length - 1, 0));
    this.fingers = new Map();
    this.playing = false;
    this.frame = 0;
    this.seeAll();
    this.listen();
    this.show(this.firstSeen());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  firstSeen() {
    return Math.max(this.scene.times.findIndex((_, i) => this.scene.bodies.some((body) => body.frames[i])), 0);
  }

  // Middle and size of all that moves, and the floor below it: z = 0, unless nothing comes near to it
  seeAll() {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const body of this.scene.bodies) {
      for (const frame of body.frames) {
        for (let i = 0; frame && i < frame.length; i++) {
          if (frame[i] === null) continue;
          low[i % 3] = Math.min(low[i % 3], frame[i]);
          high[i % 3] = Math.max(high[i % 3], frame[i]);
        }
      }
    }
    const known = low.every(Number.isFinite);
    this.middle = known ? low.map((value, i) => (value + high[i]) / 2) : [0, 0, 0];
    this.size = known ? Math.max(Math.hypot(...low.map((value, i) => high[i] - value)), 100) : 2000;
    const height = known ? Math.max(high[2] - low[2], 100) : 1000;
    this.floor = known && Math.abs(low[2]) < 0.3 * height ? 0 : (known ? low[2] : 0);
    this.reach = this.size;
    this.azimuth = -0.9;
    this.elevation = 0.25;
    this.distance = 1.8 * this.size;
  }

  listen() {
    this.button.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => { this.stop(); this.show(Number(this.slider.value)); });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    const lift = (event) => this.fingers.delete(event.pointerId);
    this.canvas.addEventListener("pointerup", lift);
    this.canvas.addEventListener("pointercancel", lift);
    this.canvas.addEventListener("pointermove", (event) => this.drag(event));
    this.canvas.addEventListener("dblclick", () => { this.seeAll(); this.draw(); });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.nearer(Math.exp(0.001 * event.deltaY));
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (event.key === " ") this.toggle();
      else if (by) { this.stop(); this.show(Math.min(Math.max(this.frame + by, 0), this.scene.times.length - 1)); }
      else return;
      event.preventDefault();
    });
  }

  drag(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (this.fingers.size === 2) {
      const other = [...this.fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = (point) => Math.max(Math.hypot(point[0] - other[0], point[1] - other[1]), 1);
      this.nearer(apart(before) / apart(now));
    } else if (event.shiftKey) {
      const { right, up } = this.axes();
      const scale = this.distance / this.focal();
      for (let i = 0; i < 3; i++) this.middle[i] += scale * ((before[0] - now[0]) * right[i] + (now[1] - before[1]) * up[i]);
    } else {
      this.azimuth -= 0.008 * (now[0] - before[0]);
      this.elevation = Math.min(Math.max(this.elevation + 0.008 * (now[1] - before[1]), -1.5), 1.5);
    }
    this.fingers.set(event.pointerId, now);
    this.draw();
  }

  nearer(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.2 * this.size), 20 * this.size);
    this.draw();
  }

  toggle() {
    if (this.playing) this.stop();
    else {
      this.playing = true;
      this.button.textContent = "■";
      const { times } = this.scene;
      let at = this.frame >= times.length - 1 ? times[0] : times[this.frame];
      let last = performance.now();
      const step = (now) => {
        if (!this.playing) return;
        at += ((now - last) / 1000) * Number(this.speed.value);
        last = now;
        let frame = this.frame >= times.length - 1 ? 0 : this.frame;
        while (frame < times.length - 1 && times[frame + 1] <= at) frame += 1;
        this.show(frame);
        if (frame >= times.length - 1) this.stop();
        else requestAnimationFrame(step);
      };
      requestAnimationFrame(step);
    }
  }

  stop() {
    this.playing = false;
    this.button.textContent = "▶";
  }

  show(frame) {
    this.frame = frame;
    this.slider.value = String(frame);
    const [state, color] = this.scene.states[frame] ?? ["", ""];
    this.said.textContent = this.scene.times.length ? `${this.scene.times[frame].toFixed(2)} s  ${state}` : "";
    this.said.style.color = color;
    this.draw();
  }

  axes() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    return { back: [ce * ca, ce * sa, se], right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce] };
  }

  focal() {
    return 1.2 * Math.min(this.canvas.clientWidth, this.canvas.clientHeight);
  }

  draw() {
    const { canvas, scene } = this;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const { back, right, up } = this.axes();
    const focal = this.focal();
    const dot = (a, x, y, z) => a[0] * x + a[1] * y + a[2] * z;
    // Pixel and scale of a place; null behind the eye
    const project = (px, py, pz) => {
      const [x, y, z] = [px - this.middle[0], py - this.middle[1], pz - this.middle[2]];
      const depth = this.distance - dot(back, x, y, z);
      if (depth < 0.02 * this.distance) return null;
      const scale = focal / depth;
      return [width / 2 + scale * dot(right, x, y, z), height / 2 - scale * dot(up, x, y, z), scale, depth];
    };
    const line = (a, b, color, thick) => {
      if (!a || !b) return;
      context.strokeStyle = color;
      context.lineWidth = thick;
      context.beginPath();
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
      context.stroke();
    };
    context.lineCap = "round";
    this.drawFloor(project, line);
    for (const camera of scene.cameras) this.drawCamera(context, camera, project, line);
    const parts = [];
    for (const body of scene.bodies) {
      const places = body.frames[this.frame];
      if (!places) continue;
      const at = (i) => (places[3 * i] === null ? null : project(places[3 * i], places[3 * i + 1], places[3 * i + 2]));
      for (const [i, j, ri, rj, color] of body.rods) {
        const [a, b] = [at(i), at(j)];
        if (a && b) parts.push([(a[3] + b[3]) / 2, () => this.drawRod(context, a, b, ri * a[2], rj * b[2], color)]);
      }
      for (const [i, j, color] of body.wires) {
        const [a, b] = [at(i), at(j)];
        if (a && b) parts.push([(a[3] + b[3]) / 2, () => line(a, b, color, 1.5)]);
      }
      for (const [i, color] of body.dots) {
        const a = at(i);
        if (a) parts.push([-1, () => this.drawRod(context, a, a, 3, 3, color)]);
      }
    }
    parts.sort((a, b) => b[0] - a[0]);
    for (const [, part] of parts) part();
  }

  // A limb: two circles and what lies between them, with a dark edge
  drawRod(context, a, b, ra, rb, color) {
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const length = Math.hypot(dx, dy);
    context.beginPath();
    if (length <= Math.abs(ra - rb) || length < 1e-6) {
      const [end, radius] = ra > rb ? [a, ra] : [b, rb];
      context.arc(end[0], end[1], Math.max(radius, 0.5), 0, 2 * Math.PI);
    } else {
      const along = Math.atan2(dy, dx);
      const lean = Math.acos((ra - rb) / length);
      context.arc(a[0], a[1], Math.max(ra, 0.5), along + lean, along - lean);
      context.arc(b[0], b[1], Math.max(rb, 0.5), along - lean, along + lean);
      context.closePath();
    }
    context.fillStyle = color;
    context.fill();
    context.strokeStyle = "rgba(29, 39, 48, 0.55)";
    context.lineWidth = 1;
    context.stroke();
  }

  drawFloor(project, line) {
    const step = this.reach > 1500 ? 500 * Math.ceil(this.reach / 10000) : this.reach > 300 ? 100 : 20;
    const n = Math.ceil(this.reach / step);
    const [x0, y0] = [Math.round(this.middle[0] / step), Math.round(this.middle[1] / step)];
    for (let k = -n; k <= n; k++) {
      for (let m = -n; m < n; m++) {
        const [x, y] = [(x0 + k) * step, (y0 + m) * step];
        line(project(x, y, this.floor), project(x, y + step, this.floor), "#dde3e8", 1);
        const [u, v] = [(x0 + m) * step, (y0 + k) * step];
        line(project(u, v, this.floor), project(u + step, v, this.floor), "#dde3e8", 1);
      }
    }
  }

  drawCamera(context, camera, project, line) {
    const [center, ...corners] = camera.points.map((point) => project(...point));
    corners.forEach((corner, i) => {
      line(center, corner, "#9aa5ad", 1);
      line(corner, corners[(i + 1) % 4], "#9aa5ad", 1);
    });
    if (!center) return;
    context.fillStyle = "#5b6770";
    context.font = "11px system-ui, sans-serif";
    context.fillText(camera.name, center[0] + 5, center[1] - 5);
  }
}

function drawScenes() {
  for (const element of document.querySelectorAll("[data-scene]")) {
    element.view = new SceneView(element, scenes[element.dataset.scene]);
  }
}

