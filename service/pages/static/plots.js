// Charts: the service's SVG, with a card for each point, series that can be hidden, and a zoom.

import { send } from "./api.js";
import { select } from "./ask.js";
import { act, begin, failed, fill, h, segments, svg, toast } from "./dom.js";

const FINER = 2;

/** Buttons for a chart; `text` is its SVG with the styles of its own, on white. */
function pictureButtons(text, name) {
  const button = (label, says, action) => h("button", { type: "button", class: "quiet small-button", "aria-label": `${says}: ${name}`, onclick: (event) => act(event.target, action) }, label);
  return h("p", { class: "picture-of" },
    button("PNG", "Save as PNG", async () => save(await draw(text), `${name}.png`)),
    // only there on https and localhost
    globalThis.ClipboardItem ? button("Copy", "Copy the picture", () => navigator.clipboard.write([new ClipboardItem({ "image/png": draw(text) })]).then(() => toast("Picture copied."))) : null,
  );
}

async function draw(text) {
  const address = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
  try {
    const picture = new Image();
    picture.src = address;
    await picture.decode();
    const canvas = h("canvas", { width: FINER * picture.width, height: FINER * picture.height });
    canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
    return await new Promise((done) => canvas.toBlob(done));
  } finally {
    URL.revokeObjectURL(address);
  }
}

function save(picture, name) {
  const address = URL.createObjectURL(picture);
  h("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}

const MOST_TOLD = 3;
const WHOLE = { x0: 0, x1: 1, y0: 0, y1: 1 };
const RESTS_MS = 300;
const watches = new WeakMap();
const fit = (element) => Math.min(2000, Math.max(240, Math.round(element.clientWidth) - 16));

/**
 * Draw the chart at an address, in the colours of the page; `drawn` is told of it each time.
 * A mouse that draws a rectangle zooms in, with Shift it moves what is shown, and a double click shows all again.
 */
export async function plot(element, path, drawn = () => {}, view = WHOLE) {
  const again = (seen) => plot(element, path, drawn, seen);
  const isLast = begin(element);
  try {
    const width = fit(element);
    const answer = await send("GET", `${path}${path.includes("?") ? "&" : "?"}${new URLSearchParams({ width, ...view })}`);
    // its own styles are for those who save it; the page's policy forbids them
    const saved = await answer.text();
    const text = saved.replace(/<style>.*?<\/style>/s, "");
    if (!isLast()) return;
    // nothing to draw: a card of its own goes, too
    if (answer.status === 204) return void (element.closest(".plot-card") ?? element).remove();
    const chart = document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
    chart.setAttribute("class", "chart");
    const { parts, note } = chart.dataset;
    fill(element, choose(JSON.parse(parts), view.part, (part) => again({ ...WHOLE, part })), chart, note ? h("p", { class: "caption" }, note) : null, pictureButtons(saved, chart.getAttribute("aria-label")));
    explain(element, chart);
    offerSeries(chart);
    offerZoom(chart, view, (shown) => again({ ...view, ...shown }));
    redraw(element, width, () => again(view));
    drawn(chart);
  } catch (error) {
    if (isLast()) fill(element, failed(error, () => again(view)));
  } finally {
    if (isLast()) element.removeAttribute("aria-busy");
  }
}

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

function choose(parts, chosen = 0, show) {
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

function offerZoom(chart, view, show) {
  const box = chart.querySelector(".box");
  let start;
  const place = (event) => {
    const { left, top, width, height } = box.getBoundingClientRect();
    const inside = (share) => Math.min(1, Math.max(0, share));
    return [inside((event.clientX - left) / width), inside(1 - (event.clientY - top) / height)];
  };
  const rectangle = svg("rect", { class: "zoom" });
  chart.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "mouse" && event.button === 0) start = place(event);
  });
  chart.addEventListener("pointermove", (event) => {
    if (!start) return;
    const [end, [x, y, width, height]] = [place(event), ["x", "y", "width", "height"].map((name) => Number(box.getAttribute(name)))];
    const [low, high] = [0, 1].map((axis) => [Math.min(start[axis], end[axis]), Math.max(start[axis], end[axis])]);
    const sides = { x: x + low[0] * width, y: y + (1 - high[1]) * height, width: (low[1] - low[0]) * width, height: (high[1] - high[0]) * height };
    for (const [name, value] of Object.entries(sides)) rectangle.setAttribute(name, event.shiftKey ? 0 : value);
    chart.append(rectangle);
  });
  chart.addEventListener("pointerleave", () => ((start = undefined), rectangle.remove()));
  chart.addEventListener("pointerup", (event) => {
    rectangle.remove();
    if (!start) return;
    const [[x, y], [toX, toY]] = [start, place(event)];
    start = undefined;
    const [wide, high] = [view.x1 - view.x0, view.y1 - view.y0];
    if (event.shiftKey) {
      const [right, up] = [(x - toX) * wide, (y - toY) * high];
      if (right || up) show(within({ x0: view.x0 + right, x1: view.x1 + right, y0: view.y0 + up, y1: view.y1 + up }));
    } else if (Math.abs(x - toX) > 0.02 && Math.abs(y - toY) > 0.02) {
      show({
        x0: view.x0 + Math.min(x, toX) * wide,
        x1: view.x0 + Math.max(x, toX) * wide,
        y0: view.y0 + Math.min(y, toY) * high,
        y1: view.y0 + Math.max(y, toY) * high,
      });
    }
  });
  chart.addEventListener("dblclick", () => show(WHOLE));
}

const within = (view) => Object.fromEntries(Object.entries(view).map(([name, share]) => [name, Math.min(2, Math.max(-1, share))]));
