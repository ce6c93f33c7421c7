// The side panel of the points page: points, views of the chosen point, its place, cameras of control points.

import { make } from "/common.js";
import { colorOf } from "/digitizing_marks.js";

const byId = (id) => document.getElementById(id);
const number = (value, digits) => make("td", { class: "number" }, value === undefined || value === null ? "" : value.toFixed(digits));

/** Shade of a residual: what a careful click is off by, what is a doubtful one. */
function shade(pixels) { return pixels < 1.5 ? "good" : pixels < 4 ? "fair" : "bad"; }

export function showTables(state, choose) {
  const control = state.sheet === "control";
  showPoints(state, control, choose);
  showViews(state, control);
  byId("place").replaceChildren(...(control ? controlPlace(state) : place(state)));
}

function showPoints(state, control, choose) {
  const names = control ? Object.keys(state.facts.places) : state.facts.points;
  const head = make("tr", {}, make("th", {}, "point"), ...["views", "rms px", control ? "" : "σ mm"].map((t) => make("th", { class: "number" }, t)));
  byId("points").replaceChildren(head, ...names.map((name) => {
    const found = state.answer?.points?.[name];
    const views = state.cameras.filter((camera) => state.answer?.clicks[camera.name]?.[name]).length;
    const rms = found?.rms_px ?? controlRms(state, name);
    const row = make("tr", { "aria-selected": String(name === state.point), click: () => choose(name) }, make("td", { title: name }, name));
    row.append(make("td", { class: "number" }, views ? String(views) : ""), number(rms, 2));
    row.append(number(found && 1e3 * Math.hypot(...found.sigma), 1));
    if (rms !== undefined) row.children[2].classList.add(shade(rms));
    return row;
  }));
  if (!names.length) byId("points").replaceChildren(make("tr", {}, make("td", { class: "soft" }, control
    ? state.isNew ? "no control points: put a CSV file point,x,y,z into the folder" : "no control points: start with --control-points FILE"
    : "no points yet: name one below")));
}

function controlRms(state, name) {
  const offs = Object.values(state.answer?.cameras ?? {}).map((camera) => camera.residuals[name]).filter(Boolean);
  return offs.length ? Math.sqrt(offs.reduce((sum, [du, dv]) => sum + du * du + dv * dv, 0) / offs.length) : undefined;
}

function showViews(state, control) {
  byId("of-point").textContent = state.point;
  const head = make("tr", {}, make("th", {}, "camera"), ...["u", "v", "off px"].map((t) => make("th", { class: "number" }, t)));
  byId("views-of-point").replaceChildren(...(state.point ? [head] : []), ...(state.point ? state.cameras : []).map((camera) => {
    const pixel = state.answer?.clicks[camera.name]?.[state.point];
    const off = control ? state.answer?.cameras[camera.name]?.residuals[state.point]
      : state.answer?.points[state.point]?.residuals[camera.name];
    const dot = make("span", { class: "dot" }, "●");
    dot.style.color = colorOf(state.cameras, camera.name);
    const row = make("tr", {}, make("td", {}, dot, ` ${camera.name}`), number(pixel?.[0], 1), number(pixel?.[1], 1));
    const size = off && Math.hypot(...off);
    row.append(number(size, 2));
    if (off) {
      row.lastChild.classList.add(shade(size));
      row.lastChild.title = `du ${off[0].toFixed(2)}, dv ${off[1].toFixed(2)}`;
    }
    return row;
  }));
}

function place(state) {
  const found = state.answer?.points[state.point];
  const views = state.cameras.filter((camera) => state.answer?.clicks[camera.name]?.[state.point]).length;
  if (!found) return state.point ? [make("span", { class: "soft" }, views > 1 ? "the rays do not meet" : "two views make a place")] : [];
  const rows = ["x", "y", "z"].map((axis, i) => make("tr", {}, make("th", {}, axis),
    make("td", { class: "number" }, `${found.position[i].toFixed(4)} m`), make("td", { class: "number" }, `± ${(1e3 * found.sigma[i]).toFixed(1)} mm`)));
  return [make("table", { id: "coordinates" }, ...rows)];
}

function controlPlace(state) {
  const known = state.facts.places[state.point];
  const head = make("tr", {}, make("th", {}, "camera"), ...["points", "rms px"].map((t) => make("th", { class: "number" }, t)));
  const rows = state.cameras.map((camera) => {
    const verdict = state.answer?.cameras[camera.name], n = Object.keys(state.answer?.clicks[camera.name] ?? {}).length;
    const row = make("tr", {}, make("td", {}, camera.name), make("td", { class: "number" }, String(n)), number(verdict?.rms_px, 2));
    return verdict?.problem ? [row, make("tr", {}, make("td", { colspan: 3, class: "soft" }, verdict.problem))] : [row];
  });
  const { object_rms_m: rms, object_points: n } = state.answer ?? {};
  return [
    ...(known ? [make("div", { class: "mono" }, `known: ${known.map((x) => x.toFixed(4)).join(", ")} m`)] : []),
    make("h2", {}, "Cameras by these points"), make("table", { id: "control-cameras" }, head, ...rows.flat()),
    ...(n ? [make("div", {}, `${n} points reconstructed, rms ${(1e3 * rms).toFixed(2)} mm from their places`)] : []),
  ];
}

export function showRepeatability(found) {
  const { pixels, meters, freedom } = found;
  byId("repeatability").textContent = pixels === null
    ? "Digitize some images a second time (Sheet) to learn it."
    : `one click: ${pixels.toFixed(2)} px rms along u and v (${freedom} degrees of freedom)`
      + (meters === null ? "" : `; a point: ${(1e3 * meters).toFixed(1)} mm rms per axis`);
}
