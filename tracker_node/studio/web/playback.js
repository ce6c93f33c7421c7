// A run over its images: what was tracked, how well, and when it was not.

import { bindLook, bodyOverlay, latestOnly, look, overlayToggled, zoomToBody } from "/body.js";
import { ViewGrid, attempt, clamp, isTyping, make, openPage, request, say } from "/common.js";
import { words } from "/fields.js";
import { CURVE_COLORS, STATUS_COLOR, Timeline } from "/timeline.js";

const $ = (id) => document.getElementById(id);
const FIRST_CURVES = 2, KEPT = 400;

const session = await attempt(() => openPage("playback.html"));
const run = session && await attempt(() => request("/api/playback/run"));
if (!run) {
  document.querySelector("main").replaceChildren(make("p", { class: "notice" }, document.querySelector(".message")?.textContent ?? ""));
} else {
  start();
}

function start() {
  const n = run.seconds.length;
  const now = { row: 0, drawn: {}, playing: false };
  const drawn = new Map(); // row -> its overlays, the latest of them
  const grid = new ViewGrid($("views"), run.cameras), { views } = grid;
  const timeline = new Timeline($("timeline"), (row) => goTo(row));
  const curves = new Map();

  for (const view of views) view.overlays.push(bodyOverlay(() => ({ ...run, drawn: now.drawn[view.name], hot: -1 })));

  // --- one image set: its overlay and its images appear together

  async function overlaysOf(row) {
    if (!drawn.has(row)) {
      drawn.set(row, request("/api/playback/drawn", { row }).then(({ cameras }) => cameras));
      if (drawn.size > KEPT) drawn.delete(drawn.keys().next().value);
    }
    try { return await drawn.get(row); } catch (error) { drawn.delete(row); throw error; }
  }

  const urlOf = (view, row) => {
    const number = run.numbers[row][view.name];
    const shrink = view.scale * (window.devicePixelRatio || 1) < 0.55 ? 2 : 1;
    return number === undefined ? "" : `/api/playback/images/${view.name}/${number}?shrink=${shrink}`;
  };

  const bring = latestOnly(async (row) => {
    const overlays = await attempt(() => overlaysOf(row));
    await Promise.all(views.map((view) => view.setImage(urlOf(view, row))));
    now.drawn = overlays ?? {};
    grid.redraw();
  });

  function goTo(row) {
    now.row = clamp(row, 0, n - 1);
    timeline.cursor = now.row;
    timeline.draw();
    $("timeline").setAttribute("aria-valuenow", now.row);
    $("where").textContent = `set ${now.row} of ${n}, ${run.seconds[now.row].toFixed(3)} s`;
    showState();
    return bring(now.row);
  }

  // --- playing: by the clock; where images do not come in time a few are left out, beyond that it plays slower

  const MOST_LEFT_OUT = 3;

  async function play() {
    now.playing = !now.playing;
    $("play").textContent = now.playing ? "Pause" : "Play";
    if (!now.playing) return;
    if (now.row >= n - 1) await goTo(0);
    let clock = performance.now();
    while (now.playing && now.row < n - 1) {
      const speed = Number($("speed").value), passed = ((performance.now() - clock) / 1000) * speed, from = run.seconds[now.row];
      let next = now.row + 1;
      while (next < n - 1 && next <= now.row + MOST_LEFT_OUT && run.seconds[next + 1] - from <= passed) next++;
      const wait = ((run.seconds[next] - from - passed) / speed) * 1000;
      if (wait > 1) await new Promise((done) => setTimeout(done, wait));
      clock = performance.now() - Math.max(0, -Math.max(wait, -100)); // what is a little late is made up for
      if (now.playing) { fetchAhead(next + 1); await goTo(next); }
    }
    now.playing = false;
    $("play").textContent = "Play";
  }

  function fetchAhead(row) {
    if (row >= n) return;
    overlaysOf(row).catch(() => {});
    for (const view of views) if (urlOf(view, row)) new Image().src = urlOf(view, row);
  }

  const isTrouble = (row) => run.statuses[run.status[row]] !== "tracking";
  /** The next stretch of trouble in a direction: its first image set. */
  function toTrouble(way) {
    let row = now.row + way;
    const entered = () => isTrouble(row) && (row === 0 || !isTrouble(row - 1) || run.status[row - 1] !== run.status[row]);
    while (row >= 0 && row < n && !entered()) row += way;
    if (row >= 0 && row < n) goTo(row); else say(way > 0 ? "no trouble after this" : "no trouble before this");
  }

  // --- beside the images

  function showState() {
    const row = now.row, status = run.statuses[run.status[row]];
    const word = make("b", { class: "status", id: "status" }, status);
    word.style.color = STATUS_COLOR[status];
    const line = (name, color, value) => {
      const dot = make("span", { class: "dot" });
      dot.style.background = color;
      return make("tr", {}, make("td", {}, ...(color ? [dot, words(name)] : [name])), make("td", { class: "number" }, value));
    };
    const limbs = run.limbs.map((name, i) => {
      const word = run.limb_statuses[run.limb_status[row][i]];
      return line(name, STATUS_COLOR[word], word);
    });
    const pixels = (value) => `${value === null ? "–" : value.toFixed(2)} px`; // a camera that had no part in the fit has none
    const cameras = run.residual_cameras.map((name, i) => line(name, "", pixels(run.camera_residuals_px[row][i])));
    $("state").replaceChildren(
      word, make("div", { id: "reason" }, run.reasons[row]), make("div", { class: "soft" }, `residual ${pixels(run.residual_px[row])}`),
      make("table", {}, ...limbs), make("table", {}, ...cameras));
  }

  function showTimeline() {
    const strips = [{ name: "status", colors: run.status.map((status) => STATUS_COLOR[run.statuses[status]]) }];
    run.limbs.forEach((name, i) => strips.push({ name: words(name), colors: run.limb_status.map((row) => STATUS_COLOR[run.limb_statuses[row[i]]]) }));
    const plots = [{ name: "residual", unit: "px", curves: [{ values: run.residual_px, color: "#455468" }] }];
    for (const unit of ["deg", "m"]) {
      const chosen = [...curves].filter(([, curve]) => curve.unit === unit);
      if (chosen.length) plots.push({ name: "", unit: unit === "deg" ? "°" : "m", curves: chosen.map(([name, { values, color }]) => ({ name: words(name), values, color })) });
    }
    timeline.data = { seconds: run.seconds, strips, plots };
    timeline.draw();
  }

  async function choose(box, swatch, { name, unit }) {
    if (!box.checked) { curves.delete(name); swatch.style.background = ""; showTimeline(); return; }
    const used = new Set([...curves.values()].map(({ color }) => color));
    const color = CURVE_COLORS.find((free) => !used.has(free)) ?? CURVE_COLORS[curves.size % CURVE_COLORS.length];
    const curve = { values: [], unit, color };
    curves.set(name, curve);
    swatch.style.background = color;
    const answer = await attempt(() => request("/api/playback/curve", { name }));
    if (answer) curve.values = answer.values; else curves.delete(name);
    showTimeline();
  }

  function listDofs() {
    const rows = run.dofs.map((dof) => {
      const box = make("input", { type: "checkbox", "data-dof": dof.name }), swatch = make("span", { class: "swatch" });
      box.addEventListener("change", () => choose(box, swatch, dof));
      return make("label", {}, box, make("span", { class: "name" }, words(dof.name)), swatch);
    });
    $("dofs").replaceChildren(...rows);
    const joints = rows.slice(6).length ? rows.slice(6) : rows;
    const first = joints.filter((row) => /(knee|elbow) flexion/.test(row.textContent)).concat(joints).slice(0, FIRST_CURVES);
    new Set(first).forEach((row) => row.querySelector("input").click());
    $("filter").addEventListener("input", () => {
      const asked = $("filter").value.toLowerCase();
      rows.forEach((row) => { row.hidden = !row.textContent.toLowerCase().includes(asked); });
    });
  }

  // --- what listens

  const zoomAll = () => views.forEach((view) => zoomToBody(view, now.drawn[view.name]));
  look.skeleton = false;
  const changeLook = bindLook(() => grid.redraw());
  const clicks = { play, before: () => goTo(now.row - 1), after: () => goTo(now.row + 1), trouble: () => toTrouble(1), zoom: zoomAll, help: () => $("keys").showModal() };
  for (const [id, action] of Object.entries(clicks)) $(id).addEventListener("click", action);
  document.addEventListener("keydown", (event) => {
    if (event.target.closest?.("dialog") || isTyping(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    const far = event.shiftKey ? 10 : 1, key = event.key;
    const onRange = event.target.type === "range";
    const moves = { ArrowLeft: () => goTo(now.row - far), ArrowRight: () => goTo(now.row + far), Home: () => goTo(0), End: () => goTo(n - 1) };
    const others = { " ": play, n: () => toTrouble(1), p: () => toTrouble(-1), z: zoomAll, "?": clicks.help,
      o: () => changeLook({ ...overlayToggled(), skeleton: false }) };
    const action = (onRange ? undefined : moves[key]) ?? others[key.toLowerCase()]
      ?? (/^[1-9]$/.test(key) ? () => grid.toggleAlone(Number(key)) : undefined);
    if (!action || (key === " " && event.target.matches?.("button, input[type=checkbox]"))) return;
    event.preventDefault();
    action();
  });

  $("timeline").setAttribute("aria-valuemax", n - 1);
  if (run.problem) say(run.problem, "bad");
  showTimeline();
  listDofs();
  goTo(0).then(zoomAll);
}
