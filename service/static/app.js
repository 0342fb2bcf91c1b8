/** The upload form and the list of recent jobs. */

import { awaitJson, callBlob, callJson, forgetKey, hasKey } from "./session.js";

const element = (id) => document.getElementById(id);
const NUMBERS = ["target_mse", "max_points", "regions", "snap"];
const TEXTS = ["strategy", "image_name"];
const UNSENT = "Not sent: the service does not answer, or a file has changed since it was chosen.";

function options() {
  const chosen = {};
  for (const name of NUMBERS) if (element(name).value !== "") chosen[name] = Number(element(name).value);
  for (const name of TEXTS) if (element(name).value.trim()) chosen[name] = element(name).value.trim();
  return chosen;
}

async function submit(event) {
  event.preventDefault();
  const body = new FormData();
  body.append("image", element("image").files[0]);
  const [annotations] = element("annotations").files;
  if (annotations) body.append("annotations", annotations);
  body.append("options", JSON.stringify(options()));
  busy(true);
  try {
    const job = await callJson("/v1/jobs", { method: "POST", body });
    location.assign(`${job.links.self}/view`);
  } catch (error) {
    element("error").textContent = error instanceof TypeError ? UNSENT : error.message; // browsers say no more
    element("error").hidden = false;
    busy(false);
  }
}

function busy(yes) {
  element("submit").disabled = yes;
  element("submit").textContent = yes ? "Uploading…" : "Vectorize";
  if (yes) hideError();
}

function hideError() {
  element("error").hidden = true;
}

function showChoice() {
  const [file] = element("image").files;
  const thumbnail = element("thumbnail");
  if (thumbnail.src) URL.revokeObjectURL(thumbnail.src);
  thumbnail.hidden = true;
  element("image-name").textContent = file ? file.name : "Choose a photo or drop it here";
  if (!file) return;
  thumbnail.onload = () => (thumbnail.hidden = false);
  thumbnail.src = URL.createObjectURL(file);
}

function acceptDrops() {
  const drop = element("drop");
  for (const name of ["dragenter", "dragover"]) {
    drop.addEventListener(name, (event) => {
      event.preventDefault();
      drop.classList.add("over");
    });
  }
  for (const name of ["dragleave", "drop"]) drop.addEventListener(name, () => drop.classList.remove("over"));
  drop.addEventListener("drop", (event) => {
    event.preventDefault();
    if (!event.dataTransfer.files.length) return;
    element("image").files = event.dataTransfer.files;
    hideError();
    showChoice();
  });
}

async function showRecent() {
  const showAway = () => (element("away").hidden = false);
  const { jobs } = await awaitJson("/v1/jobs?limit=12", showAway).catch(() => ({ jobs: [] })); // they are an extra
  element("away").hidden = true;
  element("forget").hidden = !hasKey();
  element("recent").hidden = !jobs.length;
  element("jobs").replaceChildren(...jobs.map(jobItem));
}

const sources = new WeakMap();

/** Previews are fetched when they come into view. */
const previews = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (!isIntersecting) continue;
    previews.unobserve(target);
    callBlob(sources.get(target)).then((blob) => {
      target.onload = () => URL.revokeObjectURL(target.src);
      target.src = URL.createObjectURL(blob);
    }, console.debug); // the job may have expired
  }
});

function jobItem(job) {
  const link = document.createElement("a");
  link.href = `${job.links.self}/view`;
  if (job.links.preview) {
    const preview = Object.assign(new Image(), { alt: "" });
    previews.observe(preview);
    sources.set(preview, job.links.preview);
    link.append(preview);
  } else {
    link.append(Object.assign(document.createElement("span"), { className: `status ${job.status}`, textContent: job.status }));
  }
  const time = document.createElement("time");
  time.dateTime = job.created_at;
  time.textContent = new Date(job.created_at).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  link.append(time);
  const item = document.createElement("li");
  item.append(link);
  return item;
}

element("form").addEventListener("submit", submit);
element("form").addEventListener("change", hideError); // it told of what was chosen before
element("form").addEventListener("invalid", ({ target }) => {
  if (target.closest("details")) target.closest("details").open = true; // a browser can only show what is there
}, true);
element("forget").addEventListener("click", () => {
  forgetKey();
  location.reload();
});
element("image").addEventListener("change", showChoice);
acceptDrops();
showRecent();
window.addEventListener("pageshow", ({ persisted }) => {
  if (!persisted) return; // the browser went back to the page as it was left: still uploading
  busy(false);
  showRecent();
});
