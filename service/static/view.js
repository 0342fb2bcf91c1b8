/** The page of one job: its progress while it runs, then its patches. */

import { GcvecView } from "./gcvec.js";
import { awaitBlob, awaitJson, callChecked, callFile, eventsOf } from "./session.js";

const element = (id) => document.getElementById(id);
const address = location.pathname.replace(/\/view$/, "");

const PHASES = {
  queued: "Waiting for a worker",
  regions: "Finding regions",
  boundary: "Fitting boundary curves",
  mesh: "Meshing patches",
  refine: "Refining colours",
  encode: "Writing the file",
};
const DOWNLOADS = {
  gcv: ["gcvec file", "compact, editable"],
  svg: ["SVG", "vector outlines, sampled shading"],
  pdf: ["PDF", "Gouraud shading"],
  glb: ["GLB", "3-D mesh"],
  result: ["JSON", "complete description"],
  preview: ["PNG", "as it is drawn"],
  report: ["Report", "errors and times"],
};
const OVERLAY_KEYS = { o: "outlines", p: "polygons", c: "points" };

async function start() {
  try {
    await show(await awaitJson(address, showAway));
  } catch (error) {
    showProblem("This job cannot be shown", error.message);
  }
}

const showAway = () => (element("summary").textContent = "The service does not answer. Trying again…");

async function show(job) {
  element("summary").textContent = "";
  if (job.status === "succeeded") return showResult(job);
  if (job.status === "failed") return showProblem(job.error.title, job.error.detail);
  if (job.status === "canceled") return showProblem("Canceled", "This job was canceled before it had finished.");
  await watch(job);
}

/* While it runs. */

async function watch(job) {
  element("progress").hidden = false;
  element("cancel").onclick = cancel;
  showProgress(job.progress);
  for await (const { event, data } of eventsOf(job.links, showAway)) {
    element("summary").textContent = ""; // it answers
    if (event === "snapshot") showProgress(data.progress);
    if (event !== "progress") continue;
    if (data.mse !== null) errors.push(data.mse);
    showProgress(data);
  }
  clearTimeout(drawing);
  element("progress").hidden = true;
  await show(await awaitJson(address, showAway));
}

async function cancel() {
  element("cancel").disabled = true;
  element("cancel-error").hidden = true;
  try {
    await callChecked(address, { method: "DELETE" });
  } catch (error) {
    element("cancel-error").textContent = `Not canceled: ${error.message}`;
    element("cancel-error").hidden = false;
    element("cancel").disabled = false;
  }
}

const DRAWING_PAUSE = 100; // ms, also where the tab is hidden: its title tells how far the job is
const CHART_POINTS = 300;

const errors = [];
let latest = null;
let drawing = 0;

/** Show how far the job is, soon: on a page just opened all that has happened comes at once. */
function showProgress(progress) {
  latest = progress;
  drawing ||= setTimeout(drawProgress, DRAWING_PAUSE);
}

function drawProgress() {
  drawing = 0;
  const { phase = "queued", fraction = 0, mse = null, points = 0, iteration = 0 } = latest ?? {};
  const title = PHASES[phase] ?? phase;
  if (element("phase").textContent !== title) element("phase").textContent = title; // it is read out
  element("fraction").value = fraction;
  document.title = `${Math.round(100 * fraction)}% · gcvec`;
  if (mse === null) return;
  element("mse").textContent = mse.toFixed(mse < 10 ? 2 : 1);
  element("points").textContent = points.toLocaleString();
  element("iteration").textContent = iteration;
  element("errors").setAttribute("d", chartOf(thinned(errors)));
}

/** Some of the values, evenly spread, the last among them: no more than a chart has room for. */
function thinned(values) {
  const step = Math.ceil(values.length / CHART_POINTS);
  return values.filter((_, k) => k % step === 0 || k === values.length - 1);
}

/** A falling line, logarithmic in the error. */
function chartOf(values) {
  const logs = values.map((value) => Math.log(Math.max(value, 0.1)));
  const top = Math.max(...logs);
  const span = Math.max(top - Math.min(...logs), 0.1);
  const steps = Math.max(logs.length - 1, 1);
  return logs.map((v, k) => `${k ? "L" : "M"}${(300 * k) / steps} ${5 + (80 * (top - v)) / span}`).join("");
}

function showProblem(title, detail) {
  element("progress").hidden = true;
  element("problem").hidden = false;
  element("problem-title").textContent = title;
  element("problem-detail").textContent = detail;
  document.title = `${title} · gcvec`;
}

/* When it is done. */

async function showResult(job) {
  element("summary").textContent = "Loading the patches…";
  const result = await awaitJson(job.links.result, showAway);
  element("canvas").hidden = false;
  const view = new GcvecView(element("canvas"));
  element("tools").hidden = false;
  view.padding = { top: 16, right: 16, bottom: element("tools").offsetHeight + 32, left: 16 };
  view.load(result);
  window.gcvec = view; // for the curious, in the console
  element("result-menu").hidden = false;
  showDetails(job, result);
  showDownloads(job);
  connectTools(view);
  await connectOriginal(view, job.links.image);
}

let summary = "";

