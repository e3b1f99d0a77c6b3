// Who uses a key, as certificates name them.

import { patch } from "../api.js";
import { ask } from "../ask.js";
import { h } from "../dom.js";

export const signing = ({ person, role } = {}) => [
  { name: "person", label: "Person", of: "NewKey", value: person, maxlength: 200, required: false },
  { name: "role", label: "Role", of: "NewKey", value: role, maxlength: 200, required: false },
];

export const statePerson = (key) => ask({
  title: `Person of “${key.name}”`,
  body: h("p", {}, "Certificates name who fitted and who approved. Without a person, what is published with this key is marked as a draft."),
  fields: signing(key),
  submit: "Save",
  action: ({ person, role }) => patch(`/v1/keys/${key.id}`, { person: person ?? "", role: role ?? "" }),
});
