// The body in a view, and the mouse on it: a handle moves its limb, its joint, or all of the body.

import { bodyOverlay, look, nearestHandle } from "/body.js";
import { words } from "/fields.js";

const HANDLE_PX = 10;

let drags = 0; // each is a step of its own to be undone

/** Draw the body of a `page` (body, shown, history, fields, grid, ask) in a view, and let it be dragged there. */
export function bindMouse(view, { body, shown, history, fields, grid, ask }) {
  const drawn = () => shown.cameras[view.name];
  const handleAt = (pixel) => (look.skeleton ? nearestHandle(drawn(), pixel, view.px(HANDLE_PX)) : -1);
  let held = null;
  view.overlays.push(bodyOverlay(() => ({ ...body, drawn: drawn(), scores: shown.scores, hot: shown.hot })));
  view.onpress = (pixel, event) => {
    const handle = handleAt(pixel);
    if (handle < 0) return false;
    const at = drawn().handles[handle], off = [at[0] - pixel[0], at[1] - pixel[1]];
    held = { handle, mode: modeOf(event), values: [...history.now], off, moved: false, name: `drag ${++drags}` };
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
  const heat = (hot) => {
    view.canvas.style.cursor = hot < 0 ? "grab" : "move";
    view.setNote(hot < 0 ? "" : words(body.handles[hot].name));
    if (hot === shown.hot) return;
    shown.hot = hot;
    grid.redraw();
  };
  view.onleave = () => heat(-1);
  view.onhover = (pixel) => heat(handleAt(pixel));
}

function modeOf(event) { return event.shiftKey ? "joint" : event.altKey ? "body" : event.ctrlKey ? "turn" : "limb"; }
