// Administration: tokens, what is kept of a phone, and who did what.

import { get, post, remove, save } from "/web/api.js";
import { action, ago, el, trying } from "/web/dom.js";
import { store } from "/web/store.js";

const SCOPES = { read: "see the map", ingest: "send what phones send", survey: "make and publish radio maps", admin: "everything" };
const DEEDS = 100;

export function startAdmin(view) {
  const said = el("p", { className: "small", role: "status" });
  const tokens = startTokens(() => tried(list));
  const phones = startPhones(() => tried(list));
  const deeds = el("ol", { className: "deeds" });
  view.append(said, tokens.element, phones.element,
    el("fieldset", {}, el("legend", { textContent: "Who did what" }), deeds));
  const list = async () => {
    const made = (await get("/api/v1/tokens")).tokens;
    tokens.take(made);
    const name = new Map(made.map((t) => [t.id, t.label || t.id]));
    const { audit } = await get("/api/v1/audit", { limit: DEEDS });
    deeds.replaceChildren(...audit.map((row) => el("li", {},
      el("time", { textContent: ago(store.now - row.at), title: new Date(1000 * row.at).toLocaleString() }),
      el("span", { textContent: `${name.get(row.actor) ?? row.actor}: ${row.action} ${name.get(row.subject) ?? row.subject}${row.detail ? ` (${row.detail})` : ""}` }))));
  };
  const tried = trying(said);
  return { opened: () => tried(list), left: () => tokens.forget() };
}

function startTokens(changed) {
  const rows = el("tbody");
  const boxes = Object.entries(SCOPES).map(([scope, what]) =>
    el("label", {}, el("input", { type: "checkbox", value: scope, checked: scope === "read" }), ` ${scope}: ${what}`));
  const label = el("input", { type: "text", id: "token-label", placeholder: "whose it is", maxLength: 200, spellcheck: false });
  const everywhere = el("input", { type: "checkbox", checked: true });
  const text = el("input", { type: "text", id: "new-token", readOnly: true, hidden: true, aria: { label: "The new token" } });
  const make = action("Make a token", async () => {
    const scopes = boxes.map((box) => box.firstChild).filter((box) => box.checked).map((box) => box.value);
    if (!scopes.length) return "Choose what it may do.";
    const { token } = await post("/api/v1/tokens", {}, { scopes, label: label.value.trim(), site: everywhere.checked ? "" : store.site });
    label.value = "";
    text.value = token;
    text.hidden = false;
    text.focus();
    text.select();
    await changed();
    return "Copy it now: it is not shown again.";
  });
  const end = (id) => action("End", async () => {
    await remove(`/api/v1/tokens/${id}`);
    await changed();
  });
  const state = (t) => (t.revoked ? "ended" : t.expires && t.expires < store.now ? "expired" : null);
  const take = (all) => {
    const shown = all.toSorted((a, b) => b.created - a.created);
    rows.replaceChildren(...shown.map((t) => el("tr", { className: state(t) ? "quiet" : "" },
      el("td", { textContent: t.label || t.id }),
      el("td", { textContent: `${t.scopes.join(", ")}${t.site ? ` at ${t.site}` : ""}` }),
      el("td", {}, state(t) ?? end(t.id)))));
  };
  const element = el("fieldset", {}, el("legend", { textContent: "Tokens" }),
    el("div", { className: "stack" }, ...boxes, el("label", {}, everywhere, " at all sites")),
    el("label", { htmlFor: "token-label", textContent: "Label" }), label, make, text,
    el("details", {}, el("summary", { textContent: "All tokens" }), el("table", {}, rows)));
  return { element, take, forget: () => { text.value = ""; text.hidden = true; } };
}

function startPhones(changed) {
  const name = el("input", { type: "text", id: "phone-name", placeholder: "what it calls itself, or its pseudonym", maxLength: 200, spellcheck: false });
  const sure = el("input", { type: "checkbox", id: "phone-sure" });
  const give = action("Give out", async () => {
    if (!name.value.trim()) return "Which phone?";
    await save("/api/v1/devices/export", { name: name.value.trim() }, "phone.zip");
    return "Saved.";
  });
  const forget = action("Delete", async () => {
    if (!name.value.trim()) return "Which phone?";
    if (!sure.checked) return "Say that you are sure.";
    const { tracks, survey_files: files } = await post("/api/v1/devices/forget", { name: name.value.trim() });
    sure.checked = false;
    await changed();
    return `${tracks} tracks and ${files} files of surveys are deleted.`;
  });
  const element = el("fieldset", {}, el("legend", { textContent: "What is kept of a phone" }),
    el("label", { htmlFor: "phone-name", textContent: "Phone" }), name,
    el("div", { className: "choices" }, give, forget, el("label", {}, sure, " I am sure")));
  return { element };
}
