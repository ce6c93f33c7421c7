// Poses saved and loaded by name; a file is replaced only after a question.

import { attempt, make, request, say } from "/common.js";

const $ = (id) => document.getElementById(id);

/**
 * The dialog and the list of the page. `current()` gives { values, set } to be saved, `onload(answer)` gets what was loaded.
 * Returns { openSaving }.
 */
export function bindFiles(folder, current, onload) {
  async function list() {
    const { names } = (await attempt(() => request("/api/pose/names"))) ?? { names: [] };
    const options = names.map((name) => make("option", { value: name }, name));
    $("load").replaceChildren(make("option", { value: "" }, names.length ? "Load\u2026" : "none saved"), ...options);
    $("load").disabled = !names.length;
  }

  async function load(name) {
    const answer = name && await attempt(() => request("/api/pose/load", { name }));
    $("load").value = "";
    if (!answer) return;
    onload(answer);
    say(`${name} loaded`);
  }

  async function save(overwrite) {
    const asked = { ...current(), name: $("name").value, overwrite };
    const answer = await request("/api/pose/save", asked).catch((error) => ({ error: error.message }));
    if (!answer.path) { tell(answer); return; }
    say(`saved as ${answer.path}`);
    $("saving").close();
    list();
  }

  /** Why it was not saved, if there is a reason; one that exists may be replaced by the next press. */
  function tell({ exists = "", error = "" }) {
    $("exists").textContent = exists ? `${exists}: replace it?` : error;
    $("exists").hidden = !exists && !error;
    $("write").textContent = exists ? "Replace" : "Save";
    $("write").dataset.replace = exists ? $("name").value : "";
  }

  const openSaving = () => { tell({}); $("saving").showModal(); };
  $("save").addEventListener("click", openSaving);
  $("load").addEventListener("change", () => load($("load").value));
  $("folder").textContent = folder;
  $("saving").addEventListener("submit", (event) => {
    if (event.submitter?.value !== "yes") return;
    event.preventDefault();
    save($("write").dataset.replace === $("name").value);
  });
  list();
  return { openSaving };
}
