// Survey tools: versions of the radio map.

import { get, post } from "/web/api.js";
import { action, el } from "/web/dom.js";
import { store } from "/web/store.js";

export function startSurvey(view) {
  const said = el("p", { className: "small", role: "status" });
  const versions = el("tbody");
  const table = el("table", {}, el("thead", {}, el("tr", {}, ...["Version", "From", "Note", ""].map((t) => el("th", { textContent: t })))), versions);
  const back = action("Roll back", async () => {
    const { published } = await post("/api/v1/radio-maps/roll-back", { site: store.site });
    await list();
    return `version ${published} is in use`;
  });
  view.append(said, el("fieldset", {}, el("legend", { textContent: "Radio map" }), table, back));

  const list = async () => {
    const { published, versions: all } = await get("/api/v1/radio-maps", { site: store.site });
    versions.replaceChildren(...all.map((v) => el("tr", {},
      el("td", { textContent: v.version }), el("td", { textContent: new Date(1000 * v.created).toLocaleString() }), el("td", { textContent: v.note }),
      el("td", {}, v.version === published ? "in use" : action("Publish", async () => {
        await post("/api/v1/radio-maps/publish", { site: store.site }, { version: v.version });
        await list();
      })))));
  };
  const opened = async () => {
    try {
      await list();
      said.textContent = "";
    } catch (error) {
      said.textContent = error.message;
    }
  };
  return { opened, left: () => {} };
}
