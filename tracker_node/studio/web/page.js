// What every page begins with: the header with the navigation, its own facts, and what listens to people.

import { attempt, make, request } from "/common.js";

const PAGES = [
  ["index.html", "Start"], ["wizard.html", "New"], ["pose.html", "Pose"], ["digitizing.html", "Points"], ["playback.html", "Playback"], ["live.html", "Live"],
];

/** Put the header with the navigation on top of the page; returns the facts of the session. */
export async function openPage(current) {
  const header = make("header", { class: "studio" }, make("span", { class: "title" }, "tracker_node studio"));
  const links = PAGES.map(([file, name]) => make("a", { href: `/${file}`, ...(file === current ? { "aria-current": "page" } : {}) }, name));
  header.append(make("nav", {}, ...links), make("span", { class: "about" }));
  document.body.prepend(header);
  const session = await request("/api/session");
  showFiles(session);
  return session;
}

/** What the pages work on, in the header. */
export function showFiles(session) {
  const about = document.querySelector("header.studio .about");
  const names = [session.files.rig, session.files.model, session.files.run].filter(Boolean).map((path) => path.split("/").pop());
  about.textContent = names.join("  ·  ");
  about.title = Object.values(session.files).filter(Boolean).join("\n");
}

/** Open a page whose own facts are at `path`, and `begin(session, facts)`; without them the page says why. */
export async function openPageWith(current, path, begin) {
  const session = await attempt(() => openPage(current));
  const facts = session && await attempt(() => request(path));
  if (facts) { begin(session, facts); return; }
  const main = document.querySelector("main");
  main.replaceChildren(make("p", { class: "notice" }, document.querySelector(".message")?.textContent ?? ""));
  main.hidden = false;
}

/** What buttons do, by their ids. */
export function onClicks(actions) {
  for (const [id, action] of Object.entries(actions)) document.getElementById(id).addEventListener("click", action);
}

/** `actionOf(event)` is what a key does, or nothing; keys of dialogs are their own. */
export function onKeys(actionOf) {
  document.addEventListener("keydown", (event) => {
    const action = event.target.closest?.("dialog") ? undefined : actionOf(event);
    if (!action) return;
    event.preventDefault();
    action();
  });
}
