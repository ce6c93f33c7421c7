// The live page: asks for what is new, draws it, asks again; what it is too slow for is left out.

import { attempt, ImageView, layoutViews, make, request, say } from "/common.js";
import { drawCurve, format, percentile, SHADES } from "/live_curves.js";
import { openPageWith } from "/page.js";

const KEPT = 4000; // states
const SILENT_S = 3;
const BUTTONS = [
  ["reset", "Reset", {}, "back to the initial state, nothing learned"], ["reinitialize", "Reinitialize", {}, "begin anew without a state"],
  ["enable", "Enable", { on: true }, "track"], ["enable", "Disable", { on: false }, "let images pass"],
];
const CURVES = { residual: 3, total: 4, latency: 5 }; // places in a point
const NO_VALUES = { residual: "no residuals", total: "no times", latency: "stamps are not of this clock" };
const byId = (id) => document.getElementById(id);

const points = {}; // tracker -> [number, arrival, status, residual, total, latency]
const numbers = {}; // topic -> number of the image that is shown
const views = new Map(); // camera -> ImageView
const unfolded = new Set(); // parts of the diagnostics
let news = null; // the newest answer
let facts = null;
let diagnosticsShown = -Infinity;

await openPageWith("live.html", "/api/live", begin);

function begin(_session, found) {
  facts = found;
  byId("graph").textContent = `domain ${facts.graph.ROS_DOMAIN_ID || "0"}${facts.graph.ROS_AUTOMATIC_DISCOVERY_RANGE === "LOCALHOST" ? ", this machine" : ""}`;
  byId("state").append(...facts.states.map((name) => make("option", {}, name)));
  byId("put").onclick = () => ask("set_state", { file: byId("state").value });
  byId("kind").onchange = byId("tracker").onchange = () => { clearViews(); show(); };
  new ResizeObserver(arrange).observe(byId("views"));
  document.querySelector("main").hidden = false;
  connect();
}

function connect() {
  const socket = new WebSocket(`ws://${location.host}/api/live/stream`);
  socket.binaryType = "blob";
  let coming = [], left = 0; // images announced by the last text; those that are not drawn yet
  socket.onopen = () => { byId("connection").textContent = "joining the graph"; next(socket); };
  socket.onmessage = async ({ data }) => {
    if (typeof data !== "string") {
      await showImage(...coming.shift(), data);
      left -= 1;
      if (!left) next(socket);
      return;
    }
    const answer = JSON.parse(data);
    if (answer.problem) { giveUp(answer.problem); socket.onclose = null; return; }
    coming = answer.images;
    left = coming.length;
    take(answer);
    if (!left) next(socket);
  };
  socket.onclose = async () => {
    const refused = await fetch("/api/session").then(({ status }) => status === 403, () => false);
    if (refused) { giveUp("The studio was started anew: open the address that it has printed."); return; }
    byId("connection").textContent = "the studio does not answer";
    byId("connection").className = "bad";
    setTimeout(connect, 2000);
  };
}

function next(socket) {
  if (socket.readyState !== WebSocket.OPEN) return;
  const topics = Object.fromEntries([...wantedTopics().values()].map((topic) => [topic, numbers[topic] ?? 0]));
  const states = Object.fromEntries(Object.entries(points).map(([name, list]) => [name, list.at(-1)?.[0] ?? 0]));
  socket.send(JSON.stringify({ topics, states }));
}

function giveUp(problem) {
  document.querySelector("main").remove();
  document.body.append(make("p", { class: "notice" }, problem));
}

function take(answer) {
  news = answer;
  for (const [name, tracker] of Object.entries(answer.trackers)) {
    const list = (points[name] ??= []);
    if (tracker.points.length && list.length && tracker.points[0][0] <= list.at(-1)[0]) list.length = 0; // the studio began anew
    list.push(...tracker.points);
    list.splice(0, Math.max(0, list.length - KEPT));
  }
  byId("connection").textContent = answer.refused.length ? answer.refused.join("; ") : "connected";
  byId("connection").className = answer.refused.length ? "bad" : "good";
  show();
}

