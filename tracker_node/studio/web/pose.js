// The pose of a body, set by hand: the page asks the server to draw, score, drag and fit it.

import { bindLook, latestOnly, look, overlayToggled, zoomToBody } from "/body.js";
import { ViewGrid, attempt, clamp, isTyping, make, request } from "/common.js";
import { makeFields, words } from "/fields.js";
import { History } from "/history.js";
import { onClicks, onKeys, openPageWith } from "/page.js";
import { bindFiles } from "/pose_files.js";
import { bindMouse } from "/pose_mouse.js";
import { showScores } from "/score_panel.js";

const $ = (id) => document.getElementById(id);

class PosePage {
  constructor(session, body) {
    this.session = session; this.body = body;
    this.history = new History(body.values);
    this.shown = { cameras: {}, scores: null, hot: -1, set: 0 };
    this.grid = new ViewGrid($("views"), session.cameras);
    this.fields = makeFields($("fields"), body.groups, (index, value, done) => this.turn(index, value, done));
    // What is asked meanwhile is left out, but for the last
    this.ask = latestOnly((question) => this.answer(question));
    this.score = latestOnly((values) => this.showScore(values));
    this.tellKept = latestOnly(([path, pose]) => attempt(() => request(path, pose)));
    this.bringImages = latestOnly((numbers) => Promise.all(this.grid.views.map(
      (view) => view.setImage(view.name in numbers ? `/images/${view.name}/${numbers[view.name]}` : ""))));
    for (const view of this.grid.views) bindMouse(view, this);
    this.listen();
    if (body.kept) this.history.set(body.kept.values, true, "kept");
    $("kept").hidden = !body.kept;
    this.ask({ path: "/api/pose/show", asked: { values: this.history.now }, then: (answer) => { this.draw(answer); this.zoomAll(); } });
    this.goTo(body.kept?.set ?? 0);
  }

  // --- asking the server

  show(values) { this.ask({ path: "/api/pose/show", asked: { values } }); }

  async answer({ path, asked, then }) {
    const changes = this.history.changes;
    const answer = await attempt(() => request(path, asked));
    if (!answer) return;
    if (this.history.changes === changes) {
      then?.(answer);
      this.take(answer);
    } else { // somebody has gone on meanwhile, and is drawn next
      this.draw(answer);
    }
  }

  draw({ cameras }) {
    this.shown.cameras = cameras;
    this.grid.redraw();
  }

  take(answer) {
    this.draw(answer);
    this.history.adjust(answer.values);
    this.fields.set(answer.values);
    $("undo").disabled = !this.history.canUndo;
    $("redo").disabled = !this.history.canRedo;
    this.keep(answer.values);
    this.score(answer.values);
  }

  async showScore(values) {
    const score = await attempt(() => request("/api/pose/score", { values, set: this.shown.set }));
    if (!score) return;
    this.shown.scores = score.parts;
    showScores($("score"), score, this.body.score);
    if (look.byScore) this.grid.redraw();
  }

  zoomAll() { this.grid.views.forEach((view) => zoomToBody(view, this.shown.cameras[view.name])); }

  goTo(set) {
    const { sets } = this.session;
    this.shown.set = clamp(set, 0, sets.length - 1);
    const { stamp_ns, numbers } = sets[this.shown.set];
    $("set").value = this.shown.set;
    $("where").textContent = `set ${this.shown.set} of ${sets.length}, ${(stamp_ns * 1e-9).toFixed(3)} s`;
    this.bringImages(numbers);
    this.score(this.history.now);
    this.keep(this.history.now);
  }

  // --- what changes the pose

  turn(index, value, done) {
    const values = [...this.history.now];
    values[index] = value;
    this.history.set(values, done, index);
    this.show(values);
  }

  undo() { if (this.history.undo()) this.show(this.history.now); }

  redo() { if (this.history.redo()) this.show(this.history.now); }

  neutral() {
    const values = [...this.history.now];
    for (const { dofs } of this.body.groups) for (const dof of dofs) if (dof.neutral !== null) values[dof.index] = dof.neutral;
    this.history.set(values, true, "neutral");
    this.show(values);
  }

  /** The server keeps the pose for a reload of the page, unless it is the one that the page begins with. */
  keep(values) {
    if (!this.history.changes) return;
    const changed = values.some((value, i) => Math.abs(value - this.body.values[i]) > 1e-6);
    this.tellKept(changed ? ["/api/pose/keep", { values, set: this.shown.set }] : ["/api/pose/discard", {}]);
  }

  /** Back to the pose that the page began with; `undo` takes that back. */
  discard() {
    $("kept").hidden = true;
    this.history.set(this.body.values, true, "discard");
    this.show(this.history.now);
  }

  async fit() {
    if ($("fit").disabled) return;
    $("fit").disabled = true;
    $("fitted").hidden = false;
    $("fitted").textContent = "fitting…";
    const asked = { values: this.history.now, set: this.shown.set };
    const answer = await attempt(() => request("/api/pose/fit", asked));
    $("fit").disabled = false;
    $("fitted").hidden = !answer;
    if (!answer) return;
    this.history.set(answer.values, true, "fit");
    this.take(answer);
    showFitted(answer);
  }

  // --- what listens

  listen() {
    const before = () => this.goTo(this.shown.set - 1), after = () => this.goTo(this.shown.set + 1), help = () => $("keys").showModal();
    const undo = () => this.undo(), redo = () => this.redo(), fit = () => this.fit(), zoom = () => this.zoomAll();
    const changeLook = bindLook(() => this.grid.redraw());
    const files = bindFiles(this.body.folder, () => ({ values: this.history.now, set: this.shown.set }), (answer) => {
      this.history.set(answer.values, true, "load");
      this.take(answer);
    });
    onClicks({ discard: () => this.discard(), undo, redo, neutral: () => this.neutral(), fit, zoom, help, before, after, fold });
    $("set").max = this.session.sets.length - 1;
    $("set").addEventListener("input", () => this.goTo($("set").valueAsNumber));
    const control = { z: undo, y: redo, s: files.openSaving };
    const plain = { f: fit, z: zoom, ",": before, ".": after, "?": help,
      h: () => changeLook({ skeleton: !look.skeleton }), o: () => changeLook(overlayToggled()) };
    onKeys((event) => {
      const key = event.key.toLowerCase();
      if (key === "z" && event.ctrlKey && event.shiftKey) return redo;
      if (event.ctrlKey || event.metaKey) return control[key];
      return event.altKey || isTyping(event) ? undefined : plain[key] ?? this.grid.actionOf(key);
    });
  }
}

function showFitted(answer) {
  const kind = { TRACKING: "good", DEGRADED: "fair" }[answer.status] ?? "bad";
  const residual = answer.residual === null ? "" : `residual ${answer.residual.toFixed(1)} ${answer.unit}, `;
  const said = make("div", { class: "soft" }, `${residual}fitted in ${answer.seconds.toFixed(1)} s`);
  $("fitted").replaceChildren(make("b", { class: kind }, answer.status.toLowerCase()), answer.reason ? `: ${answer.reason}` : "", said);
  $("fitted").title = answer.limbs.map((limb) => `${words(limb.name)}: ${limb.status.toLowerCase()} ${limb.reason}`).join("\n");
}

/** Close the joints' sliders, or open all of them. */
function fold() {
  const boxes = [...document.querySelectorAll("details.joint")], open = boxes.some((box) => box.open);
  boxes.forEach((box) => { box.open = !open; });
  $("fold").textContent = open ? "Unfold" : "Fold";
}

await openPageWith("pose.html", "/api/pose/body", (session, body) => new PosePage(session, body));
