// The page: token, site, map, and the parts that share them.

import { startAdmin } from "/web/admin.js";
import { Refused, get, hasToken, keepToken, listen } from "/web/api.js";
import { byId, el, notice } from "/web/dom.js";
import { startDrawing } from "/web/draw.js";
import { startFloors } from "/web/floors.js";
import { IndoorMap } from "/web/map.js";
import { startReplay } from "/web/replay.js";
import { store } from "/web/store.js";
import { startSurvey } from "/web/survey.js";
import { startTabs } from "/web/tabs.js";
import { startTheme } from "/web/theme.js";
import { startTracks } from "/web/tracks.js";
import { startZones } from "/web/zones.js";

let listening = new AbortController();

/** Ask for a token until one works; resolves with the sites it shows. */
async function enter(said = "") {
  const dialog = byId("login");
  for (let text = said; ; ) {
    if (hasToken() && !text) {
      try {
        return (await get("/api/v1/sites")).sites;
      } catch (error) {
        text = error.message;
        if (!(error instanceof Refused)) throw error;
      }
    }
    byId("login-said").textContent = text;
    dialog.showModal();
    await new Promise((done) => dialog.addEventListener("close", done, { once: true }));
    keepToken(byId("token").value);
    byId("token").value = "";
    text = hasToken() ? "" : "A token is needed.";
  }
}

function showConnection(state, error) {
  const at = byId("connection");
  at.dataset.state = state;
  at.textContent = { on: "live", off: "connecting again", refused: "refused" }[state];
  at.title = error?.message ?? "";
}

async function open(site) {
  listening.abort();
  listening = new AbortController();
  await store.open(site);
  document.title = `wayfuse: ${store.site}`;
  listen(store.site, (event, data) => store.take(event, data), showConnection, listening.signal);
}

function startSites(sites) {
  const select = byId("site");
  select.replaceChildren(...sites.map((s) => el("option", { value: s.name, textContent: s.name })));
  select.hidden = sites.length < 2;
  document.querySelector("label.site").hidden = sites.length < 2;
  select.onchange = () => open(select.value).catch((error) => notice(error.message));
}

/** Go to a building that was not there before. */
async function imported(name) {
  startSites((await get("/api/v1/sites")).sites);
  byId("site").value = name;
  await open(name);
}

async function start() {
  startTheme(byId("theme"));
  const map = await IndoorMap.in(byId("map"));
  map.onDot = (track) => store.select(track);
  startDrawing(map);
  startFloors(byId("floors"));
  const replay = startReplay(byId("view-replay"), map);
  const survey = startSurvey(byId("view-survey"), map, imported);
  startTracks(byId("view-tracks"), map, (track) => {
    byId("tab-replay").click();
    return replay.replay(track);
  });
  const parts = { "tab-zones": startZones(byId("view-zones"), map), "tab-replay": replay, "tab-survey": survey, "tab-admin": startAdmin(byId("view-admin")) };
  let before = "tab-tracks";
  startTabs(document.querySelector("[role=tablist]"), (tab) => {
    if (tab !== before) parts[before]?.left();
    parts[tab]?.opened();
    before = tab;
  });
  byId("leave").addEventListener("click", () => {
    keepToken("");
    location.reload();
  });
  const sites = await enter();
  byId("leave").hidden = false;
  const { scopes } = await get("/api/v1/token");
  const may = (scope) => scopes.includes(scope) || scopes.includes("admin");
  byId("tab-survey").hidden = !may("survey");
  byId("tab-admin").hidden = !may("admin");
  startSites(sites);
  if (sites.length) await open(sites[0].name);
  else {
    notice("There is no building yet that this token may see. An administrator imports one under Survey.");
    if (may("admin")) byId("tab-survey").click();
  }
}

start().catch((error) => notice(error.message));
