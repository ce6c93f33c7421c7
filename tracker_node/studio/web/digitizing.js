// The points page: named points clicked on in several views, reconstructed at once, saved as they are made.

import { attempt, clamp, ImageView, isTyping, layoutViews, make, request, say } from "/common.js";
import { drawLoupe, drawMarks, drawStrip, seenIn } from "/digitizing_marks.js";
import { showRepeatability, showTables } from "/digitizing_tables.js";
import { openPage } from "/page.js";

const GRAB = 8; // pixels of the screen from a mark that take hold of it
const byId = (id) => document.getElementById(id);

const state = { cameras: [], sets: [], facts: null, answer: null, set: 0, sheet: "first", point: "", showLines: true, showExpected: false };
const views = [];
let active = null; // the view that keys mean
let under = null; // what the magnifier shows: [view, pixel]
const waiting = []; // clicks that are not saved yet, with the change whose earlier pixel the answer will tell
const undone = []; // clicks as they were before the latest changes: null where there was none, undefined until the server has told
let sending = false;
let puts = 0; // how often a click was put: what the server has said before knows nothing of it
let saved = Promise.resolve(); // when all clicks are

const session = await attempt(() => openPage("digitizing.html"));
const facts = session && (await request("/api/digitizing").catch((error) => ({ error: error.message })));
if (facts?.error) document.body.append(make("p", { class: "notice" }, facts.error));
else if (facts) await begin();

async function begin() {
  Object.assign(state, { cameras: session.cameras, sets: session.sets, isNew: Boolean(session.files.new), facts });
  document.querySelector("main").hidden = false;
  for (const camera of state.cameras) views.push(makeView(camera));
  new ResizeObserver(arrange).observe(byId("views"));
  active = views[0];
  byId("set").max = state.sets.length - 1;
  byId("folder").textContent = `in ${facts.folder.split("/").at(-1)}`;
  byId("folder").title = facts.folder;
  choosePoint(facts.points[0] ?? "", false);
  listen();
  if (location.hash === "#control") { byId("sheet").value = "control"; chooseSheet("control"); }
  await showSet(0);
  await showRepeats();
}

function makeView(camera) {
  const view = new ImageView(byId("views"), camera);
  view.overlays.push((context, self) => drawMarks(context, state, camera.name, (n) => self.px(n)));
  view.element.addEventListener("dblclick", (event) => event.stopPropagation(), true); // two clicks are two clicks here
  view.canvas.addEventListener("focus", () => { active = view; });
  view.onhover = (pixel) => magnify(view, pixel);
  view.onclick = (pixel) => { put(view, pixel); advance(); };
  let held = null; // where the mark lies beside the pointer, and whether it has moved
  view.onpress = (pixel) => {
    const mark = state.answer?.clicks[camera.name]?.[state.point];
    if (!mark || Math.hypot(pixel[0] - mark[0], pixel[1] - mark[1]) >= view.px(GRAB)) return false;
    held = { off: [mark[0] - pixel[0], mark[1] - pixel[1]], moved: false };
    return true;
  };
  view.ondrag = (pixel) => {
    const at = [pixel[0] + held.off[0], pixel[1] + held.off[1]];
    magnify(view, at);
    put(view, at, !held.moved); // one drag is one change
    held.moved = true;
  };
  return view;
}

function arrange() {
  const shown = views.filter((view) => !view.element.hidden);
  layoutViews(byId("views"), shown.length, shown[0].width / shown[0].height);
}

/** Show one view alone, or, where it is alone already, all. */
function alone(view) {
  const others = views.filter((other) => other !== view && !other.element.hidden);
  for (const other of views) other.element.hidden = others.length > 0 && other !== view;
  view.element.hidden = false;
  arrange();
  view.canvas.focus();
}

function asked() {
  const sigma = Number(byId("sigma").value);
  return {
    set: state.set, sheet: state.sheet, point: state.point,
    sigma_px: sigma > 0 ? sigma : 1, constraint: byId("constraint").value,
  };
}

