// What the address of a campaign's page holds: the open frame and the filter. The history keeps the place that was scrolled to.

/** {frame, show, find}, each "" where the address does not name it. */
export function readAddress() {
  const query = new URLSearchParams(location.search);
  return Object.fromEntries(["frame", "show", "find"].map((name) => [name, query.get(name) ?? ""]));
}

/** Change some of them; with `step` the way back leads to how it was. */
export function writeAddress(said, { step = false } = {}) {
  const url = new URL(location.href);
  for (const [name, value] of Object.entries(said)) if (value) url.searchParams.set(name, value);
  else url.searchParams.delete(name);
  if (url.href === location.href) return;
  if (step) history.pushState({ step }, "", url);
  else history.replaceState(history.state, "", url);
}

/** Whether the way back leads from the open frame to the grid. */
export const isStep = () => Boolean(history.state?.step);

/** Keep in the history where the scroller is seen and how far it was scrolled; answers what goes there again, once. */
export function keepPlace(scroller) {
  const top = () => scroller.getBoundingClientRect().top;
  let place = history.state?.place;
  addEventListener("pagehide", () => history.replaceState({ ...history.state, place: [top(), scroller.scrollTop] }, ""));
  return () => {
    if (!place) return;
    const [before, scrolled] = place;
    place = undefined;
    scroller.scrollTop = scrolled;
    // what is loaded above it later does not move what is seen
    scrollBy(0, top() - before);
  };
}
