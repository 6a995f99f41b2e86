// The worker that one command runs in. Ending the worker is how a command is stopped.
import { run } from "./command.js";

const reader = new FileReaderSync();

/** A file of the page, of which pieces are read when they are asked for. */
const source = (blob) => ({
  size: blob.size,
  read: (from, to) => new Uint8Array(reader.readAsArrayBuffer(blob.slice(from, to))),
});

onmessage = ({ data: { module, words, files } }) => {
  const begun = performance.now();
  const { code, output, files: there } = run(module, words, files.map(([path, blob]) => [path, source(blob)]), {
    told: (line) => postMessage({ kind: "told", line }),
    progress: (percent, what) => postMessage({ kind: "progress", percent, what }),
  });
  const buffers = there.flatMap(([, bytes]) => (bytes ? [bytes.buffer] : []));
  postMessage({ kind: "ended", code, output, files: there, took_s: (performance.now() - begun) / 1000 }, buffers);
};