/** Put the chosen point at a pixel of a view, or take it out of it. */
function put(view, pixel, remember = true) {
  if (!state.point) { say("name a point first", "bad"); return; }
  const inside = pixel && [clamp(pixel[0], -0.49, view.width - 0.51), clamp(pixel[1], -0.49, view.height - 0.51)];
  puts += 1;
  state.answer ??= { clicks: {}, curves: [], points: {}, cameras: {}, expected: {}, coming: true }; // the sheet is still on its way
  const clicks = (state.answer.clicks[view.name] ??= {});
  const before = clicks[state.point] ?? (state.answer.coming ? undefined : null);
  const change = { view, pixel: before, set: state.set, sheet: state.sheet, point: state.point };
  if (remember) undone.push(change);
  if (inside) clicks[state.point] = inside;
  else delete clicks[state.point];
  redraw();
  const click = { ...asked(), camera: view.name, pixel: inside };
  const last = waiting.at(-1);
  const again = last && ["set", "sheet", "point", "camera"].every((key) => last.click[key] === click[key]);
  waiting.push({ click, change: again ? waiting.pop().change : change }); // the server replaces what was there before the first
  if (!sending) saved = send();
}

/** Save one click after the other; what cannot be saved is taken back. */
async function send() {
  sending = true;
  let stale = false;
  while (waiting.length) {
    const { click, change } = waiting.shift();
    const answer = await attempt(() => request("/api/digitizing/click", click));
    if (answer) state.facts.counts[click.set] = answer.count;
    if (answer && change.pixel === undefined) change.pixel = answer.before;
    if (waiting.length) continue;
    stale = !answer || ["set", "sheet", "point"].some((key) => click[key] !== state[key]);
    if (!stale) { state.answer = answer; redraw(); }
  }
  sending = false;
  if (stale) await refresh();
  if (state.sheet === "second" || state.sheet === "third") await showRepeats();
}

async function refresh() {
  const wanted = asked(), before = puts;
  const answer = await attempt(() => request("/api/digitizing/sheet", wanted));
  const current = ["set", "sheet", "point"].every((key) => wanted[key] === state[key]);
  if (answer && current && before === puts && !waiting.length && !sending) { state.answer = answer; redraw(); }
}

async function showRepeats() {
  const found = await attempt(() => request("/api/digitizing/repeatability", asked()));
  if (found) showRepeatability(found);
}

function redraw() {
  for (const view of views) view.redraw();
  showTables(state, choosePoint);
  drawStrip(byId("strip"), state.facts.counts, state.set);
  if (under) drawLoupe(byId("loupe"), state, ...under);
}

function magnify(view, pixel) {
  under = [view, pixel];
  byId("loupe-text").textContent = `${view.name}  ${pixel[0].toFixed(1)}, ${pixel[1].toFixed(1)}`;
  drawLoupe(byId("loupe"), state, view, pixel);
}

async function showSet(index) {
  state.set = clamp(index, 0, state.sets.length - 1);
  byId("set").value = state.set;
  const { stamp_ns, numbers } = state.sets[state.set];
  const seconds = 1e-9 * (stamp_ns - state.sets[0].stamp_ns);
  byId("time").textContent = `${state.set} / ${state.sets.length - 1}  ·  ${seconds.toFixed(3)} s`;
  if (state.sheet !== "control") state.answer = null;
  for (const view of views) {
    const url = imageOf(view, numbers);
    view.setImage(url).then(() => { if (under?.[0] === view) drawLoupe(byId("loupe"), state, ...under); });
  }
  await refresh();
  const next = state.sets[state.set + 1];
  if (next) for (const view of views) new Image().src = imageOf(view, next.numbers) || "data:,";
}

function imageOf(view, numbers) {
  return numbers[view.name] === undefined ? "" : `/images/${encodeURIComponent(view.name)}/${numbers[view.name]}`;
}

function choosePoint(name, ask = true) {
  state.point = name;
  if (ask) { redraw(); refresh(); }
}

function stepPoint(by) {
  const names = state.sheet === "control" ? Object.keys(state.facts.places) : state.facts.points;
  const index = names.indexOf(state.point) + by;
  if (names.length) choosePoint(names[(index + names.length) % names.length]);
  document.querySelector("#points tr[aria-selected=true]")?.scrollIntoView({ block: "nearest" });
}

function advance() {
  const then = byId("then").value;
  if (then === "point") stepPoint(1);
  else if (then === "set" && state.set + 1 < state.sets.length) showSet(state.set + 1);
}

