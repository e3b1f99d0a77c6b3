// Requests to /v1: the browser sends the session's cookie, and every change carries the page's token.

/** A problem of the API, or a connection that did not come about; `message` is for people. */
export class Problem extends Error {
  constructor(body) {
    super(body.detail);
    Object.assign(this, { title: body.title, code: body.code, status: body.status, body });
    this.retryable = Boolean(body.retryable);
    this.fields = Object.fromEntries((body.errors ?? []).map((each) => [each.field.replace(/^body\./, ""), each.message]));
  }
}

export const OFFLINE = {
  title: "No connection",
  detail: "The service does not answer. Check the connection and try again.",
  code: "offline",
  status: 0,
  retryable: true,
};

/** Whether there is a session again after the end of one: asked for over the page, which keeps what was typed. */
export async function isRenewed(insists) {
  const { signInAgain } = await import("./session.js");
  return signInAgain(insists);
}

/** Send a request; `json` becomes its body. Answers the Response, or throws a Problem. */
export async function send(method, path, options = {}) {
  const { json, body, headers = {}, signal } = options;
  const all = new Headers({ Accept: "application/json", ...headers });
  if (json !== undefined) all.set("Content-Type", "application/json");
  if (method !== "GET") all.set("X-CSRF-Token", document.querySelector("meta[name=csrf-token]").content);
  let answer;
  try {
    answer = await fetch(path, { method, headers: all, body: json === undefined ? body : JSON.stringify(json), signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem(OFFLINE);
  }
  if (answer.ok || answer.status === 304) return answer;
  const problem = await problemOf(answer);
  if (problem.status === 401 && (await isRenewed(method !== "GET"))) return send(method, path, options);
  throw problem;
}

export const get = async (path, options) => (await send("GET", path, options)).json();
/** The same POST, sent again after a lost connection, is done once: give the same `once` again. */
export const post = async (path, json, { once = newOnce(), headers = {}, ...options } = {}) =>
  (await send("POST", path, { json, headers: { "Idempotency-Key": once, ...headers }, ...options })).json();
export const put = async (path, json, options) => (await send("PUT", path, { json, ...options })).json();
export const patch = async (path, json, options) => (await send("PATCH", path, { json, ...options })).json();

/** {tag, body}: what is there, or no body where it is as it was under this tag. */
export async function getChanged(path, tag) {
  const answer = await send("GET", path, tag ? { headers: { "If-None-Match": tag } } : {});
  return { tag: answer.headers.get("etag"), body: answer.status === 304 ? null : await answer.json() };
}

/** What is there, or `instead` where there is none (404). */
export async function getOr(path, instead) {
  try {
    return await get(path);
  } catch (error) {
    if (error.status === 404) return instead;
    throw error;
  }
}

/** The path of an address that the service gave: whole, or a path where it does not know its own name. */
export function pathOf(address) {
  const { pathname, search } = new URL(address, location.href);
  return pathname + search;
}

/** Every item of a list, page by page. */
export async function all(path, { limit = 1000, atMost = Infinity } = {}) {
  const items = [];
  let next = `${path}${path.includes("?") ? "&" : "?"}limit=${limit}`;
  while (next && items.length < atMost) {
    const page = await get(next);
    items.push(...page.items);
    next = page.next && pathOf(page.next);
  }
  return items;
}

/** The key of a request that is done once, however often it is sent. */
export function newOnce() {
  // randomUUID is only there on https and localhost
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function problemOf(answer) {
  try {
    return new Problem(await answer.json());
  } catch {
    const detail = `The service answered ${answer.status} with an unknown body. Try again.`;
    return new Problem({ title: "Unexpected answer", detail, code: "unknown", status: answer.status, retryable: true });
  }
}
