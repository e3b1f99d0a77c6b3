// Upload of one file, with progress: a small one in one request, a larger one by tus 1.0.0, which goes on where it was cut.

import { Problem, isRenewed, newOnce } from "../api.js";

/** A smaller file is sent again whole. */
export const WHOLE_BYTES = 1 << 20;
const TUS = { "Tus-Resumable": "1.0.0" };

/**
 * Send a file; answers the frame's {id}, or throws a Problem. `onProgress(bytes)` hears how far it is. `onBegun()` hears
 * that `item.upload` is the address at which a cut upload goes on.
 */
export async function sendFile(path, item, { onProgress, onBegun, signal }) {
  const said = { role: item.role, filename: item.name.split("/").at(-1), ...(item.scene ? { scene: item.scene } : {}) };
  if (!item.upload && (item.size <= WHOLE_BYTES || !item.sha256)) {
    const headers = { "Content-Type": "application/octet-stream", ...(item.sha256 ? { "X-Content-SHA256": item.sha256 } : {}) };
    return (await ask("POST", `${path}/frames?${new URLSearchParams(said)}`, headers, { body: item.file, onProgress, signal })).response;
  }
  if (!item.upload) {
    item.once ??= newOnce();
    const told = { campaign_id: path.split("/").at(-1), sha256: item.sha256, ...said };
    const metadata = Object.entries(told).map(([name, text]) => `${name} ${btoa(String.fromCharCode(...new TextEncoder().encode(text)))}`);
    const begun = await ask("POST", "/v1/uploads", { ...TUS, "Upload-Length": item.size, "Upload-Metadata": metadata.join(","), "Idempotency-Key": item.once }, { signal });
    item.upload = begun.getResponseHeader("Location");
    onBegun();
  }
  try {
    let answer = await ask("HEAD", item.upload, TUS, { signal });
    const offset = Number(answer.getResponseHeader("Upload-Offset"));
    item.sent = offset;
    if (!answer.getResponseHeader("Content-Location")) {
      const headers = { ...TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": offset };
      answer = await ask("PATCH", item.upload, headers, { body: item.file.slice(offset), onProgress: (bytes) => onProgress(offset + bytes), signal });
    }
    return { id: answer.getResponseHeader("Content-Location").split("/").at(-1) };
  } catch (error) {
    // it was ended or has expired: from the start; or more had arrived than was known: from there
    if (error.status === 404) Object.assign(item, { upload: undefined, once: undefined });
    if ([404, 409].includes(error.status)) error.retryable = true;
    throw error;
  }
}

/** A request as it was answered; the browser streams its body. Without a session it waits for one. */
function ask(method, address, headers, options = {}) {
  const { body, onProgress, signal } = options;
  return new Promise((done, fail) => {
    const request = new XMLHttpRequest();
    request.open(method, address);
    for (const [name, value] of Object.entries({ ...headers, "X-CSRF-Token": document.querySelector("meta[name=csrf-token]").content })) request.setRequestHeader(name, value);
    request.responseType = "json";
    if (onProgress) request.upload.onprogress = (event) => onProgress(event.loaded);
    request.onload = async () => {
      if (request.status < 300) done(request);
      else if (request.status === 401 && (await isRenewed(false))) done(ask(method, address, headers, options));
      else fail(problemOf(request));
    };
    request.onerror = () => fail(new Problem({ title: "No connection", detail: "The connection was lost.", code: "offline", status: 0, retryable: true }));
    request.onabort = () => fail(new DOMException("stopped", "AbortError"));
    signal?.addEventListener("abort", () => request.abort());
    request.send(body);
  });
}

function problemOf({ status, response }) {
  if (response?.detail) return new Problem({ ...response, status, retryable: response.retryable || status >= 500 || status === 401 });
  return new Problem({ title: "Not accepted", detail: `The service answered ${status}.`, code: "unknown", status, retryable: status >= 500 });
}
