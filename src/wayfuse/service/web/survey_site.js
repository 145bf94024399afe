// Bringing a building in: floor plans in a format that the command line knows too.

import { post } from "/web/api.js";
import { action, el } from "/web/dom.js";

const FORMATS = {
  imdf: "IMDF archive (.zip)",
  osm: "OpenStreetMap, Simple Indoor Tagging (.osm, .geojson)",
  image: "Pictures and a description (.zip with .toml)",
  "ms-indoor": "ms-indoor: a folder per floor (.zip)",
  hcu: "HCU Hamburg (.zip)",
  simpleloc: "simpleLoc (.xml)",
  wayfuse: "Folder of wayfuse site import (.zip)",
};

/** imported(name): a site was imported. anchors: the element in which those of the site are changed. */
export function startImport(imported, anchors) {
  const format = el("select", { id: "plan-format" }, ...Object.entries(FORMATS).map(([value, textContent]) => el("option", { value, textContent })));
  const file = el("input", { type: "file", id: "plan-file", aria: { label: "Floor plans" } });
  const name = el("input", { type: "text", id: "plan-name", placeholder: "as the plan says", maxLength: 100, spellcheck: false });
  const replace = el("input", { type: "checkbox", id: "plan-replace" });
  const warnings = el("ul", { className: "small" });
  const start = action("Import", async () => {
    const [plans] = file.files;
    if (!plans) return "Choose a file first.";
    warnings.replaceChildren();
    const query = { format: format.value, file: plans.name, name: name.value.trim(), replace: replace.checked };
    const said = await post("/api/v1/sites", query, plans);
    file.value = name.value = "";
    replace.checked = false;
    const met = [...said.warnings, ...said.floors.flatMap((f) => (f.warnings ?? []).map((w) => `level ${f.floor}: ${w}`)), ...said.problems];
    warnings.replaceChildren(...met.slice(0, 20).map((text) => el("li", { textContent: text })));
    await imported(said.site);
    return `${said.site}: ${said.floors.length} floors${said.errors ? `, ${said.errors} errors in the plan` : ""}.`;
  });
  const element = el("fieldset", {}, el("legend", { textContent: "Building" }),
    el("details", {}, el("summary", { textContent: "Import floor plans" }),
      el("label", { htmlFor: "plan-format", textContent: "Format" }), format, file,
      el("label", { htmlFor: "plan-name", textContent: "Name" }), name,
      el("label", { className: "choices" }, replace, "in place of the one of this name"),
      start, warnings,
      el("p", { className: "small", textContent: "It takes a token with the scope admin. As soon as there is a second building, phones have to say which they mean: make their push addresses here." })),
    anchors);
  return { element, open: () => { element.querySelector("details").open = true; } };
}
