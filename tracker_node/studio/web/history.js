// What was done, so that it can be undone: steps of one gesture count once.

const TOGETHER_MS = 800;

export class History {
  constructor(first) {
    this._past = []; this._future = []; this._now = first;
    this._open = null; // the gesture that goes on: its name, and when it last moved
    this.changes = 0; // how often it has gone to other values, forth or back
  }

  get now() { return this._now; }
  get canUndo() { return this._past.length > 0; }
  get canRedo() { return this._future.length > 0; }

  /** Go on to other values; steps of one gesture that follow each other are one. */
  set(values, done, gesture) {
    const time = performance.now();
    const goesOn = this._open && this._open.gesture === gesture && (!this._open.done || time - this._open.time < TOGETHER_MS);
    if (!goesOn) this._past.push(this._now);
    this._future = [];
    this._now = values;
    this.changes++;
    this._open = { gesture, done, time };
  }

  /** The same step as the server has limited it. */
  adjust(values) { this._now = values; }

  undo() { return this._go(this._past, this._future); }
  redo() { return this._go(this._future, this._past); }

  _go(from, to) {
    if (!from.length) return false;
    to.push(this._now);
    this._now = from.pop();
    this._open = null;
    this.changes++;
    return true;
  }
}
