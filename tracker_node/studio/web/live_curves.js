// Curves of the last minute, and the shades of statuses.

export const SHADES = { TRACKING: "good", DEGRADED: "fair", INITIALIZING: "first", LOST: "bad" };
const style = getComputedStyle(document.documentElement); // of palette.css
const color = (status) => style.getPropertyValue(`--${status.toLowerCase()}`).trim() || "#a9b3bf";
const SECONDS = 60;

/** Draw [time, value, status] of the last minute; null is a gap, the status a strip at the foot; `why` is said where all are gaps. */
export function drawCurve(canvas, points, now, why) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const recent = points.filter(([time]) => now - time < SECONDS);
  const values = recent.map(([, value]) => value).filter((value) => value !== null);
  const top = niceAbove(Math.max(...values, 1e-9)), x = (time) => width * (1 - (now - time) / SECONDS);
  const y = (value) => height - 8 - (height - 32) * value / top;
  context.strokeStyle = "#dfe4ea";
  context.strokeRect(0, y(top), width, 0);
  context.fillStyle = "#637083";
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "right";
  if (values.length) context.fillText(`${format(top)}`, width - 4, y(top) - 3);
  recent.forEach(([time, , status], i) => {
    context.fillStyle = color(status ?? "");
    context.fillRect(x(time), height - 4, Math.max(1, x(recent[i + 1]?.[0] ?? now) - x(time)), 4);
  });
  if (!values.length) {
    context.textAlign = "center";
    context.fillStyle = "#637083";
    context.fillText(recent.length ? why : "", width / 2, height / 2);
    return;
  }
  context.strokeStyle = "#1667c7";
  context.lineWidth = 1.4;
  context.beginPath();
  let open = false;
  for (const [time, value] of recent) {
    if (value === null) { open = false; continue; }
    if (open) context.lineTo(x(time), y(value));
    else context.moveTo(x(time), y(value));
    open = true;
  }
  context.stroke();
}

function niceAbove(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value);
}

export function format(value, digits = 3) {
  return value === null || value === undefined ? "–" : String(Number(value.toPrecision(digits)));
}

/** The share-th smallest of numbers; null of none. */
export function percentile(values, share) {
  const sorted = values.filter((value) => value !== null).sort((a, b) => a - b);
  return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : null;
}
