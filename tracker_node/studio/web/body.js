// A posed body over an image: its parts' outlines, bones, and the handles that it is taken by.

/** How the body is drawn; pages change it and redraw. */
export const look = { fill: 0.25, outline: true, skeleton: true, byScore: false };

const TOGGLES = ["outline", "skeleton", "byScore"];

/** The controls of the page by which people change `look`; returns a function that changes it, too. */
export function bindLook(redraw) {
  const fill = document.getElementById("fill"), boxes = TOGGLES.map((name) => [name, document.getElementById(name)]).filter(([, box]) => box);
  const sync = () => {
    fill.value = look.fill;
    for (const [name, box] of boxes) box.checked = look[name];
    redraw();
  };
  fill.addEventListener("input", () => { look.fill = fill.valueAsNumber; redraw(); });
  for (const [name, box] of boxes) box.addEventListener("change", () => { look[name] = box.checked; redraw(); });
  sync();
  return (changes) => { Object.assign(look, changes); sync(); };
}

/** What takes the overlay away, or brings it back. */
export function overlayToggled() {
  const off = look.outline || look.fill > 0;
  return { outline: !off, fill: off ? 0 : 0.25 };
}

/** Red over amber to green for 0 over 1/2 to 1; gray where nothing is known. */
export function scoreColor(value) {
  return value === null || value === undefined ? "#8b95a1" : `hsl(${Math.round(120 * Math.min(Math.max(value, 0), 1))} 75% 45%)`;
}

/**
 * An overlay for ImageView. `of()` gives what is to be drawn: { drawn: {parts, handles}, parts: [{color}], bones, scores, hot },
 * or null.
 */
export function bodyOverlay(of) {
  return (context, view) => {
    const body = of();
    if (!body?.drawn) return;
    context.lineJoin = "round";
    for (const [part, line] of body.drawn.parts) {
      const color = look.byScore ? scoreColor(body.scores?.[part]) : body.parts[part].color;
      const path = new Path2D();
      for (let i = 0; i < line.length; i += 2) path.lineTo(line[i], line[i + 1]);
      path.closePath();
      if (look.fill > 0) {
        context.globalAlpha = look.fill; context.fillStyle = color; context.fill(path); context.globalAlpha = 1;
      }
      if (look.outline) {
        context.lineWidth = view.px(2.6); context.strokeStyle = "rgba(255 255 255 / .55)"; context.stroke(path);
        context.lineWidth = view.px(1.3); context.strokeStyle = color; context.stroke(path);
      }
    }
    if (look.skeleton) drawSkeleton(context, view, body);
  };
}

function drawSkeleton(context, view, { drawn, bones, hot }) {
  context.strokeStyle = "rgba(255 235 59 / .9)"; context.lineWidth = view.px(1.2);
  for (const [a, b] of bones) {
    const from = drawn.handles[a], to = drawn.handles[b];
    if (from && to) { context.beginPath(); context.moveTo(...from); context.lineTo(...to); context.stroke(); }
  }
  drawn.handles.forEach((pixel, i) => {
    if (!pixel) return;
    context.beginPath(); context.arc(...pixel, view.px(i === hot ? 6 : 3), 0, 2 * Math.PI);
    context.fillStyle = i === hot ? "#ffeb3b" : "#fff"; context.fill();
    context.lineWidth = view.px(1); context.strokeStyle = "#111"; context.stroke();
  });
}

/** Index of the handle nearest to a pixel, within some pixels of the screen; -1 without one. */
export function nearestHandle(drawn, [u, v], reach) {
  let best = -1, least = reach;
  drawn?.handles.forEach((pixel, i) => {
    const distance = pixel ? Math.hypot(pixel[0] - u, pixel[1] - v) : Infinity;
    if (distance < least) { best = i; least = distance; }
  });
  return best;
}

/** Zoom a view to the body drawn in it, or to all of the image where there is none. */
export function zoomToBody(view, drawn) {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [, line] of drawn?.parts ?? []) {
    for (let i = 0; i < line.length; i += 2) {
      box[0] = Math.min(box[0], line[i]); box[2] = Math.max(box[2], line[i]);
      box[1] = Math.min(box[1], line[i + 1]); box[3] = Math.max(box[3], line[i + 1]);
    }
  }
  if (box[0] < box[2]) view.show(...box, 0.75); else view.fit();
}

/** Runs one job at a time; of those that come meanwhile only the last. */
export function latestOnly(run) {
  let busy = false, next = null;
  return async function ask(job) {
    next = job;
    if (busy) return;
    busy = true;
    try {
      while (next !== null) { const now = next; next = null; await run(now); }
    } finally { busy = false; }
  };
}
