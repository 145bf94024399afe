// Anchors that measure ranges: where they hang, and the model that makes ranges of their channel state.

import { get, put, remove } from "/web/api.js";
import { action, el } from "/web/dom.js";
import { store } from "/web/store.js";

const CHANNEL = "/api/v1/anchors/channel";

export function startAnchors() {
  const said = el("p", { className: "small", role: "status" });
  const forms = el("div", { className: "forms" });
  const show = ({ is_of_folder: isOfFolder, anchors, channel_anchors: modelled, unplaced }) => {
    const model = modelled ? `, a channel model of ${modelled}` : "";
    const lost = unplaced.length ? ` No place is known of ${unplaced.join(", ")}: add a line for each.` : "";
    const where = isOfFolder ? " They are changed in the folder of the building: access_points.csv and channel.npz." : "";
    said.textContent = `${anchors} anchors${model}.${lost}${where}`;
    forms.hidden = isOfFolder;
  };
  const sent = (path, input, what) => async () => {
    const [file] = input.files;
    if (!file) return "Choose a file first.";
    show(await put(path, { site: store.site }, file));
    input.value = "";
    return what;
  };
  const taken = (path, what) => async () => {
    show(await remove(path, { site: store.site }));
    return what;
  };
  const places = el("input", { type: "file", id: "anchor-places", accept: ".csv" });
  const channel = el("input", { type: "file", id: "anchor-channel", accept: ".npz" });
  forms.append(
    el("label", { htmlFor: places.id, textContent: "Places (.csv)" }), places,
    action("Upload places", sent("/api/v1/anchors", places, "Tracks that begin now use them.")),
    el("label", { htmlFor: channel.id, textContent: "Channel model (.npz of wayfuse survey channel)" }), channel,
    action("Upload model", sent(CHANNEL, channel, "Tracks that begin now use it.")),
    el("div", { className: "choices" },
      action("Take the model away", taken(CHANNEL, "It is gone.")),
      action("Take all away", taken("/api/v1/anchors", "They are gone."))));
  const element = el("details", {}, el("summary", { textContent: "Anchors that measure ranges" }), said, forms,
    el("p", { className: "small", textContent: "A line of the places is bssid,x,y,floor,height: measured, in metres of the floor; the height may be empty. With anchors phones are tracked without a radio map too." }));
  const list = async () => show(await get("/api/v1/anchors", { site: store.site }));
  return { element, list };
}
