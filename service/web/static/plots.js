// Bokeh's plots: its script is loaded when the first one is drawn.

import { get } from "./api.js";
import { fill } from "./dom.js";
import { failed } from "./states.js";

let loaded;

/** Draw the plot that an address answers as Bokeh's json_item, in the colours of the page. Answers its views, if any. */
export async function plot(element, path) {
  element.setAttribute("aria-busy", "true");
  try {
    const theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    const [item, bokeh] = await Promise.all([get(`${path}${path.includes("?") ? "&" : "?"}theme=${theme}`), loadBokeh()]);
    fill(element);
    return await bokeh.embed.embed_item(item, element);
  } catch (error) {
    fill(element, failed(error, () => plot(element, path)));
    return undefined;
  } finally {
    element.removeAttribute("aria-busy");
  }
}

function loadBokeh() {
  loaded ??= new Promise((done, fail) => {
    allowStyles();
    const script = document.createElement("script");
    script.src = document.querySelector("meta[name=bokeh]").content;
    script.onload = () => done(window.Bokeh);
    script.onerror = () => fail(new Error("Bokeh's script cannot be loaded."));
    document.head.append(script);
  });
  return loaded;
}

// Bokeh writes its styles into <style> elements that it makes. The page's policy takes inline styles from none
// but whoever knows its nonce, so they get it as they are made.
function allowStyles() {
  const { content } = document.querySelector("meta[name=style-nonce]");
  const make = document.createElement;
  document.createElement = function createElement(name, options) {
    const element = make.call(this, name, options);
    if (element.localName === "style") element.nonce = content;
    return element;
  };
}
