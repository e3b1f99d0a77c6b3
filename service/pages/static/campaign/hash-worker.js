// Hashes files in a worker, so that the page stays responsive.

import { Sha256 } from "./sha256.js";

const PIECE = 8 << 20;

self.onmessage = async ({ data: { id, file } }) => {
  try {
    self.postMessage({ id, sha256: await hash(file) });
  } catch {
    self.postMessage({ id, error: "The file cannot be read. Check that the card is still inserted." });
  }
};

async function hash(file) {
  if (self.crypto?.subtle && file.size < 256 << 20) {
    const digest = await crypto.subtle.digest("SHA-256", await file.arrayBuffer());
    return Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, "0")).join("");
  }
  const running = new Sha256();
  for (let at = 0; at < file.size; at += PIECE) running.update(new Uint8Array(await file.slice(at, at + PIECE).arrayBuffer()));
  return running.hex();
}
