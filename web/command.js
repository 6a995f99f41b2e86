// Runs the command on a tree of files, whatever reads and shows.
import { Fd, WASI, wasi } from "@bjorn3/browser_wasi_shim";
import { Tree } from "./files.js";

/** Begins a line that says how far the work is. */
const PROGRESS = "\u0001progress";

/** Standard output or standard error: no terminal, so that the command asks nothing. */
class Output extends Fd {
  constructor(take) {
    super();
    this.take = take;
  }

  fd_fdstat_get() {
    return { ret: wasi.ERRNO_SUCCESS, fdstat: new wasi.Fdstat(wasi.FILETYPE_UNKNOWN, 0) };
  }

  fd_filestat_get() {
    return { ret: wasi.ERRNO_SUCCESS, filestat: new wasi.Filestat(0n, wasi.FILETYPE_UNKNOWN, 0n) };
  }

  fd_write(data) {
    this.take(data);
    return { ret: wasi.ERRNO_SUCCESS, nwritten: data.length };
  }
}

/** Cuts bytes into lines. */
function lines(take) {
  const decoder = new TextDecoder();
  let rest = "";
  return (bytes) => {
    const pieces = (rest + decoder.decode(bytes, { stream: true })).split("\n");
    rest = pieces.pop();
    pieces.forEach(take);
  };
}

/**
 * Runs `kalmems` with these words; its exit code, what it printed, and the files that are there then.
 * `told` gets the lines of standard error, `progress` how much of what is done, in percent.
 */
export function run(module, words, files, { told = () => {}, progress = () => {} } = {}) {
  const tree = new Tree(files);
  const printed = [];
  const heard = lines((line) => {
    if (!line.startsWith(PROGRESS)) return told(line);
    const [, percent, ...what] = line.split(" ");
    progress(Number(percent), what.join(" "));
  });
  const fds = [new Output(() => {}), new Output((bytes) => printed.push(bytes)), new Output(heard), tree.open];
  const system = new WASI(["kalmems", ...words], [], fds, { debug: false });
  const instance = new WebAssembly.Instance(module, { wasi_snapshot_preview1: system.wasiImport });
  let code;
  try {
    code = system.start(instance);
  } catch (error) {
    told(`error: the command stopped: ${error.message ?? error}`);
    code = 101;
  }
  return { code, output: decoded(printed), files: [...tree.files()] };
}

function decoded(pieces) {
  const decoder = new TextDecoder();
  return pieces.map((piece) => decoder.decode(piece, { stream: true })).join("") + decoder.decode();
}