function showDetails(job, { image, patches, metrics, seconds, warnings }) {
  const size = `${image.width} × ${image.height}`;
  summary = `${size} · ${patches.length.toLocaleString()} ${patches.length === 1 ? "patch" : "patches"}`;
  element("summary").textContent = summary;
  document.title = `${size} · gcvec`;
  const kilobytes = metrics.bytes ? `${(metrics.bytes / 1000).toFixed(1)} kB` : null;
  const rows = [
    ["Size", `${size} px`],
    ["Patches", patches.length],
    ["Control points", metrics.points],
    ["File", kilobytes],
    ["Mean squared error", metrics.mse?.toFixed(2)],
    ["PSNR", metrics.psnr && `${metrics.psnr.toFixed(1)} dB`],
    ["SSIM", metrics.ssim?.toFixed(4)],
    ["Fold-overs", metrics.foldovers],
    ["Time", seconds.total && `${seconds.total.toFixed(1)} s`],
  ];
  for (const [name, value] of rows) {
    if (value === null || value === undefined) continue;
    const row = document.createElement("div");
    row.append(Object.assign(document.createElement("dt"), { textContent: name }));
    row.append(Object.assign(document.createElement("dd"), { textContent: value.toLocaleString() }));
    element("metrics").append(row);
  }
  const all = [...new Set([...job.warnings, ...warnings])];
  element("warnings").hidden = !all.length;
  if (all.length) showCount(all.length);
  element("warnings").append(...all.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}

function showCount(warnings) {
  const word = document.createElement("span");
  word.className = "wide";
  word.textContent = warnings > 1 ? "warnings" : "warning";
  element("details-title").append(` · ${warnings} `, word);
}

function showDownloads(job) {
  for (const [name, [title, hint]] of Object.entries(DOWNLOADS)) {
    if (!job.links[name]) continue;
    const link = Object.assign(document.createElement("a"), { href: job.links[name], download: "" });
    link.append(Object.assign(document.createElement("strong"), { textContent: title }));
    link.append(Object.assign(document.createElement("small"), { textContent: hint }));
    link.onclick = (event) => {
      event.preventDefault();
      if (link.ariaBusy !== "true") download(link, title, hint);
    };
    const item = document.createElement("li");
    item.append(link);
    element("downloads").append(item);
  }
}

/** A link by itself cannot send the key, nor ask again for a file that is being made. */
async function download(link, title, hint) {
  const small = link.querySelector("small");
  small.textContent = hint;
  link.ariaBusy = "true";
  element("summary").textContent = `Making the ${title}…`;
  try {
    const answer = await callFile(link.href);
    const [, name] = /filename="(.*)"/.exec(answer.headers.get("Content-Disposition")) ?? [];
    const file = Object.assign(document.createElement("a"), { download: name ?? "" });
    file.href = URL.createObjectURL(await answer.blob());
    file.click();
    setTimeout(() => URL.revokeObjectURL(file.href), 60_000);
    element("summary").textContent = summary;
  } catch (error) {
    element("summary").textContent = error.message;
    small.textContent = error.message; // on a phone the bar has no room for it
  }
  link.ariaBusy = "false";
}

function connectTools(view) {
  const { canvas } = view;
  const showZoom = () => (element("zoom").textContent = `${Math.round(view.scale * 100)}%`);
  canvas.addEventListener("viewchange", showZoom);
  showZoom();
  element("zoom-in").onclick = () => view.zoom(1.5);
  element("zoom-out").onclick = () => view.zoom(1 / 1.5);
  element("fit").onclick = () => view.fit();
  const toggles = document.querySelectorAll("[data-overlay]");
  for (const button of toggles) {
    button.onclick = () => {
      const shown = press(button);
      for (const name of button.dataset.overlay.split(" ")) view.overlays[name] = shown;
      view.redraw();
    };
  }
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.toLowerCase();
    const overlay = OVERLAY_KEYS[key];
    if (overlay) document.querySelector(`[data-overlay~=${overlay}]`).click();
    else if (key === "x" && !element("compare-toggle").disabled) element("compare-toggle").click();
    else if (key === "escape") closeMenus();
  });
  document.addEventListener("pointerdown", (event) => closeMenus(event.target));
}

function closeMenus(except) {
  for (const menu of document.querySelectorAll("details.menu[open]")) {
    if (menu.contains(except)) continue;
    if (menu.contains(document.activeElement)) menu.querySelector("summary").focus(); // not lost with the sheet
    menu.open = false;
  }
}

function press(button) {
  const pressed = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", pressed);
  return pressed;
}

/** The photo may be of a kind that browsers cannot show: then there is nothing to compare with. */
async function connectOriginal(view, url) {
  const toggle = element("compare-toggle");
  toggle.disabled = true;
  const photo = await awaitBlob(url)
    .then((blob) => createImageBitmap(blob, { imageOrientation: "from-image" }))
    .catch(() => null);
  if (!photo) {
    toggle.title = "This browser cannot show the photo";
    return;
  }
  view.setOriginal(photo);
  toggle.disabled = false;
  const split = element("split");
  const compare = () => {
    view.split = toggle.getAttribute("aria-pressed") === "true" ? Number(split.value) : 0;
    element("compare").hidden = !view.split && toggle.getAttribute("aria-pressed") !== "true";
    element("compare").style.setProperty("--split", split.value);
    view.redraw();
  };
  split.oninput = compare;
  toggle.onclick = () => {
    press(toggle);
    compare();
  };
}

start();