const chosen = () => byId("tracker").value;

/** Camera -> the topic of its images that is to be shown. */
function wantedTopics() {
  const kind = byId("kind").value, found = new Map(), topics = Object.keys(news?.topics ?? {});
  const namespace = chosen().slice(0, chosen().lastIndexOf("/") + 1);
  const own = topics.filter((topic) => topic.startsWith(namespace) && /^[^/]+\/image_raw/.test(topic.slice(namespace.length)));
  for (const topic of kind === "camera" && own.length ? own : topics) {
    if (kind === "camera") {
      const camera = topic.match(/([^/]+)\/image_raw(\/compressed)?$/); // in the order of names a compressed topic comes later, and wins
      if (camera) found.set(camera[1], topic);
    } else if (topic.startsWith(`${chosen()}/`) && topic.endsWith(`/${kind}/compressed`)) {
      found.set(topic.slice(chosen().length + 1, -`/${kind}/compressed`.length), topic);
    }
  }
  return found;
}

async function showImage(topic, number, blob) {
  const camera = [...wantedTopics()].find(([, wanted]) => wanted === topic)?.[0];
  if (camera === undefined) return;
  const bitmap = await createImageBitmap(blob).catch(() => null);
  if (!bitmap) return;
  let view = views.get(camera);
  if (view && (view.width !== bitmap.width || view.height !== bitmap.height)) clearViews();
  view = views.get(camera) ?? addView(camera, bitmap);
  view.image?.close();
  view.image = bitmap;
  numbers[topic] = number;
  view.redraw();
}

function addView(camera, bitmap) {
  const view = new ImageView(byId("views"), { name: camera, width: bitmap.width, height: bitmap.height });
  views.set(camera, view);
  for (const name of [...views.keys()].sort()) byId("views").append(views.get(name).element);
  arrange();
  return view;
}

function clearViews() {
  for (const view of views.values()) view.element.remove();
  views.clear();
  for (const topic of Object.keys(numbers)) delete numbers[topic];
}

function arrange() {
  const first = views.values().next().value;
  if (first) layoutViews(byId("views"), views.size, first.width / first.height);
}

function show() {
  if (!news) return;
  const names = Object.keys(news.trackers), select = byId("tracker");
  if (names.join() !== [...select.options].map((option) => option.value).join()) {
    const before = select.value;
    select.replaceChildren(...names.map((name) => make("option", { value: name }, name)));
    if (names.includes(before)) select.value = before;
  }
  const tracker = news.trackers[chosen()];
  byId("no-images").hidden = views.size > 0 || byId("kind").value === "none";
  byId("no-images").textContent = wantedTopics().size ? "Waiting for images." : "Nobody publishes such images.";
  showSilence();
  showStatus(tracker);
  showButtons(tracker?.services ?? []);
  showDiagnostics(performance.now());
  const list = points[chosen()] ?? [];
  for (const canvas of document.querySelectorAll("canvas[data-curve]")) {
    const place = CURVES[canvas.dataset.curve];
    drawCurve(canvas, list.map((point) => [point[1], point[place], point[2]]), news.now_s, NO_VALUES[canvas.dataset.curve]);
  }
}

/** A picture that is not of now is gray. */
function showSilence() {
  const topics = wantedTopics();
  for (const [camera, view] of views) {
    const gone = !topics.has(camera), age = news.ages_s[topics.get(camera)] ?? 0;
    view.setNote(gone ? "not published" : age > SILENT_S ? `silent for ${age.toFixed(0)} s` : "");
    view.element.classList.toggle("silent", gone || age > SILENT_S);
  }
}

