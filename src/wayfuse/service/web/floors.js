// The floor selector: highest floor on top, with the number of people on each. Page up and down change the floor.

import { el } from "/web/dom.js";
import { store } from "/web/store.js";

export function startFloors(at) {
  const buttons = () => [...at.querySelectorAll("button")];
  const build = () => {
    const made = [...store.floors.entries()].reverse().map(([n, floor]) =>
      el("button", { type: "button", role: "radio", data: { floor: n }, aria: { label: `Floor ${floor.level}` }, on: { click: () => pick(n) } },
        el("span", { textContent: floor.level }), el("span", { className: "count" })));
    at.replaceChildren(...made);
    mark();
  };
  const pick = (n) => {
    store.following = false;
    store.showFloor(n);
  };
  const mark = () => {
    for (const button of buttons()) {
      const is = Number(button.dataset.floor) === store.floor;
      button.setAttribute("aria-checked", String(is));
      button.tabIndex = is ? 0 : -1;
      if (is) button.scrollIntoView({ block: "nearest" });
    }
  };
  const count = () => {
    const on = new Map();
    for (const { p } of store.tracks.values()) if (!store.isQuiet(p) && p.x !== null) on.set(p.floor, (on.get(p.floor) ?? 0) + 1);
    for (const button of buttons()) {
      const n = on.get(Number(button.dataset.floor)) ?? 0;
      button.lastChild.textContent = n || "";
      button.setAttribute("aria-label", `Floor ${button.firstChild.textContent}${n ? `, ${n} tracked` : ""}`);
    }
  };
  const step = (by) => {
    const n = Math.min(Math.max(store.floor + by, 0), store.floors.length - 1);
    pick(n);
    return n;
  };
  at.addEventListener("keydown", (event) => {
    const by = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    const n = step(by);
    buttons().find((b) => Number(b.dataset.floor) === n)?.focus();
  });
  document.addEventListener("keydown", (event) => {
    const by = { PageUp: 1, PageDown: -1 }[event.key];
    const typing = event.target.closest?.("input, select, textarea, dialog, #panel");
    if (!by || typing) return;
    event.preventDefault();
    step(by);
  });
  store.on("site", build);
  store.on("floor", mark);
  store.on("tracks", count);
}
