// What the engine would say of a pose: all cameras together, and each.

import { scoreColor } from "/body.js";
import { clamp, make } from "/common.js";

/** Put { total, cameras } into a container; `about` is { name, meaning, shrunk }. */
export function showScores(container, score, about) {
  const total = make("b", { id: "total" }, percent(score.total));
  total.style.color = scoreColor(score.total);
  const shrunk = about.shrunk > 1 ? ` In images of 1/${about.shrunk} of the size.` : "";
  container.replaceChildren(
    make("div", { class: "total", title: about.meaning + shrunk }, total, make("span", { class: "soft" }, about.name)),
    make("div", { class: "cameras" }, ...Object.entries(score.cameras).flatMap(cameraRow)));
}

function cameraRow([name, { value, samples }]) {
  const bar = make("div");
  bar.style.width = `${100 * clamp(value ?? 0, 0, 1)}%`;
  bar.style.background = scoreColor(value);
  const meter = make("div", { class: "meter", title: `${samples} samples` }, bar);
  return [make("span", {}, name), meter, make("span", { class: "mono", "data-score": name }, percent(value))];
}

function percent(value) { return value === null ? "\u2013" : `${Math.round(100 * value)} %`; }
