// Items by what they have in common, and in the one order of names.

/** DJI_9 before DJI_10. */
export const natural = new Intl.Collator(undefined, { numeric: true }).compare;

/** The items by their names; those of one name as they were. */
export const inOrder = (items, nameOf) => [...items].sort((a, b) => natural(nameOf(a), nameOf(b)));

/** A Map from each key to its items, in their order. */
export function groupBy(items, keyOf) {
  const groups = new Map();
  for (const item of items) {
    const key = keyOf(item);
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(item);
  }
  return groups;
}