function showStatus(tracker) {
  const state = tracker?.state, silent = state && state.age_s > SILENT_S;
  byId("status").className = state && !silent ? SHADES[state.status] ?? "" : "";
  byId("status-name").textContent = !state ? (tracker ? "no state yet" : "no tracker") : silent ? `silent for ${state.age_s.toFixed(0)} s` : state.status;
  byId("reason").textContent = state && !silent ? state.reason : "";
  const recent = (points[chosen()] ?? []).filter((point) => news.now_s - point[1] < 10);
  const of = (name, share) => percentile(recent.map((point) => point[CURVES[name]]), share);
  const rows = !state ? [] : [
    ["body", state.model], ["sets per second", tracker.rate_hz.toFixed(1)], ["residual", `${format(state.residual)} ${state.residual_unit}`],
    ["for a set, p50 / p95", `${format(of("total", 0.5))} / ${format(of("total", 0.95))} ms`],
    ["latency, p50 / p95", `${format(of("latency", 0.5))} / ${format(of("latency", 0.95))} ms`],
    ...state.cameras.map(([name, residual, samples]) => [name, samples ? `${format(residual)} px of ${samples} samples` : "no part in the fit"]),
  ];
  byId("figures").replaceChildren(...rows.map(([name, value]) => make("tr", {}, make("th", {}, name), make("td", { class: "number" }, value))));
  byId("limbs").replaceChildren(...(state?.limbs ?? []).map(([name, status, lost, reason]) => make("tr", { title: reason },
    make("td", {}, name.replaceAll("_", " ")), make("td", { class: SHADES[status] ?? "soft" }, status.toLowerCase()),
    make("td", { class: "number" }, lost === null ? "" : `${(100 * lost).toFixed(0)} % lost`))));
}

function showButtons(services) {
  const offered = BUTTONS.filter(([service]) => services.includes(service));
  if (byId("buttons").dataset.offered !== `${chosen()} ${services.join()}`) {
    byId("buttons").dataset.offered = `${chosen()} ${services.join()}`;
    byId("buttons").replaceChildren(...offered.map(([service, name, fields, title]) => make("button", { title, click: () => ask(service, fields) }, name)));
  }
  byId("set-state").hidden = !services.includes("set_state") || !facts.states.length;
}

async function ask(service, fields) {
  const answer = await attempt(() => request("/api/live/service", { tracker: chosen(), service, ...fields }));
  if (answer) say(`${service}: ${answer.message || (answer.success ? "done" : "refused")}`, answer.success ? "" : "bad");
}

/** Once a second: rows that change under the mouse cannot be pressed. */
function showDiagnostics(at) {
  if (at - diagnosticsShown < 1000) return;
  diagnosticsShown = performance.now();
  const recorder = news.diagnostics.filter((part) => /(^|\/)recorder(:|\b)/.test(part.name));
  const others = news.diagnostics.filter((part) => !recorder.includes(part));
  byId("diagnostics").replaceChildren(...others.flatMap((part) => partRows(part, false)));
  byId("recorder").replaceChildren(...(recorder.length ? recorder.flatMap((part) => partRows(part, true)) : [make("tr", {}, make("td", { class: "soft" }, "no recorder"))]));
}

function partRows(part, open) {
  const key = `${part.name} ${part.hardware_id}`, silent = part.age_s > SILENT_S, shown = unfolded.has(key) !== open;
  const toggle = () => { unfolded[unfolded.has(key) ? "delete" : "add"](key); showDiagnostics(Infinity); };
  const message = silent ? `silent for ${part.age_s.toFixed(0)} s (${part.message})` : part.message;
  const row = make("tr", { class: "part", click: toggle, title: part.hardware_id },
    make("td", {}, make("span", { class: `dot level${silent ? 3 : part.level}` }, "●")), make("td", {}, make("b", {}, part.name), make("br"), message));
  if (!shown || !part.values.length) return [row];
  const values = part.values.map(([name, value]) => make("tr", {}, make("td", {}, name), make("td", { class: "number" }, value)));
  return [row, make("tr", {}, make("td"), make("td", {}, make("table", {}, ...values)))];
}
