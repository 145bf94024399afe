// The list of tracks, and what is known of the chosen one: state, why, counters, particles.

import { get } from "/web/api.js";
import { placeOf } from "/web/draw.js";
import { age, duration, el, metres, percent } from "/web/dom.js";
import { collection, feature } from "/web/frames.js";
import { short, store } from "/web/store.js";
import { onTheme, trackColour } from "/web/theme.js";

const ROWS = 300;
const REFRESH_MS = 500;
const ASK_MS = 1000;

export function startTracks(view, map, replay) {
  const find = el("input", { type: "search", placeholder: "Find a track", aria: { label: "Find a track" }, spellcheck: false });
  const summary = el("p", { className: "small", role: "status" });
  const list = el("ul", { className: "tracks", aria: { label: "Live tracks" } });
  const detail = startDetail(map, replay);
  view.append(find, summary, detail.element, list);
  const rows = new Map();

  const refresh = () => {
    const wanted = [...store.tracks.keys()].filter((t) => t.includes(find.value.trim().toLowerCase()));
    const isLate = (t) => Number(store.isQuiet(store.tracks.get(t).p));
    const shown = wanted.sort((a, b) => isLate(a) - isLate(b)).slice(0, ROWS); // otherwise as they came
    const count = (state) => [...store.tracks.values()].filter(({ p }) => p.state === state && !store.isQuiet(p)).length;
    summary.textContent = store.tracks.size
      ? `${store.tracks.size} tracks: ${count("tracking")} tracking, ${count("initialising")} initialising, ${count("lost")} lost${wanted.length > ROWS ? `; the first ${ROWS} are listed` : ""}`
      : "No live track. A phone that sends Wi-Fi scans appears here.";
    for (const track of shown) {
      if (!rows.has(track)) rows.set(track, makeRow(track));
      fillRow(rows.get(track), store.tracks.get(track).p);
    }
    const now = shown.map((track) => rows.get(track).item);
    if (now.length !== list.children.length || now.some((item, n) => list.children[n] !== item)) list.replaceChildren(...now);
  };
  find.addEventListener("input", refresh);
  store.on("site", () => rows.clear());
  store.on("select site", refresh);
  onTheme(refresh);
  let due = false;
  store.on("tracks", () => {
    if (!due) setTimeout(() => { due = false; refresh(); }, REFRESH_MS);
    due = true;
  });
  setInterval(refresh, 5000); // ages go on when nobody speaks
}

function makeRow(track) {
  const parts = Object.fromEntries(["mark", "name", "level", "state", "radius", "age"].map((k) => [k, el("span", { className: k })]));
  const button = el("button", { type: "button", on: { click: () => store.select(track === store.selected ? "" : track) } }, ...Object.values(parts));
  return { item: el("li", {}, button), button, parts };
}

function fillRow({ button, parts }, p) {
  parts.mark.style.setProperty("--colour", trackColour(p.track));
  parts.name.textContent = short(p.track);
  parts.level.textContent = p.x === null ? "–" : p.level;
  parts.state.textContent = p.is_ended ? "ended" : p.state;
  parts.radius.textContent = `± ${metres(p.radius_m_95, 0)}`;
  parts.age.textContent = age(store.now - p.heard);
  Object.assign(button.dataset, { track: p.track, state: p.state, level: p.level, n: p.n });
  button.classList.toggle("quiet", store.isQuiet(p));
  button.setAttribute("aria-pressed", String(p.track === store.selected));
}

function startDetail(map, replay) {
  const said = el("p", { className: "state", aria: { live: "polite" } });
  const facts = el("dl", { className: "facts" });
  const counters = el("details", {}, el("summary", { textContent: "Counters of its input" }));
  const table = el("dl", { className: "facts" });
  counters.append(table);
  const cloud = el("input", { type: "checkbox", id: "show-particles" });
  const follow = el("input", { type: "checkbox", id: "follow" });
  const element = el("section", { className: "detail", hidden: true, aria: { label: "The chosen track" } },
    said, facts,
    el("div", { className: "choices" },
      el("label", {}, follow, " follow"),
      el("label", {}, cloud, " particles"),
      el("button", { type: "button", textContent: "Go to", on: { click: () => goTo(map) } }),
      el("button", { type: "button", textContent: "Replay", on: { click: () => replay(store.selected) } }),
      el("button", { type: "button", textContent: "Close", on: { click: () => store.select("") } })),
    counters);

  const fill = () => {
    const at = store.tracks.get(store.selected);
    element.hidden = !at;
    if (!at) return;
    follow.checked = store.following;
    const { p } = at;
    const now = `${short(p.track)}: ${p.is_ended ? "ended, was " : ""}${p.state}${p.x === null ? "" : ` on level ${p.level}`}`;
    if (said.textContent !== now) said.textContent = now;
    facts.replaceChildren(...pairs({
      Place: p.x === null ? "–" : `x ${metres(p.x)}, y ${metres(p.y)}`,
      "Within, 68 / 95 %": `${metres(p.radius_m_68)} / ${metres(p.radius_m_95)}`,
      "Steps since the last one": p.why.steps,
      "Access points heard": p.why.access_points,
      "Stopped by walls": percent(p.why.share_blocked),
      "Effective particles": percent(p.why.effective_particles),
      "Last heard": `${duration(store.now - p.heard)} ago`,
    }));
  };
  follow.addEventListener("change", () => {
    store.following = follow.checked;
    if (follow.checked) store.select(store.selected);
    store.tell("tracks");
  });
  cloud.addEventListener("change", () => drawParticles(map, cloud.checked));
  store.on("select tracks floor", fill);
  store.on("select", () => {
    drawParticles(map, cloud.checked);
    if (store.selected) element.scrollIntoView({ block: "nearest" });
  });
  store.on("floor", () => drawParticles(map, cloud.checked));
  ask(async () => {
    if (!store.selected) return;
    if (counters.open) {
      const { counts = {} } = await get(`/api/v1/tracks/${store.selected}`);
      table.replaceChildren(...pairs(counts));
    }
    if (cloud.checked) await drawParticles(map, true);
  });
  return { element };
}

function goTo(map) {
  const at = store.tracks.get(store.selected);
  if (!at || at.p.x === null) return;
  store.showFloor(at.p.floor);
  map.goTo(placeOf(at.p));
}

async function drawParticles(map, wanted) {
  const track = store.selected;
  if (!wanted || !track) {
    map.data("particles", null);
    return;
  }
  let of;
  try {
    of = await get(`/api/v1/tracks/${track}/particles`);
  } catch {
    map.data("particles", null); // it has just left the memory
    return;
  }
  if (track !== store.selected) return;
  const most = Math.max(...of.weight, 1e-12);
  const colour = trackColour(track);
  const here = [...of.x.keys()].filter((i) => of.floor[i] === store.floor);
  const { frame } = store.floors[store.floor];
  map.data("particles", collection(here.map((i) =>
    feature(frame.point(of.x[i], of.y[i]), { colour, opacity: 0.15 + 0.6 * (of.weight[i] / most) }))));
}

function pairs(of) {
  return Object.entries(of).flatMap(([name, value]) => [el("dt", { textContent: name }), el("dd", { textContent: value })]);
}

/** Do something again and again, also after it failed. */
function ask(work) {
  const again = async () => {
    try {
      if (!document.hidden) await work();
    } catch {
      // the connection says so itself
    } finally {
      setTimeout(again, ASK_MS);
    }
  };
  again();
}
