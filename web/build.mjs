// Puts the page together: node build.mjs PROGRAM.wasm FOLDER NODE_MODULES VERSION
// FOLDER gets `site`, to be put on any host, and `kalmems.html`, one file that needs no host.
import { createRequire } from "node:module";
import { mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from "node:fs";
import { dirname, join, relative, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { execFileSync } from "node:child_process";

const [program, folder, modules, version] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const root = resolve(here, "..");
const esbuild = createRequire(join(resolve(modules), "x.js"))("esbuild");

/** A script with all that it imports. */
function bundled(name) {
  const made = esbuild.buildSync({
    entryPoints: [join(here, name)], bundle: true, minify: true, write: false, format: "iife", target: "es2022",
    nodePaths: [resolve(modules)], legalComments: "none",
  });
  return made.outputFiles[0].text.replaceAll("</script", "<\\/script");
}

/** What the page that needs no host has room for: an example of each published device. */
const PUBLISHED = ["accelerometer", "micro_stage", "piston_mirror", "shared_scanner", "threshold_scanner"];

/** Examples as text, by their paths. */
function examples(wanted = () => true) {
  const files = {};
  const visit = (at) => {
    for (const name of readdirSync(at).sort()) {
      const path = join(at, name);
      if (statSync(path).isDirectory()) visit(path);
      else if (/\.(toml|csv)$/.test(name) && name !== "Cargo.toml") files[relative(root, path)] = readFileSync(path, "utf8");
    }
  };
  // A device of one's own in Rust is not in this program.
  readdirSync(join(root, "examples")).filter((name) => wanted(name)).sort().forEach((name) => visit(join(root, "examples", name)));
  return files;
}

/** A module without the sections that only a debugger reads. */
function withoutNames(bytes) {
  const number = (at) => {
    let [value, shift] = [0, 1];
    for (;; shift *= 128) {
      const byte = bytes[at++];
      value += (byte & 127) * shift;
      if (byte < 128) return [value, at];
    }
  };
  const kept = [bytes.subarray(0, 8)];
  for (let at = 8; at < bytes.length; ) {
    const [size, begin] = number(at + 1);
    if (bytes[at] !== 0) kept.push(bytes.subarray(at, begin + size));
    at = begin + size;
  }
  return Buffer.concat(kept);
}

/** A browser unpacks gzip by itself; this is a quarter smaller, and the page has 8 kB that unpack it. */
const packed = (bytes) => execFileSync("zstd", ["-q", "-19", "-c"], { input: bytes, maxBuffer: 1 << 28 });
const module = packed(withoutNames(readFileSync(program)));
const [main, worker] = [bundled("main.js"), bundled("worker.js")];
const style = readFileSync(join(here, "page.css"), "utf8");
const escape = (text) => text.replace(/[&<]/g, (letter) => ({ "&": "&amp;", "<": "&lt;" })[letter]);
const licence = (name, file) => `${name}\n${readFileSync(join(modules, name, file), "utf8")}`;
const licences = [licence("@bjorn3/browser_wasi_shim", "LICENSE-MIT"), licence("fflate", "LICENSE"), licence("fzstd", "LICENSE")].join("\n\n");

function page(policy, style, scripts) {
  const values = { policy, style, scripts, version: escape(version), licences: escape(licences) };
  return readFileSync(join(here, "page.html"), "utf8").replace(/\{\{(\w+)\}\}/g, (_, name) => values[name]);
}

rmSync(folder, { recursive: true, force: true });
const site = join(folder, "site");
mkdirSync(site, { recursive: true });
// Reports have their scripts, styles and pictures in themselves, and show in a frame with the policy of the page.
const always = "default-src 'none'; style-src 'unsafe-inline'; img-src data: blob:; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:";
const hosted = `${always} 'self'; style-src-elem 'self' 'unsafe-inline'; worker-src 'self'; connect-src 'self'; frame-src 'self'`;
writeFileSync(join(site, "index.html"), page(hosted, '<link rel="stylesheet" href="page.css">', '<script src="main.js"></script>'));
for (const [name, text] of Object.entries({ "page.css": style, "main.js": main, "worker.js": worker })) writeFileSync(join(site, name), text);
writeFileSync(join(site, "kalmems.wasm.zst"), module);
writeFileSync(join(site, "examples.json.zst"), packed(JSON.stringify(examples())));

// Only what the page makes of its own content can be read: nothing can be asked for over a network.
const offline = `${always}; worker-src blob:; connect-src 'none'`;
const inside = (name, text) => `<script type="text/plain" id="part-${name}">${text}</script>`;
const all = [
  inside("kalmems.wasm", module.toString("base64")),
  inside("examples.json", packed(JSON.stringify(examples((name) => PUBLISHED.includes(name)))).toString("base64")),
  inside("worker.js", worker),
  `<script>${main}</script>`,
];
writeFileSync(join(folder, "kalmems.html"), page(offline, `<style>${style}</style>`, all.join("\n")));
