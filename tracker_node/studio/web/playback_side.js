// Beside the images of a run: what was said of an image set, and curves of what people choose.

import { attempt, make, request } from "/common.js";
import { words } from "/fields.js";
import { CURVE_COLORS, STATUS_COLOR } from "/timeline.js";

const FIRST_CURVES = 2;

/** Status, residuals, limbs and cameras of a state. */
export function showState(container, run, row) {
  const status = run.statuses[run.status[row]];
  const word = make("b", { class: "status", id: "status" }, status);
  word.style.color = `var(--${status}-word)`;
  word.style.borderColor = STATUS_COLOR[status];
  const limbs = run.limbs.map((name, i) => {
    const said = run.limb_statuses[run.limb_status[row][i]];
    return line(name, STATUS_COLOR[said], said);
  });
  const cameras = run.residual_cameras.map((name, i) => line(name, "", residual(run, run.camera_residuals[row][i])));
  container.replaceChildren(
    word, make("div", { id: "reason" }, run.reasons[row]), make("div", { class: "soft" }, `residual ${residual(run, run.residual[row])}`),
    make("table", {}, ...limbs), make("table", {}, ...cameras));
}

function line(name, color, value) {
  const dot = make("span", { class: "dot" });
  dot.style.background = color;
  return make("tr", {}, make("td", {}, ...(color ? [dot, words(name)] : [name])), make("td", { class: "number" }, value));
}

/** A camera that had no part in the fit has no residual. */
function residual(run, value) { return `${value === null ? "–" : value.toFixed(2)} ${run.residual_unit}`; }

/** The list of degrees of freedom, and the curves of those that are chosen, below the strips of a timeline. */
export class Curves {
  constructor(run, timeline, list, filter) {
    this.run = run; this.timeline = timeline;
    this.chosen = new Map(); // name -> { values, unit, color }
    const rows = run.dofs.map((dof) => this._row(dof));
    list.replaceChildren(...rows);
    filter.addEventListener("input", () => {
      const asked = filter.value.toLowerCase();
      rows.forEach((row) => { row.hidden = !row.textContent.toLowerCase().includes(asked); });
    });
    this._show();
    const joints = rows.slice(6).length ? rows.slice(6) : rows;
    const first = joints.filter((row) => /(knee|elbow) flexion/.test(row.textContent)).concat(joints).slice(0, FIRST_CURVES);
    new Set(first).forEach((row) => row.querySelector("input").click());
  }

  _row(dof) {
    const box = make("input", { type: "checkbox", "data-dof": dof.name }), swatch = make("span", { class: "swatch" });
    box.addEventListener("change", () => this._choose(box, swatch, dof));
    return make("label", {}, box, make("span", { class: "name" }, words(dof.name)), swatch);
  }

  async _choose(box, swatch, { name, unit }) {
    if (!box.checked) { this.chosen.delete(name); swatch.style.background = ""; this._show(); return; }
    const curve = { values: [], unit, color: this._freeColor() };
    this.chosen.set(name, curve);
    swatch.style.background = curve.color;
    const answer = await attempt(() => request("/api/playback/curve", { name }));
    if (answer) curve.values = answer.values; else this.chosen.delete(name);
    this._show();
  }

  _freeColor() {
    const used = new Set([...this.chosen.values()].map(({ color }) => color));
    return CURVE_COLORS.find((free) => !used.has(free)) ?? CURVE_COLORS[this.chosen.size % CURVE_COLORS.length];
  }

  _show() {
    const { run } = this;
    const strips = [{ name: "status", colors: run.status.map((status) => STATUS_COLOR[run.statuses[status]]) }];
    run.limbs.forEach((name, i) => strips.push({ name: words(name), colors: run.limb_status.map((row) => STATUS_COLOR[run.limb_statuses[row[i]]]) }));
    const plots = [{ name: "residual", unit: run.residual_unit, curves: [{ values: run.residual, color: "#455468" }] }];
    for (const [unit, sign] of [["deg", "°"], ["m", "m"]]) {
      const curves = [...this.chosen].filter(([, curve]) => curve.unit === unit);
      if (curves.length) plots.push({ name: "", unit: sign, curves: curves.map(([name, { values, color }]) => ({ name: words(name), values, color })) });
    }
    this.timeline.data = { seconds: run.seconds, strips, plots };
    this.timeline.draw();
  }
}
