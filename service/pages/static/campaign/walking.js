// The keyboard in the grid: one tab stop, from which keys go to other cells, drawn or not.

const ARROWS = { ArrowDown: [1, 0], ArrowUp: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1] };

const filled = (line) => [...line.cells.keys()].filter((at) => line.cells[at]);
const nearest = (line, column) => filled(line).sort((a, b) => Math.abs(a - column) - Math.abs(b - column))[0];

/** `shown()` answers {lines, offsets, drawn} of the grid, `update()` draws what is in view. */
export function walking({ body, head, scroller, shown, update }) {
  let active = null;

  const scrolls = () => scroller.scrollHeight > scroller.clientHeight + 1;
  const cellAt = (line, column) => shown().drawn.get(line)?.element.children[column + 1]?.firstElementChild;
  const place = () => shown().lines.findIndex((line) => line.key === active?.line);

  function setStop() {
    body.querySelectorAll("td > [tabindex='0']").forEach((each) => (each.tabIndex = -1));
    const stop = (active && cellAt(active.line, active.column)) ?? body.querySelector("td > .cell, td > .cell-gap, td > .cell-pile");
    if (stop) stop.tabIndex = 0;
  }

  function walk(index, column) {
    const { lines, offsets } = shown();
    active = { line: lines[index].key, column };
    const [top, bottom] = [offsets[index], offsets[index + 1]];
    if (scrolls()) {
      const room = head.offsetHeight;
      if (top < scroller.scrollTop) scroller.scrollTop = top;
      else if (bottom + room > scroller.scrollTop + scroller.clientHeight) scroller.scrollTop = bottom + room - scroller.clientHeight;
    } else if (!cellAt(active.line, column)) scrollBy(0, body.getBoundingClientRect().top + top - innerHeight / 2);
    update();
    cellAt(active.line, column)?.focus({ preventScroll: scrolls() });
  }

  /** To the next cell that holds something: in its line or on into the next one. */
  function aside(by) {
    const { lines } = shown();
    for (let [index, column] = [place(), active.column + by]; lines[index]; column += by) {
      if (lines[index].cells[column]) return walk(index, column);
      if (column >= 0 && column < lines[index].cells.length) continue;
      index += by;
      column = by > 0 ? -1 : (lines[index]?.cells.length ?? 0);
    }
    return null;
  }

  /** From a line on, up or down, to the first that holds something; whether there was one. */
  function along(from, by) {
    const { lines } = shown();
    for (let index = from; index >= 0 && index < lines.length; index += by) {
      const column = nearest(lines[index], active.column);
      if (column !== undefined) {
        walk(index, column);
        return true;
      }
    }
    return false;
  }

  /** As far as can be seen at once, and one line at least. */
  function turnPage(by) {
    const { lines, offsets } = shown();
    const from = place();
    const room = (scrolls() ? scroller.clientHeight : innerHeight) - 2 * head.offsetHeight;
    let to = from;
    while (lines[to + by] && (to === from || Math.abs(offsets[to + by] - offsets[from]) <= room)) to += by;
    if (!along(to, by)) along(to, -by);
  }

  function toEnd(last) {
    const line = place();
    walk(line, filled(shown().lines[line]).at(last ? -1 : 0));
  }

  function toCorner(last) {
    const { lines } = shown();
    active = { line: active.line, column: last ? shown().lines[place()].cells.length : 0 };
    along(last ? lines.length - 1 : 0, last ? -1 : 1);
  }

  body.addEventListener("focusin", (event) => {
    const cell = event.target.closest("td > *");
    if (!cell) return;
    const row = [...shown().drawn].find(([, each]) => each.element.contains(cell));
    active = { line: row[0], column: [...row[1].element.children].indexOf(cell.parentElement) - 1 };
    setStop();
  });

  return {
    setStop,
    line: () => shown().lines[place()],
    focusOn(id) {
      const { lines } = shown();
      const holds = (cell) => cell?.frame?.id === id || cell?.pile?.frames.some((frame) => frame.id === id);
      const index = lines.findIndex((line) => line.cells.some(holds));
      if (index >= 0) walk(index, lines[index].cells.findIndex(holds));
    },
    /** Whether a key of the focused cell was one that walks; then it was done. */
    press({ key, ctrlKey, metaKey, altKey }) {
      const ends = key === "Home" || key === "End";
      if (altKey || metaKey || (ctrlKey && !ends)) return false;
      const [down, right] = ARROWS[key] ?? [0, 0];
      if (down) along(place() + down, down);
      else if (right) aside(right);
      else if (ends) (ctrlKey ? toCorner : toEnd)(key === "End");
      else if (key === "PageDown" || key === "PageUp") turnPage(key === "PageDown" ? 1 : -1);
      else return false;
      return true;
    },
  };
}
