// A session that ends while a page is open is begun again over the page, which keeps what was typed and chosen.

import { ask } from "./ask.js";
import { h, leave, wrong } from "./dom.js";

let asked = null;
let declined = false;

/**
 * Answers whether there is a session again; asked once for all requests that meet its end. Where that was declined, only
 * what a person starts (`insists`) asks again.
 */
export function signInAgain(insists) {
  if (declined && !insists) return Promise.resolve(false);
  asked ??= ask({
    title: "Your session has ended",
    body: h("p", {}, "Sign in to go on. What you have typed stays, and files are sent on."),
    fields: [{ name: "key", label: "Key", type: "password", autocomplete: "current-password", spellcheck: "false", help: "A key of your organisation, as when you signed in before. The browser does not keep it." }],
    submit: "Sign in",
    action: signIn,
  }).then((signed) => {
    asked = null;
    declined = !signed;
    return !declined;
  });
  return asked;
}

/** Sign in as the form does; its answer is this page anew, with the token and the name of the new session. */
async function signIn({ key }) {
  const { pathname, search } = location;
  const answer = await fetch("/sign-in", { method: "POST", body: new URLSearchParams({ key, next: pathname + search }) });
  const page = new DOMParser().parseFromString(await answer.text(), "text/html");
  if (!page.querySelector("meta[name=csrf-token]")) throw wrong(page.querySelector(".failed p:not(.failed-title)")?.textContent ?? "The service did not open a session. Try again.");
  // what is shown is not this key's
  if (!answer.ok) return leave();
  for (const name of ["csrf-token", "scopes"]) document.querySelector(`meta[name=${name}]`).content = page.querySelector(`meta[name=${name}]`).content;
  document.querySelector("header.top .who").replaceWith(document.adoptNode(page.querySelector("header.top .who")));
  return true;
}
