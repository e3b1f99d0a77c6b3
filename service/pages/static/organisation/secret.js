// A secret that has just been made, shown once.

import { small } from "../causes.js";
import { byId, fill, h, toast } from "../dom.js";

/** The only time that the secret is there. */
export function tellSecret(text, said) {
  const secret = h("code", { tabindex: "0" }, text);
  const copy = small("Copy", async () => {
    getSelection().selectAllChildren(secret);
    // without https there is no clipboard: what is selected can be copied by hand
    await navigator.clipboard?.writeText(text);
    toast(navigator.clipboard ? "Copied." : "Selected: copy it with the keyboard.");
  });
  const box = h("div", { class: "note good" }, h("p", {}, h("strong", {}, said), " Copy it now; it is not shown again."), h("p", { class: "secret" }, secret, copy, small("I have saved it", () => fill(byId("made")), { quiet: true })));
  fill(byId("made"), box);
  copy.focus();
}
