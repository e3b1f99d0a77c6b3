// A small picture of a frame that has not been sent: from its embedded preview, else from its own numbers.

import { h } from "../dom.js";
import { readRow } from "./headers.js";

const [WIDTH, HEIGHT] = [128, 96];
const drawn = new Map();

/** A canvas; a frame without both stays black. Each is drawn once. */
export function drawPicture(frame) {
  let canvas = drawn.get(frame.key);
  if (!canvas) {
    canvas = h("canvas", { class: "picture", width: WIDTH, height: HEIGHT, "aria-hidden": "true" });
    drawn.set(frame.key, canvas);
    // a file that cannot be drawn stays black: it is a hint, and what is wrong with it is said elsewhere
    draw(canvas, frame).catch(() => {});
  }
  return canvas;
}

async function draw(canvas, { file, header }) {
  const context = canvas.getContext("2d");
  if (header.preview) {
    const picture = await createImageBitmap(new Blob([await file.slice(header.preview.at, header.preview.at + header.preview.size).arrayBuffer()], { type: "image/jpeg" }), { resizeWidth: WIDTH, resizeHeight: HEIGHT });
    context.drawImage(picture, 0, 0);
    return;
  }
  if (!header.image) return;
  const { width, height, black, white } = header.image;
  const pixels = context.createImageData(WIDTH, HEIGHT);
  for (let y = 0; y < HEIGHT; y += 1) {
    // even rows and columns: one colour of a mosaic
    const row = await readRow(file, header.image, 2 * Math.floor(((y + 0.5) / HEIGHT) * (height / 2)));
    for (let x = 0; x < WIDTH; x += 1) {
      const share = (row[2 * Math.floor(((x + 0.5) / WIDTH) * (width / 2))] - black) / (white - black);
      pixels.data.set([1, 1, 1].map(() => 255 * Math.max(0, share) ** (1 / 2.2)).concat(255), 4 * (y * WIDTH + x));
    }
  }
  context.putImageData(pixels, 0, 0);
}
