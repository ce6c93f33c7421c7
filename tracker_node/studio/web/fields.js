// Sliders and number boxes for every degree of freedom, grouped by joint.

import { clamp, make } from "/common.js";

const STEP = { deg: 1, m: 0.01 }, DIGITS = { deg: 1, m: 3 }, SIGN = { deg: "°", m: "m" };

/**
 * Fields into a container. `onstep(index, value, done)` is called while a value changes, done when the gesture is over.
 * Returns { set(values), highlight(links) }.
 */
export function makeFields(container, groups, onstep) {
  const fields = new Map(), details = new Map();
  for (const group of groups) {
    const rows = group.dofs.map((dof) => makeRow(dof, group, fields, onstep));
    const box = make("details", { open: true, class: "joint" }, make("summary", {}, words(group.name)), ...rows);
    details.set(group.link, box);
    container.append(box);
  }
  walkWithArrows(container);
  return {
    set(values) { for (const [index, field] of fields) field.show(values[index]); },
    highlight(links) { for (const [link, box] of details) box.classList.toggle("hot", links.has(link)); },
    reveal(link) { const box = details.get(link); if (box) { box.open = true; box.scrollIntoView({ block: "nearest" }); } },
  };
}

export function words(name) { return name.replaceAll("_", " "); }

/** The axis's name without the joint's in front of it. */
function shortName(dof, group) {
  const name = dof.name.startsWith(`${group.name}_`) ? dof.name.slice(group.name.length + 1) : dof.name;
  return words(name);
}

function makeRow(dof, group, fields, onstep) {
  const step = STEP[dof.unit], digits = DIGITS[dof.unit];
  const limits = `${dof.lower.toFixed(dof.unit === "m" ? 2 : 0)} to ${dof.upper.toFixed(dof.unit === "m" ? 2 : 0)} ${SIGN[dof.unit]}`;
  const title = dof.driven ? `${words(dof.name)}: driven by another axis` : `${words(dof.name)}: ${limits}`;
  const common = { min: dof.lower, max: dof.upper, "aria-label": words(dof.name), "data-dof": dof.name, disabled: dof.driven };
  const slider = make("input", { type: "range", step: "any", ...common });
  const number = make("input", { type: "number", step: step / 10, ...common });
  if (group.name === "root") { number.removeAttribute("min"); number.removeAttribute("max"); }
  let value = 0;
  const show = (x) => {
    value = x;
    slider.value = x;
    if (document.activeElement !== number || !number.dataset.typing) number.value = x.toFixed(digits);
  };
  const moveTo = (x, done) => {
    const limited = group.name === "root" ? x : clamp(x, dof.lower, dof.upper);
    show(limited);
    onstep(dof.index, limited, done);
  };
  const keys = (event) => {
    const size = step * (event.shiftKey ? 0.1 : event.ctrlKey ? 10 : 1), up = event.target === number;
    const by = { ArrowRight: up ? 0 : size, ArrowLeft: up ? 0 : -size, ArrowUp: up ? size : 0, ArrowDown: up ? -size : 0,
      PageUp: 10 * step, PageDown: -10 * step }[event.key];
    if (event.key === "Home" && !up) moveTo(dof.neutral ?? value, true);
    else if (by) { delete number.dataset.typing; moveTo(value + by, true); } else return;
    event.preventDefault();
  };
  slider.addEventListener("input", () => moveTo(slider.valueAsNumber, false));
  slider.addEventListener("change", () => moveTo(slider.valueAsNumber, true));
  slider.addEventListener("keydown", keys);
  number.addEventListener("keydown", keys);
  number.addEventListener("input", () => { number.dataset.typing = "1"; if (!Number.isNaN(number.valueAsNumber)) moveTo(number.valueAsNumber, false); });
  number.addEventListener("change", () => {
    delete number.dataset.typing;
    moveTo(Number.isNaN(number.valueAsNumber) ? value : number.valueAsNumber, true);
  });
  number.addEventListener("blur", () => { delete number.dataset.typing; show(value); });
  fields.set(dof.index, { show });
  return make("label", { class: "dof", title }, make("span", { class: "name" }, shortName(dof, group)), slider, number, make("span", { class: "soft" }, SIGN[dof.unit]));
}

/** On sliders, the arrows up and down go to the slider before and after. */
function walkWithArrows(container) {
  container.addEventListener("keydown", (event) => {
    const way = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!way || event.target.type !== "range") return;
    const sliders = [...container.querySelectorAll("details[open] input[type=range]:not(:disabled)")];
    sliders[clamp(sliders.indexOf(event.target) + way, 0, sliders.length - 1)].focus();
    event.preventDefault();
  });
}
