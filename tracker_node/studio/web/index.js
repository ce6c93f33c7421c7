import { attempt, make } from "/common.js";
import { openPage } from "/page.js";

const session = await attempt(() => openPage("index.html"));
if (session) {
  const rows = Object.entries(session.files).map(([name, path]) => [name.replace("_", " "), path ?? "not given"]);
  rows.push(["cameras", session.cameras.map((c) => `${c.name} (${c.width} x ${c.height})`).join(", ") || "none"]);
  rows.push(["body", session.model ? `${session.model.name}, ${session.model.n_dof} degrees of freedom` : "none"]);
  rows.push(["image sets", String(session.sets.length)], ...session.problems.map((problem) => ["problem", problem]));
  document.getElementById("facts").append(...rows.map(([name, value]) => make("tr", {}, make("th", {}, `${name}\u2003`), make("td", {}, value))));
}
