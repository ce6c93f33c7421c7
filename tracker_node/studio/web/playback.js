// A run over its images: what was tracked, how well, and when it was not.

import { bindLook, bodyOverlay, latestOnly, look, overlayToggled, zoomToBody } from "/body.js";
import { ViewGrid, attempt, clamp, isTyping, request, say } from "/common.js";
import { onClicks, onKeys, openPageWith } from "/page.js";
import { Curves, showState } from "/playback_side.js";
import { Timeline } from "/timeline.js";

const $ = (id) => document.getElementById(id);
const KEPT = 400; // overlays
const MOST_LEFT_OUT = 3; // image sets, where images do not come in time

class PlaybackPage {
  constructor(run) {
    this.run = run; this.n = run.seconds.length;
    this.row = 0; this.drawn = {}; this.playing = false;
    this.overlays = new Map(); // row -> what is drawn there, the latest of them
    this.grid = new ViewGrid($("views"), run.cameras);
    this.timeline = new Timeline($("timeline"), (row) => this.goTo(row));
    this.bring = latestOnly((row) => this.showRow(row));
    for (const view of this.grid.views) view.overlays.push(bodyOverlay(() => ({ ...run, drawn: this.drawn[view.name], hot: -1 })));
    this.listen();
    $("timeline").setAttribute("aria-valuemax", this.n - 1);
    if (run.problem) say(run.problem, "bad");
    new Curves(run, this.timeline, $("dofs"), $("filter"));
    this.goTo(0).then(() => this.zoomAll());
  }

  // --- one image set: its overlay and its images appear together

  async overlaysOf(row) {
    if (!this.overlays.has(row)) {
      this.overlays.set(row, request("/api/playback/drawn", { row }).then(({ cameras }) => cameras));
      if (this.overlays.size > KEPT) this.overlays.delete(this.overlays.keys().next().value);
    }
    try { return await this.overlays.get(row); } catch (error) { this.overlays.delete(row); throw error; }
  }

  urlOf(view, row) {
    const number = this.run.numbers[row][view.name];
    const shrink = view.scale * (window.devicePixelRatio || 1) < 0.55 ? 2 : 1;
    return number === undefined ? "" : `/api/playback/images/${view.name}/${number}?shrink=${shrink}`;
  }

  async showRow(row) {
    const overlays = await attempt(() => this.overlaysOf(row));
    await Promise.all(this.grid.views.map((view) => view.setImage(this.urlOf(view, row))));
    this.drawn = overlays ?? {};
    this.grid.redraw();
  }

  goTo(row) {
    const { run, timeline, n } = this;
    this.row = timeline.cursor = clamp(row, 0, n - 1);
    timeline.draw();
    $("timeline").setAttribute("aria-valuenow", this.row);
    $("where").textContent = `set ${this.row} of ${n}, ${run.seconds[this.row].toFixed(3)} s`;
    showState($("state"), run, this.row);
    return this.bring(this.row);
  }

  zoomAll() { this.grid.views.forEach((view) => zoomToBody(view, this.drawn[view.name])); }

  // --- playing: by the clock; where images do not come in time a few are left out, beyond that it plays slower

  async play() {
    this.playing = !this.playing;
    $("play").textContent = this.playing ? "Pause" : "Play";
    if (!this.playing) return;
    if (this.row >= this.n - 1) await this.goTo(0);
    let clock = performance.now();
    while (this.playing && this.row < this.n - 1) {
      const speed = Number($("speed").value), passed = ((performance.now() - clock) / 1000) * speed;
      const next = this.nextAfter(passed);
      const wait = ((this.run.seconds[next] - this.run.seconds[this.row] - passed) / speed) * 1000;
      if (wait > 1) await new Promise((done) => setTimeout(done, wait));
      clock = performance.now() - Math.max(0, -Math.max(wait, -100)); // what is a little late is made up for
      if (this.playing) { this.fetchAhead(next + 1); await this.goTo(next); }
    }
    this.playing = false;
    $("play").textContent = "Play";
  }

  /** The image set that is due so many seconds of the run after the one that is shown. */
  nextAfter(passed) {
    const { row, n, run: { seconds } } = this;
    let next = row + 1;
    while (next < n - 1 && next <= row + MOST_LEFT_OUT && seconds[next + 1] - seconds[row] <= passed) next++;
    return next;
  }

  fetchAhead(row) {
    if (row >= this.n) return;
    this.overlaysOf(row).catch(() => {});
    for (const view of this.grid.views) if (this.urlOf(view, row)) new Image().src = this.urlOf(view, row);
  }

  /** Whether a stretch of trouble begins there. */
  entersTrouble(row) {
    const { status, statuses } = this.run, isTrouble = (at) => statuses[status[at]] !== "tracking";
    return isTrouble(row) && (row === 0 || !isTrouble(row - 1) || status[row - 1] !== status[row]);
  }

  /** On to the next stretch of trouble in a direction. */
  toTrouble(way) {
    let row = this.row + way;
    while (row >= 0 && row < this.n && !this.entersTrouble(row)) row += way;
    if (row >= 0 && row < this.n) this.goTo(row); else say(way > 0 ? "no trouble after this" : "no trouble before this");
  }

  // --- what listens

  listen() {
    look.skeleton = false;
    const changeLook = bindLook(() => this.grid.redraw());
    const by = (step) => () => this.goTo(this.row + step), trouble = (way) => () => this.toTrouble(way);
    const play = () => this.play(), zoom = () => this.zoomAll(), help = () => $("keys").showModal();
    onClicks({ play, before: by(-1), after: by(1), trouble: trouble(1), zoom, help });
    const others = { " ": play, n: trouble(1), p: trouble(-1), z: zoom, "?": help,
      o: () => changeLook({ ...overlayToggled(), skeleton: false }) };
    onKeys((event) => {
      const { key, target } = event, far = event.shiftKey ? 10 : 1;
      if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey) return undefined;
      if (key === " " && target.matches?.("button, input[type=checkbox]")) return undefined;
      const moves = { ArrowLeft: by(-far), ArrowRight: by(far), Home: () => this.goTo(0), End: () => this.goTo(this.n - 1) };
      return (target.type === "range" ? undefined : moves[key]) ?? others[key.toLowerCase()] ?? this.grid.actionOf(key);
    });
  }
}

await openPageWith("playback.html", "/api/playback/run", (_session, run) => new PlaybackPage(run));
