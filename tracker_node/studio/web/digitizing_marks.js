// What the points page draws over images: clicks, epipolar curves, reprojections; and the magnifier.

const LINES = ["#ff8a3d", "#3dc9ff", "#b7e34a", "#ff6fae", "#b48cff", "#ffd23d", "#4be3c1", "#ff5a5a"];
const CLICK = "#ffe14d", CHOSEN = "#00e5ff", SEEN = "#ff4fd8";
const MAGNIFICATION = 6;

/** A camera's color, by its place in the rig. */
export function colorOf(cameras, name) {
  return LINES[cameras.findIndex((camera) => camera.name === name) % LINES.length];
}

/** Draw in image pixels; `px(n)` is the length of n pixels of the screen. `state` is that of the page. */
export function drawMarks(context, state, camera, px) {
  const { answer, point } = state;
  if (!answer) return;
  if (state.showLines) {
    for (const curve of answer.curves.filter((curve) => curve.in === camera)) {
      polyline(context, curve.pixels, colorOf(state.cameras, curve.of), px(1.2));
    }
  }
  const clicks = answer.clicks[camera] ?? {};
  if (state.showExpected) {
    const seen = seenIn(answer, point, camera);
    if (seen) diamond(context, seen, SEEN, px);
  }
  for (const [name, pixel] of Object.entries(clicks)) {
    const chosen = name === point;
    residual(context, answer, name, camera, pixel, px);
    cross(context, pixel, chosen ? CHOSEN : CLICK, px, chosen);
    if (chosen || px(1) < 0.4) text(context, name, pixel, chosen ? CHOSEN : CLICK, px);
  }
}

/** Where the reconstructed point, or the known place of a control point, is seen by a camera of the rig. */
export function seenIn(answer, point, camera) {
  return (answer.points?.[point]?.seen ?? answer.expected?.[point])?.[camera];
}

/** The surroundings of a pixel, magnified, under the same marks. */
export function drawLoupe(canvas, state, view, [u, v]) {
  const ratio = window.devicePixelRatio || 1, scale = MAGNIFICATION * ratio;
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(canvas.clientHeight * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, canvas.width / 2 - u * scale, canvas.height / 2 - v * scale);
  context.imageSmoothingEnabled = false;
  if (view.image) context.drawImage(view.image, -0.5, -0.5, view.width, view.height);
  drawMarks(context, state, view.name, (n) => n / MAGNIFICATION);
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.strokeStyle = "rgba(255, 255, 255, .75)";
  context.lineWidth = ratio;
  const x = canvas.width / 2, y = canvas.height / 2, gap = 7 * ratio, length = 26 * ratio;
  context.beginPath();
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
    context.moveTo(x + dx * gap, y + dy * gap);
    context.lineTo(x + dx * length, y + dy * length);
  }
  context.stroke();
}

/** How many clicks each image set has, as a strip. */
export function drawStrip(canvas, counts, current) {
  const ratio = window.devicePixelRatio || 1, context = canvas.getContext("2d");
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = 6 * ratio;
  const most = Math.max(...counts, 1), width = canvas.width / counts.length;
  counts.forEach((count, i) => {
    if (!count && i !== current) return;
    context.fillStyle = i === current ? "#1f2733" : `rgba(22, 103, 199, ${0.35 + 0.65 * count / most})`;
    context.fillRect(i * width, 0, Math.max(width, ratio), canvas.height);
  });
}

function cross(context, [u, v], color, px, large) {
  const inner = px(large ? 4 : 2), outer = px(large ? 12 : 6);
  for (const [stroke, width] of [["rgba(0, 0, 0, .6)", px(3)], [color, px(1.4)]]) {
    context.strokeStyle = stroke;
    context.lineWidth = width;
    context.beginPath();
    for (const [du, dv] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(u + du * inner, v + dv * inner);
      context.lineTo(u + du * outer, v + dv * outer);
    }
    context.stroke();
  }
}

/** From the click to where the reconstruction is seen, true to scale. */
function residual(context, answer, name, camera, [u, v], px) {
  const off = answer.points?.[name]?.residuals[camera] ?? answer.cameras?.[camera]?.residuals[name];
  if (!off) return;
  context.strokeStyle = SEEN;
  context.lineWidth = px(1.4);
  context.beginPath();
  context.moveTo(u, v);
  context.lineTo(u - off[0], v - off[1]);
  context.moveTo(u - off[0] + px(2.5), v - off[1]);
  context.arc(u - off[0], v - off[1], px(2.5), 0, 2 * Math.PI);
  context.stroke();
}

function diamond(context, [u, v], color, px) {
  context.strokeStyle = color;
  context.lineWidth = px(1.4);
  context.beginPath();
  for (const [du, dv] of [[7, 0], [0, 7], [-7, 0], [0, -7], [7, 0]]) context.lineTo(u + px(du), v + px(dv));
  context.stroke();
}

function polyline(context, pixels, color, width) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  for (const [u, v] of pixels) context.lineTo(u, v);
  context.stroke();
}

function text(context, name, [u, v], color, px) {
  context.font = `${px(12)}px system-ui, sans-serif`;
  context.lineWidth = px(3);
  context.strokeStyle = "rgba(0, 0, 0, .7)";
  context.fillStyle = color;
  context.strokeText(name, u + px(9), v - px(7));
  context.fillText(name, u + px(9), v - px(7));
}
