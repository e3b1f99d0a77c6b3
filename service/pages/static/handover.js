// From one page to the next within the same document: files that somebody chose would be lost with it.

import { OFFLINE, Problem, isRenewed } from "./api.js";

/** Files for the page that comes next: [{file, name, role?, scene?}]; taken once. */
let handed = null;
let shown = location.pathname;
const begun = new Set([document.querySelector("script[type=module]")?.src]);

// a place within the page is another address too: to go there reloads nothing
addEventListener("popstate", () => location.pathname === shown || location.reload());

export const takeHanded = () => {
  const taken = handed;
  handed = null;
  return taken;
};

/** Show the page of an address in place of this one, with files for it. Going back loads the page before anew. */
export async function goOn(address, items) {
  const answer = await fetch(address, { headers: { Accept: "text/html" } }).catch(() => {
    throw new Problem(OFFLINE);
  });
  if (new URL(answer.url).pathname === "/sign-in" && (await isRenewed(true))) return goOn(address, items);
  if (!answer.ok || answer.redirected) {
    location.assign(address);
    return;
  }
  const next = new DOMParser().parseFromString(await answer.text(), "text/html");
  handed = items;
  dispatchEvent(new Event("left"));
  for (const sheet of next.querySelectorAll("link[rel=stylesheet]")) if (![...document.styleSheets].some((each) => each.href === sheet.href)) document.head.append(document.adoptNode(sheet));
  document.title = next.title;
  history.pushState(null, "", address);
  shown = location.pathname;
  for (const part of ["header.top", "main"]) document.querySelector(part).replaceWith(document.adoptNode(next.querySelector(part)));
  scrollTo(0, 0);
  document.querySelector("main").focus();
  const { src } = next.querySelector("script[type=module]");
  // a module runs once: the page of one that has run already gets it under an address of its own
  await import(begun.has(src) ? `${src}?${begun.size}` : src);
  begun.add(src).add(`${begun.size}`);
}
