// Numbers as people type them.

const APART = /^[+-]?\d{1,3}([\s’']\d{3})+(?=[.,]|$)/;

/** A number with a decimal point or comma, thousands apart by blanks; NaN for anything else, "1,234.5" too: nobody can tell what that is. */
export function readNumber(text) {
  const plain = text.trim().replace("−", "-").replace(APART, (whole) => whole.replace(/[\s’']/g, ""));
  return /^[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?$/i.test(plain) ? Number(plain.replace(",", ".")) : NaN;
}

/** The number of a field, or undefined when it is empty; what is none is told in the field's own words. */
export function numberOf(input, { integer = false } = {}) {
  const text = input.value.trim();
  input.removeAttribute("aria-invalid");
  if (text === "") return undefined;
  const value = readNumber(text);
  if (Number.isFinite(value) && !(integer && !Number.isInteger(value))) return value;
  input.setAttribute("aria-invalid", "true");
  input.focus();
  const label = input.labels?.[0]?.textContent ?? "This";
  throw wrong(`${label}: “${text}” is not ${integer ? "a whole number" : "a number"}.`);
}

/** An error that a person made, for states.js to show. */
export const wrong = (message) => Object.assign(new Error(message), { title: "Not sent", code: "typed", retryable: false });
