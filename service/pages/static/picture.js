// A chart as a picture for a report: saved, or copied.

import { h, toast } from "./dom.js";
import { act } from "./states.js";

const FINER = 2;

/** Buttons for a chart; `text` is its SVG with the styles of its own, on white. */
export function pictureButtons(text, name) {
  const button = (label, says, action) => h("button", { type: "button", class: "quiet small-button", "aria-label": `${says}: ${name}`, onclick: (event) => act(event.target, action) }, label);
  return h(
    "p",
    { class: "picture-of" },
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
