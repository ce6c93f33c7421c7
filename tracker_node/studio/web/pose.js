// The pose of a body, set by hand: the page asks the server to draw, score, drag and fit it.

import { bindLook, bodyOverlay, latestOnly, look, nearestHandle, overlayToggled, zoomToBody } from "/body.js";
import { ViewGrid, attempt, clamp, isTyping, make, openPage, request } from "/common.js";
import { makeFields, words } from "/fields.js";
import { History } from "/history.js";
import { bindFiles } from "/pose_files.js";
import { showScores } from "/score_panel.js";

const $ = (id) => document.getElementById(id);
const HANDLE_PX = 10;

const session = await attempt(() => openPage("pose.html"));
const body = session && await attempt(() => request("/api/pose/body"));
if (!body) {
  document.querySelector("main").replaceChildren(make("p", { class: "notice" }, document.querySelector(".message")?.textContent ?? ""));
} else {
  start();
}

function start() {
  const history = new History(body.values);
  const shown = { cameras: {}, scores: null, hot: -1, set: 0 };
  const grid = new ViewGrid($("views"), session.cameras), { views } = grid;
  const fields = makeFields($("fields"), body.groups, (index, value, done) => {
    const values = [...history.now];
    values[index] = value;
    history.set(values, done, index);
    show(values);
  });

  // --- asking the server: what is asked meanwhile is left out, but for the last

  const scoreNow = latestOnly(async (values) => {
    const score = await attempt(() => request("/api/pose/score", { values, set: shown.set }));
    if (score) showScore(score);
  });
  const ask = latestOnly(async ({ path, asked, then }) => {
    const changes = history.changes;
    const answer = await attempt(() => request(path, asked));
    if (!answer) return;
    if (history.changes === changes) {
      then?.(answer);
      take(answer);
    } else { // somebody has gone on meanwhile, and is drawn next
      draw(answer);
    }
  });
  const show = (values) => ask({ path: "/api/pose/show", asked: { values } });

  function draw({ cameras }) {
    shown.cameras = cameras;
    grid.redraw();
  }

  function take(answer) {
    draw(answer);
    history.adjust(answer.values);
    fields.set(answer.values);
    $("undo").disabled = !history.canUndo;
    $("redo").disabled = !history.canRedo;
    scoreNow(answer.values);
  }

  function showScore(score) {
    shown.scores = score.parts;
    showScores($("score"), score, body.score);
    if (look.byScore) grid.redraw();
  }

  // --- views and the mouse

  let drags = 0;
  for (const view of views) {
    view.overlays.push(bodyOverlay(() => ({ ...body, drawn: shown.cameras[view.name], scores: shown.scores, hot: shown.hot })));
    let held = null;
    view.onpress = (pixel, event) => {
      const handle = look.skeleton ? nearestHandle(shown.cameras[view.name], pixel, view.px(HANDLE_PX)) : -1;
      if (handle < 0) return false;
      const mode = event.shiftKey ? "joint" : event.altKey ? "body" : event.ctrlKey ? "turn" : "limb";
      const at = shown.cameras[view.name].handles[handle];
      held = { handle, mode, values: [...history.now], off: [at[0] - pixel[0], at[1] - pixel[1]], moved: false, name: `drag ${++drags}` };
      return true;
    };
    view.ondrag = (pixel) => {
      const { handle, mode, values, off, name } = held;
      held.moved = true;
      const asked = { values, handle, camera: view.name, pixel: [pixel[0] + off[0], pixel[1] + off[1]], mode };
      ask({ path: "/api/pose/drag", asked, then: (answer) => history.set(answer.values, false, name) });
    };
    view.onrelease = () => {
      if (held && !held.moved) fields.reveal(body.handles[held.handle].link);
      held = null;
    };
    view.onleave = () => heat(-1);
    view.onhover = (pixel) => heat(look.skeleton ? nearestHandle(shown.cameras[view.name], pixel, view.px(HANDLE_PX)) : -1);
    const heat = (hot) => {
      view.canvas.style.cursor = hot < 0 ? "grab" : "move";
      view.setNote(hot < 0 ? "" : words(body.handles[hot].name));
      if (hot === shown.hot) return;
      shown.hot = hot;
      grid.redraw();
    };
  }

  const zoomAll = () => views.forEach((view) => zoomToBody(view, shown.cameras[view.name]));

  // --- image sets

  const bringImages = latestOnly((numbers) =>
    Promise.all(views.map((view) => view.setImage(view.name in numbers ? `/images/${view.name}/${numbers[view.name]}` : ""))));

  function goTo(set) {
    shown.set = clamp(set, 0, session.sets.length - 1);
    const { stamp_ns, numbers } = session.sets[shown.set];
    $("set").value = shown.set;
    $("where").textContent = `set ${shown.set} of ${session.sets.length}, ${(stamp_ns * 1e-9).toFixed(3)} s`;
    bringImages(numbers);
    scoreNow(history.now);
  }

  // --- actions

  const undo = () => { if (history.undo()) show(history.now); };
  const redo = () => { if (history.redo()) show(history.now); };
  const neutral = () => {
    const values = [...history.now];
    for (const { dofs } of body.groups) for (const dof of dofs) if (dof.neutral !== null) values[dof.index] = dof.neutral;
    history.set(values, true, "neutral");
    show(values);
  };
  async function fit() {
    if ($("fit").disabled) return;
    $("fit").disabled = true;
    $("fitted").hidden = false;
    $("fitted").textContent = "fitting…";
    const asked = { values: history.now, set: shown.set };
    const answer = await attempt(() => request("/api/pose/fit", asked));
    $("fit").disabled = false;
    $("fitted").hidden = !answer;
    if (!answer) return;
    history.set(answer.values, true, "fit");
    take(answer);
    const kind = { TRACKING: "good", DEGRADED: "fair" }[answer.status] ?? "bad";
    const limbs = answer.limbs.map((limb) => `${words(limb.name)}: ${limb.status.toLowerCase()} ${limb.reason}`).join("\n");
    const residual = answer.residual_px === null ? "" : `residual ${answer.residual_px.toFixed(1)} px, `;
    const said = make("div", { class: "soft" }, `${residual}fitted in ${answer.seconds.toFixed(1)} s`);
    $("fitted").replaceChildren(make("b", { class: kind }, answer.status.toLowerCase()), answer.reason ? `: ${answer.reason}` : "", said);
    $("fitted").title = limbs;
  }
  const files = bindFiles(body.folder, () => ({ values: history.now, set: shown.set }), (answer) => {
    history.set(answer.values, true, "load");
    take(answer);
  });

  // --- what listens

  const changeLook = bindLook(() => grid.redraw());
  const clicks = { undo, redo, neutral, fit, zoom: zoomAll, help: () => $("keys").showModal(),
    before: () => goTo(shown.set - 1), after: () => goTo(shown.set + 1),
    fold: () => {
      const boxes = [...document.querySelectorAll("details.joint")], open = boxes.some((box) => box.open);
      boxes.forEach((box) => { box.open = !open; });
      $("fold").textContent = open ? "Unfold" : "Fold";
    } };
  for (const [id, action] of Object.entries(clicks)) $(id).addEventListener("click", action);
  $("set").max = session.sets.length - 1;
  $("set").addEventListener("input", () => goTo($("set").valueAsNumber));
  const control = { z: undo, y: redo, s: files.openSaving };
  const plain = { f: fit, z: zoomAll, ",": clicks.before, ".": clicks.after, "?": clicks.help,
    h: () => changeLook({ skeleton: !look.skeleton }), o: () => changeLook(overlayToggled()) };
  document.addEventListener("keydown", (event) => {
    if (event.target.closest?.("dialog")) return;
    const key = event.key.toLowerCase();
    let action = event.ctrlKey || event.metaKey ? control[key] : undefined;
    if (key === "z" && event.ctrlKey && event.shiftKey) action = redo;
    if (!event.ctrlKey && !event.metaKey && !event.altKey && !isTyping(event)) {
      action = plain[key] ?? (/^[1-9]$/.test(key) ? () => grid.toggleAlone(Number(key)) : undefined);
    }
    if (!action) return;
    event.preventDefault();
    action();
  });

  ask({ path: "/api/pose/show", asked: { values: body.values }, then: (answer) => { draw(answer); zoomAll(); } });
  goTo(0);
}