function chooseSheet(sheet) {
  const control = sheet === "control";
  Object.assign(state, { sheet, answer: null });
  for (const element of document.querySelectorAll(".for-points")) element.hidden = control;
  for (const element of document.querySelectorAll(".for-control")) element.hidden = !control;
  byId("heading").textContent = control ? "Control points" : "Points";
  byId("expected-what").textContent = control ? "places by the rig" : "reprojections";
  const names = control ? Object.keys(state.facts.places) : state.facts.points;
  choosePoint(names.includes(state.point) ? state.point : (names[0] ?? ""));
}

function zoomToPoint() {
  for (const view of views) {
    const at = state.answer?.clicks[view.name]?.[state.point] ?? (state.answer && seenIn(state.answer, state.point, view.name));
    const half = Math.max(view.width, view.height) / 16;
    if (at) view.show(at[0] - half, at[1] - half, at[0] + half, at[1] + half, 1);
  }
}

function nudge(key, step) {
  const mark = state.answer?.clicks[active.name]?.[state.point];
  if (!mark) return;
  const [du, dv] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
  const pixel = [mark[0] + step * du, mark[1] + step * dv];
  put(active, pixel);
  magnify(active, pixel);
}

/** Take back the latest change, where it was made. */
async function undo() {
  const change = undone.pop();
  if (!change) { say("nothing to take back"); return; }
  if (change.pixel === undefined) await saved;
  if (change.pixel === undefined) { await undo(); return; } // it could not be saved
  if (change.sheet !== state.sheet) { byId("sheet").value = change.sheet; chooseSheet(change.sheet); }
  if (change.set !== state.set) await showSet(change.set);
  if (change.point !== state.point) choosePoint(change.point);
  put(change.view, change.pixel, false);
}

function onKey(event) {
  if (event.ctrlKey && event.key === "z" && !isTyping(event)) { event.preventDefault(); undo(); return; }
  if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey || event.target.type === "range") return;
  const { key } = event;
  if (key.startsWith("Arrow")) nudge(key, event.shiftKey ? 0.1 : 1);
  else if (key === "Delete" || key === "Backspace") { if (state.answer?.clicks[active.name]?.[state.point]) put(active, null); }
  else if (key === "n" || key === "p") stepPoint(key === "n" ? 1 : -1);
  else if (".>:".includes(key)) showSet(state.set + (event.shiftKey ? 10 : 1)); // the same keys with Shift, as layouts have them
  else if (",<;".includes(key)) showSet(state.set - (event.shiftKey ? 10 : 1));
  else if (/^[1-9]$/.test(key) && key <= views.length) alone(views[key - 1]);
  else if (key === "z") zoomToPoint();
  else if (key === "e") byId("lines").click();
  else if (key === "?") byId("keys").showModal();
  else return;
  event.preventDefault();
}

function listen() {
  document.addEventListener("keydown", onKey);
  byId("before").onclick = () => showSet(state.set - 1);
  byId("after").onclick = () => showSet(state.set + 1);
  byId("set").oninput = (event) => showSet(Number(event.target.value));
  byId("sheet").onchange = (event) => { event.target.blur(); chooseSheet(event.target.value); };
  byId("then").onchange = (event) => event.target.blur();
  byId("constraint").onchange = (event) => { event.target.blur(); refresh(); };
  byId("sigma").onchange = () => refresh();
  byId("lines").onchange = (event) => { state.showLines = event.target.checked; redraw(); };
  byId("expected").onchange = (event) => { state.showExpected = event.target.checked; redraw(); };
  byId("help").onclick = () => byId("keys").showModal();
  byId("close-keys").onclick = () => byId("keys").close();
  byId("new").onsubmit = async (event) => {
    event.preventDefault();
    const name = byId("name").value.trim();
    const answer = await attempt(() => request("/api/digitizing/point", { name }));
    if (!answer) return;
    state.facts = answer;
    byId("name").value = "";
    byId("name").blur();
    choosePoint(name);
  };
  byId("save").onclick = async () => {
    const answer = await attempt(() => request("/api/digitizing/save", asked()));
    if (!answer) return;
    const wrote = answer.written.length ? `wrote ${answer.written.join(" and ")}` : "no point has two views yet";
    const [first, ...more] = answer.contradictions;
    if (first) say(`${wrote}, but clicks disagree: ${first}${more.length ? ` and ${more.length} more` : ""}`, "bad");
    else say(wrote);
  };
  window.addEventListener("beforeunload", (event) => { if (waiting.length || sending) event.preventDefault(); });
}
