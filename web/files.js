// Files in memory for a command that runs as WASI: what was dropped is read by slices when it is asked for, what the command
// writes grows in place.
import { Directory, Fd, Inode, PreopenDirectory, wasi } from "@bjorn3/browser_wasi_shim";

/** How much of a dropped file is read at once. */
const AHEAD = 1 << 20;

const NOTHING = new Uint8Array(0);

/** A file whose content is somewhere else: `source` has its `size` and reads `(from, to)`. */
class Given extends Inode {
  constructor(source) {
    super();
    this.source = source;
  }

  get size() {
    return this.source.size;
  }

  stat() {
    return new wasi.Filestat(this.ino, wasi.FILETYPE_REGULAR_FILE, BigInt(this.size));
  }

  path_open(oflags, rights) {
    if (oflags & wasi.OFLAGS_TRUNC) return { ret: wasi.ERRNO_PERM, fd_obj: null };
    return { ret: wasi.ERRNO_SUCCESS, fd_obj: new Reading(this) };
  }

  content() {
    return null;
  }
}

/** A file that the command writes. Its memory doubles when it is full, so that many small writes cost no more than one large. */
class Written extends Inode {
  constructor(bytes = NOTHING) {
    super();
    this.bytes = bytes;
    this.size = bytes.length;
  }

  stat() {
    return new wasi.Filestat(this.ino, wasi.FILETYPE_REGULAR_FILE, BigInt(this.size));
  }

  path_open(oflags, rights, flags) {
    if (oflags & wasi.OFLAGS_TRUNC) this.size = 0;
    const fd = new Writing(this);
    if (flags & wasi.FDFLAGS_APPEND) fd.place = this.size;
    return { ret: wasi.ERRNO_SUCCESS, fd_obj: fd };
  }

  get source() {
    return { read: (from, to) => this.bytes.subarray(from, Math.min(to, this.size)) };
  }

  resize(size) {
    if (size > this.bytes.length) {
      const bytes = new Uint8Array(Math.max(size, 2 * this.bytes.length, 1 << 16));
      bytes.set(this.bytes.subarray(0, this.size));
      this.bytes = bytes;
    } else if (size > this.size) {
      this.bytes.fill(0, this.size, size);
    }
    this.size = size;
  }

  content() {
    return this.bytes.slice(0, this.size);
  }
}

/** An open file that is read. */
class Reading extends Fd {
  constructor(file) {
    super();
    this.file = file;
    this.place = 0;
    this.ahead = { from: 0, bytes: NOTHING };
  }

  fd_fdstat_get() {
    return { ret: wasi.ERRNO_SUCCESS, fdstat: new wasi.Fdstat(wasi.FILETYPE_REGULAR_FILE, 0) };
  }

  fd_filestat_get() {
    return { ret: wasi.ERRNO_SUCCESS, filestat: this.file.stat() };
  }

  at(from, size) {
    const to = Math.min(from + size, this.file.size);
    if (to <= from) return NOTHING;
    if (size >= AHEAD || this.file instanceof Written) return this.file.source.read(from, to);
    const { ahead } = this;
    if (from < ahead.from || to > ahead.from + ahead.bytes.length) {
      this.ahead = { from, bytes: this.file.source.read(from, Math.min(from + AHEAD, this.file.size)) };
    }
    return this.ahead.bytes.subarray(from - this.ahead.from, to - this.ahead.from);
  }

  fd_read(size) {
    const data = this.at(this.place, size);
    this.place += data.length;
    return { ret: wasi.ERRNO_SUCCESS, data };
  }

  fd_pread(size, offset) {
    return { ret: wasi.ERRNO_SUCCESS, data: this.at(Number(offset), size) };
  }

  fd_seek(offset, whence) {
    const base = { [wasi.WHENCE_SET]: 0, [wasi.WHENCE_CUR]: this.place, [wasi.WHENCE_END]: this.file.size }[whence];
    const place = base === undefined ? -1 : base + Number(offset);
    if (place < 0) return { ret: wasi.ERRNO_INVAL, offset: 0n };
    this.place = place;
    return { ret: wasi.ERRNO_SUCCESS, offset: BigInt(place) };
  }

  fd_tell() {
    return { ret: wasi.ERRNO_SUCCESS, offset: BigInt(this.place) };
  }
}

/** An open file that is read and written. */
class Writing extends Reading {
  put(data, from) {
    if (from + data.length > this.file.size) this.file.resize(from + data.length);
    this.file.bytes.set(data, from);
    return { ret: wasi.ERRNO_SUCCESS, nwritten: data.length };
  }

  fd_write(data) {
    const done = this.put(data, this.place);
    this.place += data.length;
    return done;
  }

  fd_pwrite(data, offset) {
    return this.put(data, Number(offset));
  }

  fd_filestat_set_size(size) {
    this.file.resize(Number(size));
    return wasi.ERRNO_SUCCESS;
  }
}

/** The root, as whatever is opened below it. */
class Root extends PreopenDirectory {
  constructor() {
    super("/", new Map());
    this.dir = new Folder();
  }

  /** There are no links, which is what a path is asked for when it is made absolute. */
  path_readlink(path) {
    const { ret } = this.path_filestat_get(0, path);
    return { ret: ret === wasi.ERRNO_SUCCESS ? wasi.ERRNO_INVAL : ret, data: null };
  }
}

/** A folder in which new files grow. */
class Folder extends Directory {
  constructor(contents = new Map()) {
    super(contents);
  }

  create_entry_for_path(path, isFolder) {
    const made = super.create_entry_for_path(path, isFolder);
    if (made.entry === null) return made;
    const steps = path.split("/").filter((step) => step && step !== ".");
    const folder = steps.slice(0, -1).reduce((at, step) => at.contents.get(step), this);
    const entry = isFolder ? new Folder() : new Written();
    if (isFolder) entry.parent = folder;
    folder.contents.set(steps.at(-1), entry);
    return { ...made, entry };
  }
}

/** The tree of files that a command sees as the root of its system. `files` are `[path, source]`. */
export class Tree {
  constructor(files) {
    this.open = new Root();
    for (const [path, source] of files) {
      const steps = path.split("/");
      let at = this.open.dir;
      for (const step of steps.slice(0, -1)) {
        if (!at.contents.has(step)) {
          const folder = new Folder();
          folder.parent = at;
          at.contents.set(step, folder);
        }
        at = at.contents.get(step);
      }
      at.contents.set(steps.at(-1), new Given(source));
    }
  }

  /** All files: `[path, bytes]`, without bytes where a file is as it was given. */
  *files(folder = this.open.dir, before = "") {
    for (const [name, entry] of folder.contents) {
      if (entry instanceof Directory) yield* this.files(entry, `${before}${name}/`);
      else yield [before + name, entry.content()];
    }
  }
}
