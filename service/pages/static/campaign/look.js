// What a region holds, computed by the service while it is drawn: statistics, histogram and clipped pixels.

import { pause, runJob } from "../api.js";
import { failed, fill, h, svg, table } from "../dom.js";
import { counted, fixed, number, percent } from "../format.js";

const SETTLE_MS = 350;
const [WIDTH, HEIGHT] = [320, 120];

/** {element, look(frame, region)}: shows the region as it is; an older question that is not answered is dropped. */
export function lookPart(onClipping) {
  const element = h("div", { class: "look" });
  const told = h("p", { class: "muted small", role: "status" });
  const shown = h("div");
  fill(element, told, shown);
  let asked = new AbortController();
  let before = "";

  async function look(frame, region) {
    const question = JSON.stringify([frame?.id, region.points, region.closed]);
    if (question === before) return;
    before = question;
    asked.abort();
    asked = new AbortController();
    const { signal } = asked;
    element.classList.add("stale");
    if (!region.closed || !frame) {
      told.textContent = frame ? (region.points.length ? `${counted(region.points.length, "corner")} so far. Click the first one again, or press Enter, to close.` : "Drag a rectangle on the preview, or click on each corner.") : "Select a frame that has been read.";
      fill(shown);
      onClipping(null);
      return;
    }
    try {
      await pause(SETTLE_MS);
      signal.throwIfAborted();
      const found = await runJob(`/v1/frames/${frame.id}/region`, { polygon: region.points }, told, "Reading the region", { signal });
      const clipped = found.clipping.cells.length ? "; red is clipped" : "";
      told.textContent = `From raw values of ${frame.filename}${clipped}`;
      fill(shown, histogram(found), rows(found.statistics));
      element.classList.remove("stale");
      onClipping(found.clipping);
    } catch (error) {
      if (signal.aborted) return;
      before = "";
      fill(shown, failed(error));
    }
  }
  return { element, look };
}

function rows(statistics) {
  const columns = [
    { head: h("span", { class: "hidden" }, "Channel"), header: true, cell: (row) => h("span", { class: `channel ${row.channel}` }, row.channel) },
    { head: "Mean", class: "number", cell: (row) => fixed(row.mean_dn, 1) },
    { head: "Pixel scatter", class: "number", cell: (row) => fixed(row.std_dn, 1) },
    { head: "Min", class: "number", cell: (row) => number(row.min_dn, 6) },
    { head: "Max", class: "number", cell: (row) => number(row.max_dn, 6) },
    { head: "Clipped", class: "number", cell: (row) => h("span", { class: row.saturated_share > 0.001 ? "bad-figure" : "" }, row.saturated_share ? percent(row.saturated_share) : "0") },
  ];
  return table(columns, statistics, { caption: "Raw values of the region in DN" });
}

function histogram({ histogram: { first_dn: first, step_dn: step, channels }, statistics }) {
  const bins = channels[0].counts.length;
  const most = Math.max(...channels.flatMap((each) => each.counts));
  const last = first + bins * step;
  const x = (bin) => (bin / bins) * WIDTH;
  const line = (counts) => counts.map((count, bin) => `${bin ? "L" : "M"}${x(bin).toFixed(1)} ${y(count)}L${x(bin + 1).toFixed(1)} ${y(count)}`).join("");
  const y = (count) => (HEIGHT * (1 - Math.sqrt(count / most))).toFixed(1);
  const marks = [["black", statistics[0].black_level_dn], ["white", statistics[0].white_level_dn]].filter(([, at]) => at >= first && at <= last);
  const text = `Histogram from ${first} to ${last} DN: ${statistics.map((row) => `${row.channel} around ${fixed(row.mean_dn, 0)}`).join(", ")}`;
  return h("figure", { class: "histogram" },
    svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": text },
      ...channels.map(({ channel, counts }) => svg("path", { class: `channel ${channel}`, d: `M0 ${HEIGHT}${line(counts).replace("M", "L")}L${WIDTH} ${HEIGHT}Z` })),
      ...marks.map(([name, at]) => svg("line", { class: `mark ${name}`, x1: ((at - first) / (last - first)) * WIDTH, x2: ((at - first) / (last - first)) * WIDTH, y1: 0, y2: HEIGHT })),
    ),
    h("figcaption", {}, h("span", {}, `${number(first, 6)} DN`), h("span", {}, marks.map(([name, at]) => `${name} ${number(at, 6)}`).join(", ") || "counts on a square-root scale"), h("span", {}, `${number(last, 6)} DN`)),
  );
}
