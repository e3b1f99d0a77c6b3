// Upload of one file: streamed by the browser, with progress.

import { Problem } from "../api.js";

/** Send a file; answers the frame, or throws a Problem. `onProgress(bytes)` hears how far it is. */
export function sendFile(path, item, { onProgress, signal }) {
  const query = new URLSearchParams({ role: item.role, filename: item.name.split("/").at(-1) });
  if (item.scene) query.set("scene", item.scene);
  return new Promise((done, fail) => {
    const request = new XMLHttpRequest();
    request.open("POST", `${path}/frames?${query}`);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.setRequestHeader("X-CSRF-Token", document.querySelector("meta[name=csrf-token]").content);
    if (item.sha256) request.setRequestHeader("X-Content-SHA256", item.sha256);
    request.responseType = "json";
    request.upload.onprogress = (event) => onProgress(event.loaded);
    request.onload = () => (request.status < 300 ? done(request.response) : fail(problemOf(request)));
    request.onerror = () => fail(new Problem({ title: "No connection", detail: "The connection was lost.", code: "offline", status: 0, retryable: true }));
    request.onabort = () => fail(new DOMException("stopped", "AbortError"));
    signal?.addEventListener("abort", () => request.abort());
    request.send(item.file);
  });
}

function problemOf({ status, response }) {
  if (response?.detail) return new Problem({ ...response, retryable: response.retryable || status >= 500 });
  return new Problem({ title: "Not accepted", detail: `The service answered ${status}.`, code: "unknown", status, retryable: status >= 500 });
}
