// Pictures of the radio map in use: coverage with "survey here next", and the level of an access point.

import { get } from "/web/api.js";
import { el } from "/web/dom.js";
import { collection, feature } from "/web/frames.js";
import { RAMPS, hideGrid, showGrid } from "/web/grid.js";
import { store } from "/web/store.js";

const CHOICES = { none: "Nothing", coverage: "Coverage: where to survey next", heat: "Level of one access point" };

export function startPictures(map) {
  const said = el("p", { className: "small", role: "status" });
  const radios = Object.entries(CHOICES).map(([value, text]) =>
    el("label", {}, el("input", { type: "radio", name: "picture", value, checked: value === "none" }), ` ${text}`));
  const aps = el("select", { id: "access-point", aria: { label: "Access point" }, hidden: true });
  const element = el("fieldset", {}, el("legend", { textContent: "Show on the map" }), el("div", { className: "stack" }, ...radios), aps, said);
  const chosen = () => element.querySelector("[name=picture]:checked").value;
  let known = "";

  const clear = () => {
    hideGrid(map);
    map.data("next", null);
    said.textContent = "";
  };
  const show = async () => {
    const [what, floor] = [chosen(), store.floor];
    aps.hidden = what !== "heat";
    clear();
    if (what === "none") return;
    if (what === "heat") await list();
    const found = what === "coverage" ? await get("/api/v1/survey/coverage", { site: store.site, floor })
      : aps.value ? await get("/api/v1/survey/heat", { site: store.site, floor, bssid: aps.value }) : null;
    if (!found || what !== chosen() || floor !== store.floor) return;
    const { frame, level } = store.floors[floor];
    if (what === "coverage") {
      showGrid(map, frame, found, RAMPS.distance, found.fingerprints ? null : RAMPS.distance.high);
      map.data("next", collection(found.next.map((p, n) => feature(frame.point(p.x, p.y), { rank: `${n + 1}` }))));
      said.textContent = found.next.length
        ? `Level ${level}: ${found.fingerprints} fingerprints. Survey next at ${found.next.map((_, n) => n + 1).join(", ")}, the worst first.`
        : `Level ${level}: ${found.fingerprints} fingerprints; no place is farther than 5 m from one.`;
    } else {
      showGrid(map, frame, found, RAMPS.level);
      said.textContent = `Level ${level}: heard by ${found.fingerprints} fingerprints.`;
    }
  };
  const list = async () => {
    const { access_points: all, version, n } = await get("/api/v1/survey/access-points", { site: store.site });
    if (known === `${store.site} ${version}`) return;
    known = `${store.site} ${version}`;
    aps.replaceChildren(...all.map((ap) => el("option", { value: ap.bssid, textContent:
      `${ap.bssid}${ap.mhz ? `, ${ap.mhz} MHz` : ""}: ${ap.fingerprints.reduce((a, b) => a + b, 0)} places` })));
    aps.title = n > all.length ? `the ${all.length} most heard of ${n}` : "";
  };
  const tried = async () => {
    try {
      await show();
    } catch (error) {
      clear();
      said.textContent = error.message;
    }
  };
  element.addEventListener("change", tried);
  store.on("floor", () => !element.closest("[hidden]") && chosen() !== "none" && tried());
  return { element, again: tried, clear };
}
