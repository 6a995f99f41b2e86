// The files of the page and the commands that run on them. Nothing here shows anything.

import { decompress } from "fzstd";

/** Bytes of a text in base64. */
function bytesOf(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

/** What the page needs beside itself: in the page, or in files beside it. */
async function part(name) {
  const inside = document.getElementById(`part-${name}`);
  if (inside) return decompress(bytesOf(inside.textContent));
  const answer = await fetch(`${name}.zst`);
  if (!answer.ok) throw new Error(`${name}.zst is not beside the page (${answer.status})`);
  return decompress(new Uint8Array(await answer.arrayBuffer()));
}

export class Workbench {
  constructor() {
    /** Path to blob, in the order in which they came. */
    this.files = new Map();
    this.worker = null;
  }

  /** The program, compiled once. */
  module() {
    this.compiled ??= part("kalmems.wasm").then((bytes) => WebAssembly.compile(bytes));
    return this.compiled;
  }

  /** The examples: path to text. */
  examples() {
    this.known ??= part("examples.json").then((bytes) => JSON.parse(new TextDecoder().decode(bytes)));
    return this.known;
  }

  async #start() {
    const script = document.getElementById("part-worker.js");
    if (!script) return new Worker("worker.js");
    this.script ??= URL.createObjectURL(new Blob([script.textContent], { type: "text/javascript" }));
    return new Worker(this.script);
  }

  /** Runs a command; how it ended, or `null` where it was stopped. `hear` gets what it says meanwhile. */
  async run(words, hear = () => {}) {
    const module = await this.module();
    this.worker = await this.#start();
    const ended = await new Promise((resolve) => {
      this.stopped = () => resolve(null);
      this.worker.onmessage = ({ data }) => (data.kind === "ended" ? resolve(data) : hear(data));
      this.worker.onerror = (event) => {
        hear({ kind: "told", line: `error: ${event.message ?? "the worker could not be started"}` });
        resolve({ code: 101, output: "", files: null, took_s: 0 });
      };
      this.worker.postMessage({ module, words, files: [...this.files] });
    });
    this.worker.terminate();
    this.worker = null;
    if (!ended?.files) return ended && { ...ended, written: [] };
    const before = this.files;
    this.files = new Map(ended.files.map(([path, bytes]) => [path, bytes ? new Blob([bytes]) : before.get(path)]));
    return { ...ended, written: ended.files.filter(([, bytes]) => bytes).map(([path]) => path) };
  }

  /** Ends the command that runs, in the middle of its work. */
  stop() {
    this.worker?.terminate();
    this.stopped?.();
  }
}

/** The words of a line as a shell has them: blanks part, quotation marks hold together. */
export function wordsOf(line) {
  return [...line.matchAll(/"([^"]*)"|'([^']*)'|(\S+)/g)].map(([, a, b, c]) => a ?? b ?? c);
}

/** A line of words that `wordsOf` reads back. */
export function lineOf(words) {
  return words.map((word) => (/^[^\s"']+$/.test(word) ? word : word.includes('"') ? `'${word}'` : `"${word}"`)).join(" ");
}
