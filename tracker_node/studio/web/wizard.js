// The seven steps from videos to a report: each with its state, what was found, its fields, its commands and one button.

import { attempt, make, request, say } from "/common.js";
import { openPage, showFiles } from "/page.js";

const PERIOD_MS = 700;
const STATE_CLASS = { done: "good", "to do": "first", "if needed": "soft", "not yet": "soft" };
let chosen = {}; // step -> { way, values }, kept for a page that is drawn or loaded again
const opened = {}; // step -> whether somebody has opened or closed it
let facts = null;

async function load() {
  facts = await request("/api/wizard/steps");
  document.getElementById("folder").textContent = facts.folder;
  chosen = JSON.parse(sessionStorage.getItem(facts.folder) ?? "{}");
  draw();
  if (facts.job.running) setTimeout(follow, PERIOD_MS);
}

function keep() { sessionStorage.setItem(facts.folder, JSON.stringify(chosen)); }

/** Until the job is over. */
async function follow() {
  const job = await attempt(() => request("/api/wizard/job"));
  if (job?.running) {
    facts.job = job;
    drawJob();
    setTimeout(follow, PERIOD_MS);
    return;
  }
  await attempt(load);
  await attempt(async () => showFiles(await request("/api/session")));
  if (facts.job.error) say(facts.job.error, "bad");
  else say(facts.job.canceled ? "canceled" : "done");
}

function draw() {
  const next = facts.steps.find((step) => step.state === "to do") ?? facts.steps.at(-1);
  document.getElementById("steps").replaceChildren(...facts.steps.map((step, i) => drawn(step, i + 1, step === next)));
  drawJob();
}

function drawn(step, number, isNext) {
  const doing = facts.job.step === step.name; // or has been done last: people want to see how that went
  const body = make("div", {});
  const details = make("details", { class: "step", id: `step-${step.name}`, open: opened[step.name] ?? (doing || isNext) },
    make("summary", {}, make("b", {}, `${number}. ${step.title}`), make("span", { class: `state ${STATE_CLASS[step.state]}` }, step.state),
      make("span", { class: "said" }, step.said)), body);
  details.querySelector("summary").addEventListener("click", () => { opened[step.name] = !details.open; });
  if (step.found.length) body.append(make("ul", {}, ...step.found.map((line) => make("li", {}, line))));
  if (step.state !== "not yet" && step.ways.length) body.append(form(step));
  body.append(make("div", { class: "job" }));
  for (const name of step.files) {
    const path = `/api/wizard/file/${name}`;
    if (name.endsWith(".png")) body.append(make("img", { src: `${path}?${Date.now()}`, alt: name }));
    else body.append(make("p", {}, make("a", { href: path, target: "_blank" }, `Open ${name}`)));
  }
  for (const [label, path] of Object.entries(step.links)) {
    if (step.state !== "not yet") body.append(make("p", {}, make("a", { href: path }, label)));
  }
  return details;
}

/** Ways, fields, command lines and the button of a step. */
function form(step) {
  const choice = chosen[step.name] ??= { way: step.ways[0].name, values: {} };
  if (!step.ways.some((way) => way.name === choice.way)) choice.way = step.ways[0].name;
  const way = step.ways.find((each) => each.name === choice.way);
  const lines = make("pre", {}), label = step.state === "done" ? `${step.title}: again` : step.title;
  const button = make("button", { class: "primary", type: "button", disabled: true }, label); // until its commands are shown
  const values = () => Object.fromEntries(way.fields.map((field) => [field.name, valueOf(field, choice)]));
  const asked = () => ({ step: step.name, way: way.name, values: values() });
  let plans = 0;
  const plan = async () => {
    const number = ++plans;
    const answer = await request("/api/wizard/plan", asked()).catch((error) => ({ commands: [], missing: error.message }));
    if (number < plans) return; // of what has been typed over
    lines.textContent = answer.missing || answer.commands.join("\n");
    lines.classList.toggle("soft", Boolean(answer.missing));
    button.disabled = Boolean(answer.missing) || facts.job.running;
  };
  button.addEventListener("click", async () => {
    button.disabled = true; // two clicks are one
    const job = await attempt(() => request("/api/wizard/start", asked()));
    if (!job) { await attempt(load); return; } // another page's may be running, which can be canceled here too
    facts.job = job;
    opened[step.name] = undefined;
    draw();
    setTimeout(follow, PERIOD_MS);
  });
  const box = make("div", {});
  if (step.ways.length > 1) {
    const select = make("select", { "data-way": step.name }, ...step.ways.map((each) => make("option", { value: each.name, selected: each === way }, each.label)));
    select.addEventListener("change", () => { choice.way = select.value; opened[step.name] = true; keep(); draw(); });
    box.append(make("label", {}, make("span", {}, "by"), select));
  } else box.append(make("p", { class: "soft" }, way.label));
  for (const field of way.fields) box.append(make("label", {}, make("span", {}, field.label), input(field, choice, plan)));
  box.append(lines, make("div", { class: "doing" }, button));
  plan();
  return box;
}

/** What somebody has said, unless it is none of the options any more. */
function valueOf(field, choice) {
  const value = choice.values[field.name];
  return value === undefined || (field.kind === "choice" && !field.options.includes(value)) ? field.value : value;
}

function input(field, choice, changed) {
  const value = valueOf(field, choice);
  const element = field.kind === "choice"
    ? make("select", {}, ...(field.value ? [] : [make("option", { value: "" }, field.options.length ? "choose\u2026" : "none here")]),
      ...field.options.map((option) => make("option", { value: option, selected: option === value }, option)))
    : make("input", { type: "text", inputmode: field.kind === "number" && "decimal", value }); // a number field drops commas
  element.dataset.field = field.name;
  element.addEventListener("input", () => { choice.values[field.name] = element.value; keep(); changed(); });
  return element;
}

/** Progress and last lines of what runs, or why it ended. */
function drawJob() {
  const job = facts.job, place = document.querySelector(`#step-${job.step} .job`);
  if (!place) return;
  place.replaceChildren();
  if (!job.running && !job.lines.length) return;
  if (job.running) {
    for (const button of document.querySelectorAll(".step .doing > button.primary")) button.disabled = true;
    const bar = make("progress", job.progress ? { max: job.progress[1], value: job.progress[0] } : {});
    const cancel = make("button", { type: "button", id: "cancel" }, "Cancel");
    cancel.addEventListener("click", () => { cancel.disabled = true; attempt(() => request("/api/wizard/cancel", {})); });
    place.append(make("div", { class: "doing" }, bar, make("span", { class: "mono" }, job.progress ? job.progress.join(" of ") : "working"), cancel));
  }
  if (job.error) place.append(make("p", { class: "bad", role: "alert" }, job.error));
  place.append(...job.notes.map((note) => make("p", { class: "fair" }, note)));
  if (job.canceled) place.append(make("p", { class: "soft" }, "canceled"));
  const log = make("pre", { class: "log", tabindex: "0", "aria-label": "what the commands say" }, job.lines.join("\n"));
  place.append(log);
  log.scrollTop = log.scrollHeight;
}

const session = await attempt(() => openPage("wizard.html"));
if (session) {
  await load().catch((error) => { document.getElementById("steps").replaceChildren(make("p", { class: "notice" }, error.message)); });
}
