// Chosen and dropped files, and every file below a dropped folder, with its path.

import { OFFLINE, Problem, isRenewed } from "../api.js";
import { h } from "../dom.js";
import { inOrder } from "../format.js";

/** Take what is chosen by the buttons of a `zone`, or dropped anywhere in the window, as [{file, name}]. */
export function takeFiles(zone, verb, take) {
  for (const button of zone.querySelectorAll("[data-choose]")) {
    const folder = button.dataset.choose === "folder";
    const input = h("input", { type: "file", multiple: true, hidden: true, webkitdirectory: folder, "aria-label": `${folder ? "Folder" : "Files"} to ${verb}`, onchange: () => {
      take([...input.files].map((file) => ({ file, name: file.webkitRelativePath || file.name })));
      input.value = "";
    } });
    button.addEventListener("click", () => input.click());
    button.after(input);
  }
  let inside = 0;
  const over = (by) => zone.classList.toggle("over", (inside = Math.max(0, inside + by)) > 0);
  const holdsFiles = (event) => event.dataTransfer?.types.includes("Files");
  const on = (name, listener) => addEventListener(name, (event) => zone.isConnected && holdsFiles(event) && listener(event));
  on("dragenter", () => over(1));
  on("dragleave", () => over(-1));
  on("dragover", (event) => event.preventDefault());
  on("drop", async (event) => {
    event.preventDefault();
    over(-inside);
    take(await filesOf(event.dataTransfer));
  });
  zone.hidden = false;
}

/** [{file, name}] of a drop; hidden files are left out, as cards carry half copies of frames under such names. */
async function filesOf(transfer) {
  // the entries must all be taken before the first wait: the browser takes the transfer back
  const entries = [...transfer.items].filter((item) => item.kind === "file").map((item) => item.webkitGetAsEntry?.());
  const plain = [...transfer.files];
  const found = [];
  for (const [index, entry] of entries.entries()) {
    if (entry) await walk(entry, "", found);
    else if (plain[index]) found.push({ file: plain[index], name: plain[index].name });
  }
  return inOrder(found, (each) => each.name);
}

async function walk(entry, above, found) {
  if (entry.name.startsWith(".")) return;
  const name = above ? `${above}/${entry.name}` : entry.name;
  if (entry.isFile) {
    found.push({ file: await new Promise((done, fail) => entry.file(done, fail)), name });
    return;
  }
  const reader = entry.createReader();
  for (;;) {
    // a hundred at a time, until there are none
    const some = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!some.length) return;
    for (const each of some) await walk(each, name, found);
  }
}

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
