// The page: files, the questions of `new`, a command, and its result.
import { zipSync } from "fflate";
import { Workbench, lineOf, wordsOf } from "./workbench.js";

const $ = (selector) => document.querySelector(selector);
const workbench = new Workbench();

/** A command, and a table of the files that it is for; without one it is for any. */
const COMMANDS = {
  estimate: /^\s*\[device/m,
  inspect: null,
  identify: /^\s*\[identify/m,
  simulate: /^\s*\[simulate/m,
  diagnose: /^\s*\[device/m,
  image: /^\s*\[intensity/m,
  spectrum: /^\s*\[light/m,
  "calibrate gyro": /^\s*\[gyroscope/m,
  study: /^\s*\[\[vary/m,
  export: /^\s*\[device/m,
};
/** Recordings beyond this many bytes leave results that a browser can hold only without the trajectories as text. */
const LONG = 100e6;

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

const sizeOf = (bytes) => (bytes < 1000 ? `${bytes} B` : bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);

function say(text, failure = false) {
  $("#state").textContent = text;
  $("#state").classList.toggle("failure", failure);
}

// ---- Files -----------------------------------------------------------------------------------------------------------

const isResult = (path) => path.startsWith("out/") && !path.startsWith("out/simulated/");
const isText = (path) => path.endsWith(".toml");
let texts = new Map();

/** Puts files of the user in. */
async function add(given) {
  for (const [path, blob] of given) workbench.files.set(path, blob);
  await show();
  const first = given.map(([path]) => path).find(isText);
  if (first) choose(first);
}

/** Shows the files, and offers them where one is asked for. */
async function show() {
  const own = [...workbench.files].filter(([path]) => !isResult(path));
  texts = new Map(await Promise.all(own.filter(([path]) => isText(path)).map(async ([path, blob]) => [path, await blob.text()])));
  $("#files").replaceChildren(
    ...own.map(([path, blob]) =>
      element("li", {}, path, " ", element("output", { textContent: sizeOf(blob.size) }), ...(isText(path) ? [edit(path)] : []), remove(path)),
    ),
  );
  const recordings = own.map(([path]) => path).filter((path) => !isText(path));
  const asked = $("#new [name=recording]");
  const before = asked.value;
  asked.replaceChildren(option("", "none: simulate the device"), ...recordings.map((path) => option(path)));
  if (recordings.includes(before)) asked.value = before;
  offer();
}

const option = (value, text = value) => element("option", { value, textContent: text });

function edit(path) {
  const button = element("button", { type: "button", textContent: "edit" });
  button.setAttribute("aria-label", `edit ${path}`);
  button.onclick = () => {
    const editor = $("#editor");
    Object.assign(editor, { hidden: false, open: true });
    editor.dataset.path = path;
    editor.querySelector("summary").textContent = path;
    editor.querySelector("textarea").value = texts.get(path);
    editor.querySelector("textarea").focus();
  };
  return button;
}

function remove(path) {
  const button = element("button", { type: "button", textContent: "×" });
  button.setAttribute("aria-label", `remove ${path}`);
  button.onclick = () => {
    workbench.files.delete(path);
    show();
  };
  return button;
}

$("#keep").onclick = () => add([[$("#editor").dataset.path, new Blob([$("#editor textarea").value])]]).then(() => ($("#editor").open = false));

const pathOf = (file) => (file.webkitRelativePath || file.name).replace(/^\/+/, "");
for (const input of [$("#choose"), $("#choose-folder")]) {
  input.onchange = () => add([...input.files].map((file) => [pathOf(file), file]));
}

/** The files of something that was dropped: a file, or a folder with all in it. */
async function within(entry, before = "") {
  if (entry.isFile) return [[before + entry.name, await new Promise((done, failed) => entry.file(done, failed))]];
  const reader = entry.createReader();
  const found = [];
  for (;;) {
    const some = await new Promise((done, failed) => reader.readEntries(done, failed));
    if (some.length === 0) return (await Promise.all(found.map((one) => within(one, `${before}${entry.name}/`)))).flat();
    found.push(...some);
  }
}

addEventListener("dragover", (event) => {
  event.preventDefault();
  $("#drop").classList.add("over");
});
addEventListener("dragleave", () => $("#drop").classList.remove("over"));
addEventListener("drop", async (event) => {
  event.preventDefault();
  $("#drop").classList.remove("over");
  const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  const found = entries.length
    ? (await Promise.all(entries.map((entry) => within(entry)))).flat()
    : [...event.dataTransfer.files].map((file) => [pathOf(file), file]);
  await add(found);
});

workbench.examples().then((files) => {
  const folders = [...new Set(Object.keys(files).map((path) => path.split("/")[1]))];
  $("#example").append(...folders.map((name) => option(name, name.replaceAll("_", " "))));
  $("#example").onchange = () => {
    const folder = `examples/${$("#example").value}/`;
    const all = Object.entries(files).filter(([path]) => path.startsWith(folder));
    // The experiment that a newcomer runs first is offered first.
    const rank = ([path]) => (path.endsWith("/experiment.toml") ? 0 : 1);
    if (all.length) add(all.sort((a, b) => rank(a) - rank(b)).map(([path, text]) => [path, new Blob([text])]));
  };
});

// ---- The command -----------------------------------------------------------------------------------------------------

const form = $("#command");
form.command.append(...Object.keys(COMMANDS).map((name) => option(name)));

/** Offers the files that the command is for. */
function offer() {
  const table = COMMANDS[form.command.value];
  const fits = (path) => !table || table.test(texts.get(path) ?? "");
  const before = form.file.value;
  const paths = [...workbench.files.keys()].filter((path) => !isResult(path) && fits(path));
  form.file.replaceChildren(...paths.map((path) => option(path)));
  if (paths.includes(before)) form.file.value = before;
  write();
}

/** Offers a file for the command. */
function choose(path) {
  if ([...form.file.options].some((one) => one.value === path)) form.file.value = path;
  write();
}

/** Writes the line that is run, which can be changed. */
function write() {
  const { command, file, line } = form;
  if (!file.value) return void (line.value = "");
  const words = [...command.value.split(" "), file.value];
  const long = [...workbench.files.values()].some((blob) => blob.size > LONG);
  if (command.value === "estimate" && long) words.push("--no-trajectories");
  if (command.value === "inspect" && !isText(file.value)) words.push("--report", "out/inspect.html", "--force");
  if (command.value === "diagnose") words.push("--report", "out/diagnose.html", "--force");
  if (command.value === "export") words.push("--out", "out/export");
  line.value = lineOf(words);
}
form.command.onchange = offer;
form.file.onchange = write;

let running = false;

/** Runs these words, and shows what they say meanwhile; how it ended. */
async function run(words) {
  if (running) return null;
  running = true;
  const said = $("#console");
  said.hidden = false;
  said.textContent = `$ kalmems ${lineOf(words)}\n`;
  $("#run").disabled = true;
  $("#stop").disabled = false;
  say("running");
  const ended = await workbench.run(words, ({ kind, line, percent, what }) => {
    if (kind === "told") said.textContent += `${line}\n`;
    if (kind === "progress") {
      $("#progress").hidden = false;
      $("#progress").value = percent;
      say(what);
    }
  });
  running = false;
  $("#run").disabled = false;
  $("#stop").disabled = true;
  $("#progress").hidden = true;
  if (ended) said.textContent += ended.output;
  const code = ended?.code;
  say(ended ? (code === 0 ? `done in ${ended.took_s.toFixed(1)} s` : `ended with code ${code}: see above`) : "stopped", code !== 0);
  return ended;
}

$("#stop").onclick = () => workbench.stop();

form.onsubmit = async (event) => {
  event.preventDefault();
  const ended = await run(wordsOf(form.line.value));
  if (!ended) return;
  await show();
  if (ended.written.length) results(ended.written);
};

// ---- Results ---------------------------------------------------------------------------------------------------------

let written = [];

function results(paths) {
  written = paths.filter((path) => workbench.files.has(path));
  const pages = written.filter((path) => path.endsWith(".html"));
  $("#results").hidden = written.length === 0;
  $("#which").replaceChildren(...pages.map((path) => option(path)));
  $("#written").replaceChildren(
    ...written.map((path) => {
      const button = element("button", { type: "button", textContent: path });
      button.onclick = () => save(path.split("/").at(-1), workbench.files.get(path));
      return element("li", {}, button, " ", element("output", { textContent: sizeOf(workbench.files.get(path).size) }));
    }),
  );
  $("#save-report").disabled = $("#report").hidden = pages.length === 0;
  if (pages.length) report();
}

async function report() {
  $("#report").srcdoc = await workbench.files.get($("#which").value).text();
}
$("#which").onchange = report;

function save(name, blob) {
  const address = URL.createObjectURL(blob);
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
}
$("#save-report").onclick = () => save($("#which").value.split("/").at(-1), workbench.files.get($("#which").value));
$("#save-all").onclick = async () => {
  const files = await Promise.all(written.map(async (path) => [path, new Uint8Array(await workbench.files.get(path).arrayBuffer())]));
  // Without compression: pictures and reports are packed already.
  save("kalmems.zip", new Blob([zipSync(Object.fromEntries(files), { level: 0 })], { type: "application/zip" }));
};

// ---- The questions of `kalmems new` --------------------------------------------------------------------------------------

const asking = $("#new form");
let devices = [];

$("#new").ontoggle = async () => {
  if (!$("#new").open || devices.length) return;
  const listed = await workbench.run(["new", "--list", "--json"]);
  devices = JSON.parse(listed.output);
  asking.device.append(...devices.map(({ name, description }) => option(name, `${name}: ${description}`)));
  describe();
};

function describe() {
  const device = devices.find(({ name }) => name === asking.device.value);
  $("#described").replaceChildren(element("pre", { textContent: device?.sketch.join("\n") ?? "", ariaLabel: "What the signal looks like", role: "img" }));
  $("#questions").replaceChildren();
}
asking.device.onchange = describe;
asking.recording.onchange = () => $("#questions").replaceChildren();

asking.onsubmit = async (event) => {
  event.preventDefault();
  const { device, recording, rate, write: target } = asking;
  // Paths of the recordings count from the folder of the experiment.
  const words = ["new", ...(recording.value ? [recording.value] : []), "--device", device.value, "--write", target.value, "--force", "--json"];
  if (recording.value && rate.value.trim()) words.push("--rate", rate.value.trim());
  for (const select of $("#questions").querySelectorAll("select")) words.push("--channel", `${select.name}=${select.value}`);
  const ended = await run(words);
  const told = ended?.output ? JSON.parse(ended.output) : {};
  if (told.questions) return ask(told.questions);
  await show();
  if (ended?.code === 0) {
    form.command.value = recording.value ? "estimate" : "simulate";
    offer();
    choose(target.value);
    say(`${target.value} is written; run it, or edit it first`);
  }
};

/** Asks the first question, beside what was answered already: its answer may settle the others. */
function ask([{ meaning, what, candidates }]) {
  if (candidates.length === 0) return say(`no column can be ${meaning}: see below`, true);
  const select = element("select", { name: meaning }, ...candidates.map((column) => option(column)));
  $("#questions").append(element("fieldset", {}, element("label", {}, `Which column is ${meaning}, ${what}? `, select)));
  select.focus();
  say("a question is open: see above the button");
}

// ---- Ready -----------------------------------------------------------------------------------------------------------

window.kalmems = workbench;
workbench.module().then(
  () => say("ready"),
  (error) => say(`the program could not be loaded: ${error.message}`, true),
);
