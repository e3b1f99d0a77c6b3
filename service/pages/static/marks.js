// The marks of a state: each has a shape beside its colour.

import { svg } from "./dom.js";

const ROUND = { cx: 9, cy: 9, r: 7.4, fill: "none", stroke: "currentColor", "stroke-width": 1.5 };
const LINE = { fill: "none", stroke: "currentColor", "stroke-width": 1.5, "stroke-linecap": "round" };
const SHAPES = {
  good: [["circle", { cx: 9, cy: 9, r: 8, fill: "currentColor" }], ["path", { class: "in", d: "M5.2 9.3l2.6 2.6 5-5.4" }]],
  warn: [["path", { d: "M9 1.2 17.4 16.4H.6z", fill: "currentColor", stroke: "currentColor", "stroke-linejoin": "round" }], ["path", { class: "in", d: "M9 6.6v4.6" }], ["circle", { class: "dot", cx: 9, cy: 13.7, r: 1.1 }]],
  bad: [["rect", { x: 1.2, y: 1.2, width: 15.6, height: 15.6, rx: 2.5, fill: "currentColor" }], ["path", { class: "in", d: "M5.6 5.6l6.8 6.8M12.4 5.6l-6.8 6.8" }]],
  wait: [["circle", ROUND], ["path", { ...LINE, d: "M9 5v4.3l2.8 1.8" }]],
  out: [["circle", ROUND], ["path", { ...LINE, d: "M4 14L14 4" }]],
  gap: [["rect", { x: 1.5, y: 1.5, width: 15, height: 15, rx: 2.5, fill: "none", stroke: "currentColor", "stroke-width": 1.4, "stroke-dasharray": "3 2" }], ["path", { ...LINE, d: "M9 5.5v7M5.5 9h7" }]],
};

/** mark("warn"), or mark("warn", "One frame to check") where no word beside it says so. */
export const mark = (kind, label) =>
  svg("svg", { class: `v ${kind}`, viewBox: "0 0 18 18", ...(label ? { role: "img", "aria-label": label } : { "aria-hidden": "true" }) }, ...SHAPES[kind].map(([name, attributes]) => svg(name, attributes)));

/** What an outcome of a verdict is called, and its mark. */
export const OUTCOMES = { pass: ["good", "Passes"], warn: ["warn", "Check"], fail: ["bad", "Fails"], pending: ["wait", "Waiting"] };
