// Replay: the estimates of a track, with a slider over its time.

import { get } from "/web/api.js";
import { placeOf, showInstead } from "/web/draw.js";
import { duration, el, metres } from "/web/dom.js";
import { short, store } from "/web/store.js";

const SPEEDS = [1, 4, 16, 64];
const TICK_MS = 100;

export function startReplay(view, map) {
  const choose = el("select", { id: "replay-track", aria: { label: "Track to replay" } });
  const slider = el("input", { type: "range", min: 0, max: 0, step: 0.1, value: 0, aria: { label: "Time" }, id: "replay-time" });
  const play = el("button", { type: "button", textContent: "Play" });
  const speed = el("select", { aria: { label: "Speed" } }, ...SPEEDS.map((s) => el("option", { value: s, textContent: `${s} ×` })));
  const said = el("p", { role: "status", className: "small" });
  const back = el("button", { type: "button", textContent: "Back to live" });
  const controls = el("div", { className: "player", hidden: true }, slider, el("div", { className: "choices" }, play, speed, back));
  view.append(el("label", { htmlFor: "replay-track", textContent: "Track" }), choose, controls, said);
  let places = [];
  let timer = 0;

  const list = async () => {
    const { tracks } = await get("/api/v1/tracks", { site: store.site });
    const kept = choose.value;
    choose.replaceChildren(el("option", { value: "", textContent: tracks.length ? "Choose a track" : "No track yet" }), ...tracks.map((t) =>
      el("option", { value: t.track, textContent: `${short(t.track)}  ${new Date(1000 * t.started).toLocaleString([], { dateStyle: "short", timeStyle: "short" })}, ${duration(t.heard - t.started)}${t.is_live ? ", live" : ""}` })));
    if (tracks.some((t) => t.track === kept)) choose.value = kept;
  };

  const load = async (track) => {
    stop();
    places = [];
    if (track) {
      said.textContent = "…";
      const { features } = await get(`/api/v1/tracks/${track}/estimates`);
      places = features.map((f) => f.properties).filter((p) => p.x !== null);
    }
    controls.hidden = !places.length;
    if (!places.length) {
      said.textContent = track ? "This track has no place yet." : "";
      showInstead(null);
      return;
    }
    slider.max = places.at(-1).t - places[0].t;
    slider.value = 0;
    show();
  };

  const show = () => {
    const t = places[0].t + Number(slider.value);
    let n = places.findIndex((p) => p.t > t);
    n = (n < 0 ? places.length : n) - 1;
    const p = { ...places[Math.max(n, 0)], replay: true };
    const trail = places.slice(Math.max(0, n - 240), n + 1).filter((at) => at.state !== "initialising");
    store.following = false;
    store.showFloor(p.floor);
    showInstead([{ p, trail }]);
    map.follow(placeOf(p));
    const text = `${duration(Number(slider.value))} of ${duration(Number(slider.max))}: ${p.state}, level ${p.level}, within ${metres(p.radius_m_95)} (95 %)`;
    said.textContent = text;
    slider.setAttribute("aria-valuetext", text);
    Object.assign(said.dataset, { level: p.level, n: p.n });
  };

  const stop = () => {
    clearInterval(timer);
    timer = 0;
    play.textContent = "Play";
  };
  const start = () => {
    if (Number(slider.value) >= Number(slider.max)) slider.value = 0;
    play.textContent = "Pause";
    timer = setInterval(() => {
      slider.value = Number(slider.value) + (Number(speed.value) * TICK_MS) / 1000;
      show();
      if (Number(slider.value) >= Number(slider.max)) stop();
    }, TICK_MS);
  };
  const tried = (work) => async () => {
    try {
      await work();
    } catch (error) {
      said.textContent = error.message;
    }
  };
  const leave = () => {
    stop();
    choose.value = "";
    places = [];
    controls.hidden = true;
    said.textContent = "";
    showInstead(null);
  };
  play.addEventListener("click", () => (timer ? stop() : start()));
  slider.addEventListener("input", show);
  back.addEventListener("click", leave);
  choose.addEventListener("change", tried(() => load(choose.value)));
  store.on("site", leave);
  return {
    opened: tried(list),
    left: leave,
    replay: (track) => tried(async () => {
      await list();
      choose.value = track;
      await load(track);
    })(),
  };
}
