// Rooms and geofences: who is in which, and who entered or left one while the page was open.

import { get } from "/web/api.js";
import { el } from "/web/dom.js";
import { collection } from "/web/frames.js";
import { short, store } from "/web/store.js";

const ASK_MS = 2000;
const ROWS = 300;

export function startZones(view, map) {
  const find = el("input", { type: "search", placeholder: "Find a room or geofence", aria: { label: "Find a room or geofence" }, spellcheck: false });
  const said = el("p", { className: "small", role: "status" });
  const list = el("ul", { className: "zones", aria: { label: "Rooms and geofences" } });
  const log = el("ol", { className: "crossings", aria: { label: "Entered and left" } });
  const nobody = el("p", { className: "small", textContent: "Nobody since this page was opened." });
  const rest = el("ul", { className: "zones", aria: { label: "Nobody inside" } });
  const empty = el("details", {}, el("summary", { textContent: "With nobody inside" }), rest);
  view.append(find, said, list, empty, el("h2", { textContent: "Entered and left" }), nobody, log);
  let features = [];
  let inside = {};
  let chosen = "";
  let open = false;

  const draw = () => {
    const here = features.filter((f) => f.properties.floor === store.floor);
    map.data("zones", collection(here.map((f) => ({
      ...f, properties: { ...f.properties, n: open ? count(f) : 0, chosen: open && f.properties.id === chosen },
    }))));
  };
  const count = (f) => (inside[f.properties.id] ?? []).length;
  const fill = () => {
    const wanted = find.value.trim().toLowerCase();
    const found = features.filter((f) => f.properties.name.toLowerCase().includes(wanted));
    const busy = features.filter((f) => count(f)).length;
    said.textContent = features.length
      ? `${features.length} rooms and geofences, ${busy} with somebody inside`
      : "The plan names no room, and there is no geofence.";
    const [some, none] = [true, false].map((is) => found.filter((f) => (count(f) > 0 || f.properties.id === chosen) === is));
    list.replaceChildren(...some.slice(0, ROWS).map(row));
    rest.replaceChildren(...none.slice(0, ROWS).map(row));
    empty.hidden = !none.length;
    if (wanted) empty.open = true;
  };
  const row = (f) => {
    const { id, name, level, kind } = f.properties;
    const who = inside[id] ?? [];
    return el("li", {},
      el("button", { type: "button", className: "zone", data: { zone: id }, aria: { pressed: String(id === chosen) }, on: { click: () => choose(f) } },
        el("span", { className: "name", textContent: name }),
        el("span", { className: "small", textContent: kind === "geofence" ? `${level}, geofence` : level }),
        el("span", { className: "count", textContent: who.length || "" })),
      ...who.map((track) => el("button", { type: "button", className: "who", textContent: short(track), on: { click: () => store.select(track) } })));
  };
  const choose = (f) => {
    chosen = f.properties.id === chosen ? "" : f.properties.id;
    store.following = false;
    if (chosen) store.showFloor(f.properties.floor);
    fill();
    draw();
  };
  const tell = () => {
    nobody.hidden = store.crossings.length > 0;
    log.replaceChildren(...store.crossings.map((c) => el("li", {},
      el("time", { textContent: new Date(1000 * (c.at ?? c.t)).toLocaleTimeString() }),
      el("button", { type: "button", className: "who", textContent: short(c.track), on: { click: () => store.select(c.track) } }),
      el("span", { textContent: `${c.event === "enter" ? "entered" : "left"} ${c.name}` }))));
  };
  const ask = async () => {
    const site = store.site;
    const found = await get("/api/v1/zones/inside", { site });
    if (site !== store.site) return;
    const changed = JSON.stringify(found.inside) !== JSON.stringify(inside);
    inside = found.inside;
    if (!changed) return;
    fill();
    draw();
  };
  const tried = async (work) => {
    try {
      await work();
    } catch (error) {
      said.textContent = error.message;
    }
  };
  find.addEventListener("input", fill);
  setInterval(() => open && !document.hidden && tried(ask), ASK_MS);
  store.on("zones", () => {
    tell();
    if (open) tried(ask);
  });
  store.on("floor", draw);
  store.on("site", () => tried(async () => {
    [features, inside, chosen] = [[], {}, ""];
    tell();
    const site = store.site;
    const found = await get("/api/v1/zones", { site });
    if (site !== store.site) return;
    features = found.features;
    fill();
    draw();
  }));
  tell();
  return {
    opened: () => {
      open = true;
      draw();
      return tried(ask);
    },
    left: () => {
      open = false;
      draw();
    },
  };
}
