// Charts: the service's SVG, with a card for each point and series that can be hidden.

import { send } from "./api.js";
import { select } from "./ask.js";
import { begin, failed, fill, h, segments } from "./dom.js";

const MOST_TOLD = 3;
const RESTS_MS = 300;
const watches = new WeakMap();
const fit = (element) => Math.min(2000, Math.max(240, Math.round(element.clientWidth) - 16));

/** Draw the chart at an address, in the colours of the page; `drawn` is told of it each time. */
export async function plot(element, path, drawn = () => {}, part = 0) {
  const again = (another = part) => plot(element, path, drawn, another);
  const isLast = begin(element);
  try {
    const width = fit(element);
    const address = `${path}${path.includes("?") ? "&" : "?"}${new URLSearchParams({ width, part })}`;
    const answer = await send("GET", address);
    // its own styles are for those who save it; the page's policy forbids them
    const text = (await answer.text()).replace(/<style>.*?<\/style>/s, "");
    if (!isLast()) return;
    // nothing to draw: a card of its own goes, too
    if (answer.status === 204) return void (element.closest(".plot-card") ?? element).remove();
    const chart = document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
    chart.setAttribute("class", "chart");
    const { parts, note } = chart.dataset;
    fill(element, choose(JSON.parse(parts), part, again), chart, note ? h("p", { class: "caption" }, note) : null, saveLink(address, chart.getAttribute("aria-label")));
    explain(element, chart);
    offerSeries(chart);
    redraw(element, width, again);
    drawn(chart);
  } catch (error) {
    if (isLast()) fill(element, failed(error, () => again()));
  } finally {
    if (isLast()) element.removeAttribute("aria-busy");
  }
}

const saveLink = (href, name) => h("p", { class: "picture-of" }, h("a", { class: "button quiet small-button", href, download: `${name}.svg`, "aria-label": `Save as SVG: ${name}` }, "SVG"));

/** Another width draws again once it stays: a telephone that is turned would show what nobody can read. */
function redraw(element, width, again) {
  watches.get(element)?.disconnect();
  let waiting;
  const watch = new ResizeObserver(() => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      if (element.clientWidth && watches.get(element) === watch && Math.abs(fit(element) - width) > width / 5) again();
    }, RESTS_MS);
  });
  watches.set(element, watch);
  watch.observe(element);
}

function choose(parts, chosen, show) {
  if (parts.length < 2) return null;
  const options = parts.map((part, place) => [place, part]);
  if (parts.length > 6) return select(options, { "aria-label": "Part", title: "Which of the plots is shown", onchange: ({ target }) => show(target.selectedIndex) }, chosen);
  return segments("Part", options, chosen, show);
}

function explain(element, chart) {
  let tip;
  chart.addEventListener("pointerover", ({ target, clientX, clientY }) => {
    tip?.remove();
    if (!target.dataset.told) return;
    const points = document.elementsFromPoint(clientX, clientY).filter((each) => each.dataset.told);
    tip = h("div", { class: "tip", role: "status" }, (points.length ? points : [target]).slice(0, MOST_TOLD).map(tell));
    element.append(tip);
    const [place, point] = [element.getBoundingClientRect(), target.getBoundingClientRect()];
    const [x, y] = [point.right - place.left + 8, point.bottom - place.top + 8];
    tip.style.left = `${x + tip.offsetWidth > place.width ? Math.max(0, x - tip.offsetWidth - point.width - 16) : x}px`;
    tip.style.top = `${y + tip.offsetHeight > place.height ? Math.max(0, y - tip.offsetHeight - point.height - 16) : y}px`;
  });
  chart.addEventListener("pointerleave", () => tip?.remove());
}

const tell = ({ dataset: { told, frame, frameId } }) => [
  frameId ? h("img", { src: `/v1/frames/${frameId}/preview.png`, alt: "" }) : null,
  frame ? h("strong", {}, frame) : null,
  told.split("\n").map((line) => h("div", {}, line)),
];

function offerSeries(chart) {
  for (const name of chart.querySelectorAll(".legend")) {
    name.addEventListener("click", () => {
      const off = name.classList.toggle("off");
      for (const each of chart.querySelectorAll(`.series[data-series="${name.dataset.series}"]`)) each.classList.toggle("off", off);
    });
  }
}
