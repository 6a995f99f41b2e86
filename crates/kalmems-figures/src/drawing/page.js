// Plots that can be looked into, in the place of the still pictures: of each figure its panels, drawn from the samples that
// the page holds. Where a browser lacks what this needs, the pictures stay.
"use strict";
(() => {
  const holder = document.getElementById("figure-data");
  if (!holder || typeof DecompressionStream === "undefined" || typeof uPlot === "undefined") return;
  const page = JSON.parse(holder.textContent);

  // ---- Samples -------------------------------------------------------------------------------------------------------

  const unpacked = new Map();

  /** The bytes of a text: base64 of raw deflate. Each is unpacked once. */
  function bytesOf(place) {
    if (!unpacked.has(place)) {
      const text = atob(page.blobs[place]);
      const bytes = new Uint8Array(text.length);
      for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
      const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
      unpacked.set(place, new Response(stream).arrayBuffer().then((buffer) => new Uint8Array(buffer)));
    }
    return unpacked.get(place);
  }

  /** Numbers whose bytes stand plane by plane, the first ones first; of 32 bits the last eight are zero. */
  function fromPlanes(bytes, stored, size, read) {
    const count = bytes.length / stored;
    const view = new DataView(new ArrayBuffer(size));
    const numbers = new Float64Array(count);
    for (let i = 0; i < count; i++) {
      for (let place = 0; place < stored; place++) view.setUint8(place, bytes[place * count + i]);
      numbers[i] = read(view);
    }
    return numbers;
  }

  async function valuesOf(known) {
    const numbers = fromPlanes(await bytesOf(known.blob), 3, 4, (view) => view.getFloat32(0));
    for (let i = 0; i < numbers.length; i++) numbers[i] = known.offset + known.unit * numbers[i];
    return numbers;
  }

  async function abscissaeOf(known) {
    if (known.blob !== undefined) return fromPlanes(await bytesOf(known.blob), 8, 8, (view) => view.getFloat64(0));
    return Float64Array.from({ length: known.count }, (_, i) => known.first + known.step * i);
  }

  /** Lowest and highest of each eight, of each 64 and so on: what a picture of many samples is drawn from. */
  function levelsOf(low, high) {
    const levels = [{ size: 1, low, high }];
    for (let last = levels[0]; last.low.length > 64; last = levels[levels.length - 1]) {
      const count = Math.ceil(last.low.length / 8);
      const next = { size: last.size * 8, low: new Float64Array(count).fill(NaN), high: new Float64Array(count).fill(NaN) };
      for (let i = 0; i < last.low.length; i++) {
        const at = i >> 3;
        if (!(next.low[at] <= last.low[i]) && last.low[i] === last.low[i]) next.low[at] = last.low[i];
        if (!(next.high[at] >= last.high[i]) && last.high[i] === last.high[i]) next.high[at] = last.high[i];
      }
      levels.push(next);
    }
    return levels;
  }

  /** The samples of a series: x, low and high of each group, which of single samples are the same. */
  async function samplesOf(data) {
    const [x, first, second] = await Promise.all([abscissaeOf(data.x), ...data.values.map(valuesOf)]);
    let low = first;
    let high = second ?? first;
    if (data.kind === "band") {
      low = first.map((middle, i) => middle - second[i]);
      high = first.map((middle, i) => middle + second[i]);
    }
    return { x, low, high, per: data.per, rises: data.rises, last: data.last, levels: levelsOf(low, high) };
  }

  // ---- Single samples, from a file beside the page ---------------------------------------------------------------------

  /** Samples in sight up to which each is read; of more there are the groups on the page. */
  const CLOSE = 1 << 16;
  /** Blocks that are kept in memory. */
  const KEPT = 160;

  const crcTable = Uint32Array.from({ length: 256 }, (_, n) => {
    for (let k = 0; k < 8; k++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
    return n >>> 0;
  });
  function crc32(bytes) {
    let crc = 0xffffffff;
    for (let i = 0; i < bytes.length; i++) crc = crcTable[(crc ^ bytes[i]) & 0xff] ^ (crc >>> 8);
    return (crc ^ 0xffffffff) >>> 0;
  }

  /** The file with each sample of each series: picked by the reader, or fetched where the page is served. Never read whole. */
  const samplesFile = {
    known: page.samples,
    /** Reads bytes from and up to a place, once there is a file. */
    read: null,
    tracks: null,
    blocks: new Map(),

    /** Takes a file by what reads pieces of it; refuses one that is not that of this page. */
    async take(read, size) {
      const { bytes, crc32: expected } = this.known;
      if (size !== bytes) throw new Error(`it has ${size} bytes, and that of this report has ${bytes}`);
      const tail = new DataView(await read(bytes - 16, bytes));
      const length = Number(tail.getBigUint64(0, true));
      if (!(length <= bytes - 32)) throw new Error("its description is not where it should be");
      const description = new Uint8Array(await read(bytes - 16 - length, bytes - 16));
      if (crc32(description) !== expected) throw new Error("it belongs to another report, or was changed");
      const { samples_of_a_block: perBlock, tracks } = JSON.parse(new TextDecoder().decode(description));
      Object.assign(this, { perBlock, tracks, read });
    },

    /** A block of a track: abscissae, values, half widths. */
    block(name, place) {
      const key = `${place} ${name}`;
      let found = this.blocks.get(key);
      if (!found) {
        found = this.readBlock(name, place);
        found.catch(() => this.blocks.delete(key));
      }
      // What was asked for last is kept longest.
      this.blocks.delete(key);
      this.blocks.set(key, found);
      if (this.blocks.size > KEPT) this.blocks.delete(this.blocks.keys().next().value);
      return found;
    },

    async readBlock(name, place) {
      const track = this.tracks[name];
      const [at, size, expected] = track.blocks[place];
      const buffer = await this.read(at, at + size);
      if (buffer.byteLength !== size || crc32(new Uint8Array(buffer)) !== expected) throw new Error("the file was changed");
      const count = Math.min(this.perBlock, track.samples - place * this.perBlock);
      const view = new DataView(buffer);
      const [first, step] = [view.getFloat64(0, true), view.getFloat64(8, true)];
      let next = 16 + 16 * track.columns.length;
      const x = new Float64Array(count);
      for (let i = 0; i < count; i++) x[i] = step > 0 ? first + step * i : view.getFloat64(next + 8 * i, true);
      if (!(step > 0)) next += 8 * count;
      const columns = track.columns.map((_, column) => {
        const [offset, unit] = [view.getFloat64(16 + 16 * column, true), view.getFloat64(24 + 16 * column, true)];
        const values = new Float64Array(count).fill(NaN);
        if (unit === 0) return values;
        for (let i = 0; i < count; i++) values[i] = offset + unit * view.getFloat32(next + 4 * i, true);
        next += 4 * count;
        return values;
      });
      return { x, value: columns[0], half: columns[1] };
    },

    /** Each sample of a series between two values of x and some beside them; nothing where there are too many. */
    async samplesOf(series, from, to) {
      const groups = series.samples;
      const [start, end] = within(groups, from, to);
      const track = this.tracks[series.track];
      const [first, last] = [start * groups.per, Math.min(end * groups.per, track.samples)];
      if (last - first > CLOSE || first >= last) return null;
      const places = [];
      for (let place = Math.floor(first / this.perBlock); place * this.perBlock < last; place++) places.push(place);
      const blocks = await Promise.all(places.map((place) => this.block(series.track, place)));
      const joined = (of) => {
        const all = new Float64Array(blocks.reduce((sum, block) => sum + block.x.length, 0));
        let at = 0;
        for (const block of blocks) {
          all.set(of(block), at);
          at += block.x.length;
        }
        return all;
      };
      const x = joined((block) => block.x);
      const value = joined((block) => block.value);
      let [low, high] = [value, value];
      if (series.isBand) {
        const half = joined((block) => block.half);
        const about = (i) => (track.band_about === "zero" ? 0 : value[i]);
        low = half.map((width, i) => about(i) - width);
        high = half.map((width, i) => about(i) + width);
      }
      const covers = [
        places[0] === 0 ? -Infinity : x[0],
        (places[places.length - 1] + 1) * this.perBlock >= track.samples ? Infinity : x[x.length - 1],
      ];
      return { x, low, high, per: 1, rises: true, last: x[x.length - 1], levels: levelsOf(low, high), covers };
    },
  };

  /** What is known of a series between two values of x: each sample of what is shown at first or where they were read, else groups of them. */
  function samplesIn(series, from, to) {
    const covers = (one) => one && one.covers[0] <= from && one.covers[1] >= to;
    return [series.nearby, series.close].find(covers) ?? series.samples;
  }

  /** The first index whose x is not below the value. */
  function firstFrom(x, value) {
    let [a, b] = [0, x.length];
    while (a < b) {
      const middle = (a + b) >> 1;
      if (x[middle] < value) a = middle + 1;
      else b = middle;
    }
    return a;
  }

  /** The indices of samples between two values of x, and one more on each side. */
  function within(samples, from, to) {
    if (!samples.rises) return [0, samples.x.length];
    return [Math.max(0, firstFrom(samples.x, from) - 1), Math.min(samples.x.length, firstFrom(samples.x, to) + 1)];
  }

  /** The lowest and the highest value between two values of x. */
  function extremes(samples, from, to, isLog) {
    const [start, end] = within(samples, from, to);
    let [low, high] = [Infinity, -Infinity];
    const size = Math.max(1, end - start);
    let level = 0;
    while (samples.rises && level + 1 < samples.levels.length && samples.levels[level + 1].size * 64 < size) level++;
    const of = samples.levels[isLog ? 0 : level];
    for (let i = Math.floor(start / of.size); i < Math.ceil(end / of.size); i++) {
      if (of.low[i] < low && (!isLog || of.low[i] > 0)) low = of.low[i];
      if (of.high[i] > high) high = of.high[i];
    }
    return [low, high];
  }

  // ---- Text ----------------------------------------------------------------------------------------------------------

  const minus = (text) => text.replace(/-/g, "\u2212");

  function decimals(step) {
    return Math.max(0, Math.min(12, Math.ceil(-Math.log10(step) - 1e-9)));
  }

  /** A value of an axis with its unit, to a thousandth part of what is in sight. */
  function quantity(axis, value, span) {
    if (!Number.isFinite(value)) return "\u2013";
    const shown = value / 10 ** axis.exponent;
    const visible = axis.log ? Math.abs(shown) : span / 10 ** axis.exponent;
    const digits = visible > 0 ? decimals(10 ** Math.floor(Math.log10(visible) - 3)) : 3;
    const text = Math.abs(shown) >= 1e7 || (digits >= 9 && shown !== 0) ? shown.toExponential(4) : shown.toFixed(digits);
    return `${minus(text)}${axis.unit ? "\u00a0" + axis.unit : ""}`;
  }

  const superscript = (exponent) => [...String(exponent)].map((c) => "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[c] ?? "\u207b").join("");

  /** Where a logarithmic axis has lines: 1 to 9 times the powers of ten in sight; over less than a decade steps as on a linear one. */
  function logSplits(plot, place, min, max) {
    const splits = [];
    if (max < 10 * min) {
      const step = steps.find((step) => step * 8 > max - min);
      for (let k = Math.ceil(min / step); k * step <= max; k++) splits.push(+(k * step).toPrecision(12));
      return splits;
    }
    for (let exponent = Math.floor(Math.log10(min)); 10 ** exponent <= max; exponent++) {
      for (let k = 1; k < 10; k++) {
        const value = +`${k}e${exponent}`;
        if (value >= min && value <= max) splits.push(value);
      }
    }
    return splits;
  }

  function ticks(axis) {
    return (plot, splits, place, space, step) =>
      splits.map((value) => {
        if (value === null) return "";
        if (axis.log) {
          const [first, last] = [splits[0], splits[splits.length - 1]];
          if (last < 10 * first) return minus(String(value));
          const exponent = Math.floor(Math.log10(value) + 1e-9);
          const digit = Math.round(value / 10 ** exponent);
          const decades = Math.log10(last / first);
          const room = (place === 0 ? plot.bbox.width / 70 : plot.bbox.height / 26) / (devicePixelRatio || 1);
          const isNamed = digit === 1 ? exponent % Math.ceil(decades / room) === 0 : decades < 2 && (digit === 2 || digit === 5);
          if (!isNamed) return "";
          if (Math.abs(exponent) <= 3) return String(+value.toPrecision(3));
          return (digit === 1 ? "" : `${digit}\u00b7`) + "10" + superscript(exponent);
        }
        return minus((value / 10 ** axis.exponent).toFixed(decimals(step / 10 ** axis.exponent)));
      });
  }

  /** A vertical axis with names at 0, -1, -2 ...; on a narrow page names are cut to what fits beside the plot, but not what they say behind a colon. */
  function named(names, width) {
    const perCharacter = 6.6;
    const longest = Math.max(...names.map((name) => name.length));
    const size = Math.ceil(Math.min(20 + perCharacter * longest, 0.45 * width));
    const fits = Math.floor((size - 20) / perCharacter);
    const cut = (name) => {
      const [value] = name.match(/: [^:]*$/) ?? [""];
      return name.length > fits ? `${name.slice(0, Math.max(1, fits - 1 - value.length))}\u2026${value}` : name;
    };
    const places = names.map((_, place) => place + 1 - names.length);
    return { size, splits: () => places, filter: (plot, splits) => splits, values: (plot, splits) => splits.map((at) => cut(names[Math.round(-at)] ?? "")) };
  }

  /** Steps of ticks: 1, 2 and 5 times a power of ten. */
  const steps = Array.from({ length: 3 * 60 }, (_, i) => +`${[1, 2, 5][i % 3]}e${Math.floor(i / 3) - 35}`);

  const logarithmic = { splits: logSplits, filter: (plot, splits) => splits };

  // ---- Colours -------------------------------------------------------------------------------------------------------

  const dark = matchMedia("(prefers-color-scheme: dark)");
  /** What is too dark to be seen on a dark page. */
  const onDark = { "#000000": "#e4e4e4", "#0072b2": "#4aa8e8", "#d55e00": "#ff8a3d", "#009e73": "#2fc79b", "#999999": "#8a8f98" };
  const colourOf = (series) => (dark.matches && onDark[series.colour]) || series.colour;
  const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  // ---- Drawing -------------------------------------------------------------------------------------------------------

  /** One panel's series, on the canvas of its plot. */
  function draw(plot, panel) {
    const context = plot.ctx;
    const { left, top, width, height } = plot.bbox;
    const ratio = devicePixelRatio || 1;
    context.save();
    context.beginPath();
    context.rect(left, top, width, height);
    context.clip();
    const toX = (value) => plot.valToPos(value, "x", true);
    // Far outside of the panel is outside: a canvas cannot hold any number.
    const toY = (value) => Math.max(top - 4 * height, Math.min(top + 5 * height, value > 0 || !panel.y.log ? plot.valToPos(value, "y", true) : top + 5 * height));
    for (const series of panel.series) {
      if (series.hidden) continue;
      context.strokeStyle = context.fillStyle = colourOf(series);
      context.globalAlpha = 1;
      context.lineWidth = (series.faint ? 2.6 : 1.3) * ratio;
      context.setLineDash(series.dashed ? [6 * ratio, 4 * ratio] : []);
      context.lineJoin = "round";
      if (series.kind === "level") {
        context.beginPath();
        context.moveTo(left, toY(series.level));
        context.lineTo(left + width, toY(series.level));
        context.stroke();
      } else if (series.samples) {
        drawSamples(context, plot, series, toX, toY, ratio);
      }
      write(context, plot, series, toX, toY, ratio);
    }
    context.restore();
  }

  /** The texts next to points: away from the nearer side, in turns above and below. */
  function write(context, plot, series, toX, toY, ratio) {
    context.globalAlpha = 1;
    context.fillStyle = variable("--ink");
    context.font = `${12 * ratio}px system-ui, 'DejaVu Sans', sans-serif`;
    series.written.forEach(([atX, atY, text], turn) => {
      const x = toX(atX);
      const isLeft = x < plot.bbox.left + 0.6 * plot.bbox.width;
      context.textAlign = isLeft ? "left" : "right";
      context.fillText(text, x + (isLeft ? 6 : -6) * ratio, toY(atY) + (turn % 2 ? 16 : -6) * ratio);
    });
  }

  function drawSamples(context, plot, series, toX, toY, ratio) {
    const { min, max } = plot.scales.x;
    const samples = samplesIn(series, min, max);
    const [start, end] = within(samples, min, max);
    const isSingle = samples.per === 1;
    const room = plot.bbox.width / ratio;
    if (isSingle && (!samples.rises || end - start <= 2 * room)) {
      if (series.kind === "band") return fillBetween(context, samples, start, end, toX, toY);
      if (series.kind === "line") strokeLine(context, samples, start, end, toX, toY);
      if (series.kind === "crosses") return strokeCrosses(context, samples, start, end, toX, toY, ratio);
      const few = end - start <= room / 7;
      if (series.kind === "points" || few) {
        const radius = ratio * (series.kind === "points" ? (end - start < 400 ? 2.4 : 1.5) : 1.8);
        context.beginPath();
        for (let i = start; i < end; i++) {
          if (samples.low[i] !== samples.low[i]) continue;
          const [x, y] = [toX(samples.x[i]), toY(samples.low[i])];
          context.moveTo(x + radius, y);
          context.arc(x, y, radius, 0, 2 * Math.PI);
        }
        context.fill();
      }
      return;
    }
    if (series.kind === "band") context.globalAlpha = 0.25;
    context.lineWidth = ratio;
    context.setLineDash([]);
    fillExtremes(context, series, samples, start, end, toX, toY, ratio);
  }

  function strokeCrosses(context, samples, start, end, toX, toY, ratio) {
    const arm = 4.5 * ratio;
    context.beginPath();
    for (let i = start; i < end; i++) {
      if (samples.low[i] !== samples.low[i]) continue;
      const [x, y] = [toX(samples.x[i]), toY(samples.low[i])];
      for (const side of [-1, 1]) {
        context.moveTo(x - arm, y - side * arm);
        context.lineTo(x + arm, y + side * arm);
      }
    }
    context.stroke();
  }

  function strokeLine(context, samples, start, end, toX, toY) {
    let isOpen = false;
    context.beginPath();
    for (let i = start; i < end; i++) {
      const y = samples.low[i];
      if (y !== y) {
        isOpen = false;
        continue;
      }
      if (isOpen) context.lineTo(toX(samples.x[i]), toY(y));
      else context.moveTo(toX(samples.x[i]), toY(y));
      isOpen = true;
    }
    context.stroke();
  }

  function fillBetween(context, samples, start, end, toX, toY) {
    context.globalAlpha = 0.25;
    for (let i = start; i < end; ) {
      while (i < end && samples.low[i] !== samples.low[i]) i++;
      const first = i;
      context.beginPath();
      for (; i < end && samples.low[i] === samples.low[i]; i++) context.lineTo(toX(samples.x[i]), toY(samples.high[i]));
      for (let k = i - 1; k >= first; k--) context.lineTo(toX(samples.x[k]), toY(samples.low[k]));
      context.closePath();
      context.fill();
    }
  }

  /** Where many samples share a pixel: from the lowest to the highest of each column, filled, and never a line of extremes. */
  function fillExtremes(context, series, samples, start, end, toX, toY, ratio) {
    const columns = Math.max(1, Math.round(Math.abs(toX(samples.x[end - 1]) - toX(samples.x[start])) / ratio));
    let level = 0;
    while (level + 1 < samples.levels.length && samples.levels[level + 1].size * 4 * columns < end - start) level++;
    const of = samples.levels[level];
    const runs = [];
    let run = null;
    let column = null;
    for (let i = Math.floor(start / of.size); i * of.size < end; i++) {
      const from = i * of.size;
      const to = Math.min(samples.x.length, from + of.size);
      const begin = Math.floor(toX(samples.x[from]));
      if (of.low[i] !== of.low[i]) {
        // A gap that no pixel can show is none.
        if (column && toX(samples.x[to] ?? samples.last) - column.end >= ratio) column = run = null;
        continue;
      }
      // A group reaches to the next one; a sample is where it is.
      const stop = samples.per === 1 && of.size === 1 ? begin : Math.max(begin + ratio, Math.ceil(toX(samples.x[to] ?? samples.last)));
      if (column && begin < column.begin + ratio) {
        column.low = Math.min(column.low, of.low[i]);
        column.high = Math.max(column.high, of.high[i]);
        column.end = Math.max(column.end, stop);
        continue;
      }
      column = { begin, end: stop, low: of.low[i], high: of.high[i] };
      if (!run) runs.push((run = []));
      run.push(column);
    }
    for (const columns of runs) {
      context.beginPath();
      // Neighbouring columns overlap in height, as the line that they stand for has no jump.
      let before = null;
      const edges = columns.map((column) => {
        let [low, high] = [toY(column.low), toY(column.high)];
        if (series.kind === "line" && before && before.end >= column.begin - ratio) {
          if (high > before.low) high = before.low;
          if (low < before.high) low = before.high;
        }
        before = { low, high, end: column.end };
        return { begin: column.begin, end: column.end, low, high };
      });
      if (series.kind === "points") {
        for (const edge of edges) context.rect(edge.begin, edge.high, Math.max(ratio, edge.end - edge.begin), edge.low - edge.high);
      } else {
        for (const edge of edges) {
          context.lineTo(edge.begin, edge.high);
          context.lineTo(edge.end, edge.high);
        }
        for (const edge of edges.reverse()) {
          context.lineTo(edge.end, edge.low);
          context.lineTo(edge.begin, edge.low);
        }
        context.closePath();
      }
      context.fill();
      // What is as low as it is high can be seen by its edge.
      if (series.kind === "line") context.stroke();
    }
  }

  // ---- Views ---------------------------------------------------------------------------------------------------------

  /** Panels with one x axis: they are looked into together. */
  const links = new Map();

  class Link {
    constructor() {
      this.panels = [];
      /** Pictures of all of it that mark what is in sight. */
      this.strips = [];
      /** What is in sight, where that is not what each panel shows at first. */
      this.view = null;
    }

    /** From the first sample to the last of all its panels. */
    whole() {
      return this.panels.reduce(([from, to], panel) => [Math.min(from, panel.whole[0]), Math.max(to, panel.whole[1])], [Infinity, -Infinity]);
    }

    /** Shows this part of the axis in every panel. */
    show(from, to) {
      const [first, last] = this.whole();
      const isLog = this.panels[0].x.log;
      const narrowest = Math.min(...this.panels.map((panel) => (samplesFile.read ? panel.finest : panel.closest))) * 4;
      if (!(to - from >= narrowest) && !isLog) {
        const middle = (from + to) / 2;
        [from, to] = [middle - narrowest / 2, middle + narrowest / 2];
      }
      if (isLog) {
        [from, to] = [Math.max(from, first), Math.min(to, last)];
        if (!(from < to)) return;
      } else {
        if (to - from > last - first) [from, to] = [first, last];
        else if (from < first) [from, to] = [first, first + to - from];
        else if (to > last) [from, to] = [last - (to - from), last];
      }
      this.view = [from, to];
      for (const panel of this.panels) panel.show(from, to);
      for (const strip of this.strips) strip.draw();
    }

    /** What was shown at first, each panel its own. */
    reset() {
      this.view = null;
      for (const panel of this.panels) panel.show(panel.x.from, panel.x.to);
      for (const strip of this.strips) strip.draw();
    }

    /** Makes what is in sight so many times as wide, about a place. */
    zoom(panel, times, about) {
      const { min, max } = panel.plot.scales.x;
      if (panel.x.log) {
        const at = about ?? Math.sqrt(min * max);
        return this.show(at * (min / at) ** times, at * (max / at) ** times);
      }
      const at = about ?? (min + max) / 2;
      this.show(at - (at - min) * times, at + (max - at) * times);
    }

    /** Moves on by a share of what is in sight. */
    pan(panel, share) {
      const { min, max } = panel.plot.scales.x;
      if (panel.x.log) {
        const factor = (max / min) ** share;
        return this.show(min * factor, max * factor);
      }
      this.show(min + share * (max - min), max + share * (max - min));
    }
  }

  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else made.setAttribute(key, value);
    }
    made.append(...children);
    return made;
  }

  function link(key) {
    if (!links.has(key)) links.set(key, new Link());
    return links.get(key);
  }

  /** Goes to the part of the page that a point leads to, as a link does. */
  function follow([, , anchor]) {
    element("a", { href: `#${anchor}` }).click();
    document.getElementById(anchor)?.closest(".scroll")?.focus({ preventScroll: true });
  }

  /** The panel in which a drag began. */
  let dragged = null;

  /** What a panel is on the page, and what it shows. */
  class Panel {
    constructor(known, isLowest, count) {
      Object.assign(this, known);
      this.link = link(known.link);
      this.key = known.link;
      this.isLowest = isLowest;
      this.height = this.isIsotropic ? 420 : count === 1 ? 320 : count === 2 ? 220 : 180;
    }

    /** Reads the samples, and from where to where they go. */
    async load() {
      await Promise.all(this.series.filter((s) => s.data).map(async (s) => (s.samples = await samplesOf(s.data))));
      const near = this.series.filter((s) => s.near);
      await Promise.all(near.map(async (s) => (s.nearby = { ...(await samplesOf(s.near)), covers: [this.x.from, this.x.to] })));
      this.whole = [Infinity, -Infinity];
      this.closest = Infinity;
      /** The same where single samples can be read. */
      this.finest = Infinity;
      for (const { samples, track } of this.series.filter((s) => s.samples)) {
        const { x } = samples;
        let [first, last] = [x[0], samples.last];
        if (!samples.rises) for (const value of x) [first, last] = [Math.min(first, value), Math.max(last, value)];
        if (x.length > 2 && samples.rises) {
          const spacing = (x[x.length - 1] - x[0]) / (x.length - 1);
          this.closest = Math.min(this.closest, spacing);
          this.finest = Math.min(this.finest, track ? spacing / samples.per : spacing);
        }
        this.whole = [Math.min(this.whole[0], first), Math.max(this.whole[1], last)];
      }
      // Points at the ends are in sight whole.
      if (this.x.from < this.whole[0] && !this.x.fixed) this.whole = [this.x.from, Math.max(this.x.to, this.whole[1])];
      if (!Number.isFinite(this.closest)) this.closest = this.finest = (this.whole[1] - this.whole[0]) / 100;
    }

    /** The range of y for what is in sight. */
    range(from, to) {
      const isStart = from === this.x.from && to === this.x.to;
      if (isStart && !this.series.some((s) => s.hidden)) return [this.y.from, this.y.to];
      let [low, high] = [Infinity, -Infinity];
      for (const series of this.series) {
        if (series.hidden) continue;
        if (series.kind === "level") [low, high] = [Math.min(low, series.level), Math.max(high, series.level)];
        if (!series.samples) continue;
        const [a, b] = extremes(samplesIn(series, from, to), from, to, this.y.log);
        [low, high] = [Math.min(low, a), Math.max(high, b)];
      }
      if (!(low <= high)) return [this.y.from, this.y.to];
      if (this.y.log) {
        const factor = (high / low) ** 0.06 || 1;
        return low === high ? [low / 2, high * 2] : [low / factor, high * factor];
      }
      const room = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
      return [low - room, high + room];
    }

    /** Both ranges with as much more of one that a unit of x is as long as one of y. */
    isotropic([from, to], [low, high]) {
      const { width, height } = this.plot.bbox;
      const perPixel = Math.max((to - from) / width, (high - low) / height);
      const around = (start, end, size) => [(start + end - perPixel * size) / 2, (start + end + perPixel * size) / 2];
      return [around(from, to, width), around(low, high, height)];
    }

    show(from, to) {
      let [low, high] = this.range(from, to);
      // A part of a circle would leave no room for what is above and below it.
      const isWhole = from <= this.x.from && to >= this.x.to;
      if (this.isIsotropic && isWhole) [[from, to], [low, high]] = this.isotropic([from, to], [low, high]);
      this.plot.batch(() => {
        this.plot.setScale("x", { min: from, max: to });
        this.plot.setScale("y", { min: low, max: high });
      });
      this.lookClosely(from, to);
    }

    /** Reads single samples where few enough are in sight, and draws once more when they are there. */
    async lookClosely(from, to) {
      if (!samplesFile.read) return;
      const wanted = this.series.filter((s) => s.track && s.samples && !s.hidden && samplesIn(s, from, to) === s.samples);
      try {
        const read = await Promise.all(wanted.map((series) => samplesFile.samplesOf(series, from, to)));
        wanted.forEach((series, i) => (series.close = read[i] ?? series.close));
        const { min, max } = this.plot.scales.x;
        const isNew = (one) => one && one.covers[0] <= min && one.covers[1] >= max;
        if (read.some(isNew)) this.show(min, max);
      } catch (error) {
        sayOfFile(`Single samples cannot be read: ${error.message}.`);
      }
    }

    /** Says what lies under the cursor. */
    tell(at) {
      const { min, max } = this.plot.scales.x;
      const span = this.plot.scales.y.max - this.plot.scales.y.min;
      this.position.textContent = at === null ? "" : `${this.x.title.replace(/ \(.*\)$/, "")}\u00a0=\u00a0${quantity(this.x, at, max - min)}`;
      for (const series of this.series) {
        if (!series.output) continue;
        series.output.textContent = at === null ? "" : this.valueText(series, at, span);
      }
    }

    valueText(series, at, span) {
      if (this.y.names) return "";
      if (series.kind === "level") return quantity(this.y, series.level, span);
      if (!series.samples) return "\u2013";
      const { min, max } = this.plot.scales.x;
      const samples = samplesIn(series, min, max);
      const place = this.nearest(samples, at);
      if (place === null) return "\u2013";
      const { low, high, per } = samples;
      if (low[place] !== low[place]) return "\u2013";
      const first = quantity(this.y, low[place], span);
      if (series.kind !== "band" && per === 1) return first;
      const second = quantity(this.y, high[place], span);
      return first === second ? first : `${first} \u2026 ${second}`;
    }

    /** The index of the sample next to a value of x. */
    nearest(samples, at) {
      const { x, rises, last, per } = samples;
      if (!rises) {
        let best = 0;
        for (let i = 1; i < x.length; i++) if (Math.abs(x[i] - at) < Math.abs(x[best] - at)) best = i;
        return best;
      }
      if (per > 1) return at < x[0] || at > last ? null : Math.max(0, firstFrom(x, at * (1 + 1e-12)) - 1);
      const after = firstFrom(x, at);
      const place = after > 0 && (after === x.length || at - x[after - 1] < x[after] - at) ? after - 1 : after;
      // Where a series has none the next sample of it is no value of this place.
      const { min, max } = this.plot.scales.x;
      const step = (x[x.length - 1] - x[0]) / Math.max(1, x.length - 1);
      return Math.abs(x[place] - at) > Math.max((max - min) / 20, step) ? null : place;
    }

    /** Puts the plot and its legend on the page. */
    place(into, say) {
      this.position = element("output", { class: "position" });
      // A band without a name belongs to the line of its colour.
      const isNamed = (series) => series.label || this.series.length === 1;
      const buttons = this.series.filter(isNamed).map((series) => {
        series.output = element("output");
        const swatch = element("i", { class: series.kind, style: `background:${colourOf(series)}` });
        series.swatch = swatch;
        return element("button", {
          type: "button",
          "aria-pressed": "true",
          onclick: (event) => {
            series.hidden = !series.hidden;
            event.currentTarget.setAttribute("aria-pressed", String(!series.hidden));
            for (const other of this.series) if (!isNamed(other) && other.kind === "band" && other.colour === series.colour) other.hidden = series.hidden;
            const { min, max } = this.plot.scales.x;
            this.show(min, max);
            this.plot.redraw();
          },
        }, swatch, series.label || this.label || "values", series.output);
      });
      const legend = element("div", { class: "legend" }, ...buttons, this.position);
      this.holder = element("div", {
        class: "plot",
        tabindex: "0",
        role: "group",
        "aria-roledescription": "plot",
        "aria-label": `${this.y.title} over ${this.x.title}. Left and right arrow move a cursor, with shift the view; plus and minus zoom, 0 shows the beginning's view, A all.${this.series.some((s) => s.links.length) ? " Enter leads to the run at the cursor." : ""}`,
      });
      into.append(legend, this.holder);
      this.plot = new uPlot(this.options(), [[this.x.from, this.x.to], [null, null]], this.holder);
      if (this.link.view) this.show(...this.link.view);
      else if (this.isIsotropic) this.show(this.x.from, this.x.to);
      this.listen(say);
      new ResizeObserver(() => {
        const width = this.width();
        if (width === this.plot.width) return;
        this.plot.setSize({ width, height: this.outer() });
        const { min, max } = this.plot.scales.x;
        if (this.isIsotropic) this.show(min, max);
      }).observe(this.holder);
    }

    width() {
      return Math.max(220, Math.floor(this.holder.clientWidth || 600));
    }

    isNarrow() {
      return this.width() < 560;
    }

    outer() {
      const mostNarrow = this.isIsotropic ? 300 : 200;
      return (this.isNarrow() ? Math.min(this.height, mostNarrow) : this.height) + (this.isLowest ? 50 : 12);
    }

    options() {
      const ink = () => variable("--ink");
      const grid = { stroke: () => variable("--grid"), width: 1 };
      const tick = { ...grid, size: 5 };
      const font = "12px system-ui, 'DejaVu Sans', sans-serif";
      return {
        width: this.width(),
        height: this.outer(),
        padding: [8, 14, 0, 0],
        legend: { show: false },
        scales: {
          x: { time: false, auto: false, distr: this.x.log ? 3 : 1, range: (plot, min, max) => [min, max], min: this.x.from, max: this.x.to },
          y: { auto: false, distr: this.y.log ? 3 : 1, range: (plot, min, max) => [min, max], min: this.y.from, max: this.y.to },
        },
        axes: [
          { scale: "x", stroke: ink, grid, ticks: tick, font, labelFont: font, labelSize: 18, size: this.isLowest ? 32 : 6, label: this.isLowest ? this.x.title : undefined, values: this.isLowest ? ticks(this.x) : () => [], space: 70, ...(this.x.log ? logarithmic : { incrs: steps }) },
          { scale: "y", stroke: ink, grid, ticks: tick, font, labelFont: font, labelSize: 18, size: 56, label: this.y.title, values: ticks(this.y), space: 26, ...(this.y.log ? logarithmic : { incrs: steps }), ...(this.y.names ? named(this.y.names, this.width()) : {}) },
        ],
        series: [{}, { scale: "y", stroke: "transparent", points: { show: false } }],
        cursor: {
          points: { show: false },
          y: false,
          drag: { x: true, y: false, setScale: false },
          sync: { key: this.key, scales: ["x", null], setSeries: false },
          bind: {
            dblclick: () => () => {
              this.link.reset();
              return null;
            },
          },
        },
        hooks: {
          draw: [(plot) => draw(plot, this)],
          setCursor: [(plot) => this.tell(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null)],
          setSelect: [
            (plot) => {
              const { left, width } = plot.select;
              if (width === 0) return;
              const ends = [plot.posToVal(left, "x"), plot.posToVal(left + width, "x")];
              plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
              // The plots beside it mark the same, and are not asked.
              if (width >= 4 && dragged === this) this.link.show(...ends);
            },
          ],
        },
      };
    }

    listen(say) {
      const over = this.plot.over;
      // A wheel that turns the page must not be caught on its way.
      over.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.shiftKey && document.activeElement !== this.holder) return;
        event.preventDefault();
        const about = this.plot.posToVal(event.offsetX, "x");
        this.link.zoom(this, 1.25 ** Math.sign(event.deltaY || event.deltaX), about);
      }, { passive: false });
      over.addEventListener("mousedown", () => {
        dragged = this;
        this.holder.focus({ preventScroll: true });
      });
      this.touches(over);
      if (this.series.some((s) => s.links.length)) this.leadOn(over);
      this.holder.addEventListener("keydown", (event) => this.pressed(event, say));
    }

    /** A click near a point that leads to another part of the page goes there; one that ends a drag does not. */
    leadOn(over) {
      const reach = matchMedia("(pointer: coarse)").matches ? 24 : 12;
      let pressed = null;
      const near = (event) => {
        const { left, top } = over.getBoundingClientRect();
        return this.linkAt(event.clientX - left, event.clientY - top, reach);
      };
      over.addEventListener("pointerdown", (event) => (pressed = [event.clientX, event.clientY]));
      over.addEventListener("pointermove", (event) => {
        const link = near(event);
        over.style.cursor = link ? "pointer" : "";
        over.title = link ? link[3] : "";
      });
      over.addEventListener("click", (event) => {
        const [x, y] = pressed ?? [event.clientX, event.clientY];
        const link = Math.hypot(event.clientX - x, event.clientY - y) < 4 && near(event);
        if (link) follow(link);
      });
    }

    /** What leads on from within so many pixels of a place of the plot, or of its column where no height is given. */
    linkAt(left, top, reach) {
      let [best, distance] = [null, reach];
      for (const series of this.series) {
        if (series.hidden) continue;
        for (const link of series.links) {
          const away = Math.hypot(this.plot.valToPos(link[0], "x") - left, top === null ? 0 : this.plot.valToPos(link[1], "y") - top);
          if (away <= distance) [best, distance] = [link, away];
        }
      }
      return best;
    }

    /** One finger moves along the axis, two zoom, a second tap shows the beginning's view. */
    touches(over) {
      const fingers = new Map();
      let tapped = 0;
      const at = (event) => this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
      over.addEventListener("pointerdown", (event) => {
        if (event.pointerType !== "touch") return;
        fingers.set(event.pointerId, { value: at(event), x: event.clientX });
        over.setPointerCapture(event.pointerId);
        if (event.timeStamp - tapped < 300 && fingers.size === 1) this.link.reset();
        tapped = event.timeStamp;
        this.plot.setCursor({ left: event.clientX - over.getBoundingClientRect().left, top: 10 });
      });
      over.addEventListener("pointermove", (event) => {
        const finger = fingers.get(event.pointerId);
        if (!finger) return;
        finger.x = event.clientX;
        const { left, width } = over.getBoundingClientRect();
        const { min, max } = this.plot.scales.x;
        const [first, second] = [...fingers.values()];
        const share = (one) => (one.x - left) / width;
        if (!second) {
          if (!this.x.log) this.link.show(min + first.value - at(event), max + first.value - at(event));
        } else if (!this.x.log && Math.abs(share(first) - share(second)) > 0.02) {
          // The values under both fingers stay under them.
          const scale = (second.value - first.value) / (share(second) - share(first));
          if (scale > 0) this.link.show(first.value - share(first) * scale, first.value + (1 - share(first)) * scale);
        }
      });
      for (const end of ["pointerup", "pointercancel"]) over.addEventListener(end, (event) => fingers.delete(event.pointerId));
    }

    pressed(event, say) {
      const { min, max } = this.plot.scales.x;
      const move = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (move && event.shiftKey) this.link.pan(this, 0.25 * move);
      else if (move) this.step(move, say);
      else if (event.key === "+" || event.key === "=") this.link.zoom(this, 0.5, this.cursor(min, max));
      else if (event.key === "-") this.link.zoom(this, 2, this.cursor(min, max));
      else if (event.key === "0" || event.key === "Escape") this.link.reset();
      else if (event.key === "a" || event.key === "A") this.link.show(...this.link.whole());
      else if (event.key === "Enter" && this.cursor(min, max) !== undefined) {
        const link = this.linkAt(this.plot.valToPos(this.at, "x"), null, 24);
        if (link) follow(link);
      }
      else return;
      event.preventDefault();
    }

    /** Where the cursor is, where it is in sight. */
    cursor(min, max) {
      return this.at !== undefined && this.at >= min && this.at <= max ? this.at : undefined;
    }

    /** To the next sample of the first series that has some, or by a pixel where there are more of them. */
    step(move, say) {
      const { min, max } = this.plot.scales.x;
      const series = this.series.find((s) => s.samples && s.samples.rises && !s.hidden);
      let at = this.cursor(min, max) ?? (min + max) / 2;
      const pixel = (max - min) / (this.plot.bbox.width / (devicePixelRatio || 1));
      if (series) {
        const { x } = samplesIn(series, min, max);
        const place = Math.max(0, Math.min(x.length - 1, firstFrom(x, at - 1e-9 * (max - min)) + move));
        at = Math.abs(x[place] - at) < pixel ? at + 4 * move * pixel : x[place];
      } else at += 4 * move * pixel;
      this.at = Math.max(min, Math.min(max, at));
      this.plot.setCursor({ left: this.plot.valToPos(this.at, "x"), top: 10 });
      this.tell(this.at);
      say([this.position.textContent, ...this.series.filter((s) => s.output && !s.hidden).map((s) => `${s.label || this.label}: ${s.output.textContent}`)].join("; "));
    }
  }

  // ---- The whole record ----------------------------------------------------------------------------------------------

  const STRIP = 56;

  /** All of a panel's main series in a strip below the panels, with what is in sight marked; a click or a drag shows another part. */
  class Strip {
    /** The series of a panel that a strip shows, if its axis goes on far beyond what is shown at first. */
    static seriesOf(panel) {
      const lines = panel.series.filter((s) => s.samples?.rises && s.kind === "line");
      const isLong = panel.whole[1] - panel.whole[0] > 3 * (panel.x.to - panel.x.from);
      return isLong && !panel.x.log ? (lines.find((s) => !s.faint) ?? lines[0]) : undefined;
    }

    constructor(panel, series) {
      Object.assign(this, { panel, series });
      this.canvas = element("canvas", { class: "strip", role: "img", "aria-label": `${panel.y.title} over the whole record, with what is in sight marked` });
      const go = (event) => event.buttons && this.go(event.offsetX);
      this.canvas.addEventListener("pointerdown", go);
      this.canvas.addEventListener("pointermove", go);
      new ResizeObserver(() => this.draw()).observe(this.canvas);
    }

    /** Shows as much as before about this place. */
    go(left) {
      const [first, last] = this.panel.link.whole();
      const { min, max } = this.panel.plot.scales.x;
      const at = first + (left / this.canvas.clientWidth) * (last - first);
      this.panel.link.show(at - (max - min) / 2, at + (max - min) / 2);
    }

    draw() {
      const ratio = devicePixelRatio || 1;
      const [width, height] = [Math.round(this.canvas.clientWidth * ratio), STRIP * ratio];
      if (width === 0) return;
      Object.assign(this.canvas, { width, height });
      const context = this.canvas.getContext("2d");
      const [first, last] = this.panel.link.whole();
      const samples = this.series.samples;
      const [low, high] = extremes(samples, first, last, this.panel.y.log);
      const inLog = (value) => (this.panel.y.log ? Math.log10(Math.max(value, low)) : value);
      const toX = (value) => ((value - first) / (last - first)) * width;
      const toY = (value) => (1 - (inLog(value) - inLog(low)) / (inLog(high) - inLog(low) || 1)) * (height - 4 * ratio) + 2 * ratio;
      context.fillStyle = context.strokeStyle = variable("--faint");
      context.globalAlpha = 0.45;
      context.lineWidth = ratio;
      fillExtremes(context, this.series, samples, 0, samples.x.length, toX, toY, ratio);
      const { min, max } = this.panel.plot.scales.x;
      // However short it is, it is seen.
      const narrow = Math.max(0, 6 * ratio - (toX(max) - toX(min))) / 2;
      const [left, right] = [toX(min) - narrow, toX(max) + narrow];
      context.fillStyle = context.strokeStyle = variable("--note");
      context.globalAlpha = 0.35;
      context.fillRect(left, 0, right - left, height);
      context.globalAlpha = 1;
      context.strokeRect(left + ratio / 2, ratio / 2, Math.max(ratio, right - left - ratio), height - ratio);
    }
  }

  // ---- Figures -------------------------------------------------------------------------------------------------------

  const shown = [];

  /** Says what is known of the file of single samples, wherever that is said. */
  function sayOfFile(text) {
    for (const one of document.querySelectorAll(".samples output")) one.textContent = text;
  }

  /** Shows single samples from now on, by what reads pieces of the file. */
  async function lookInto(read, size) {
    try {
      await samplesFile.take(read, size);
    } catch (error) {
      // Where no server gives pieces of it, the reader can.
      for (const label of document.querySelectorAll(".samples label")) label.hidden = false;
      return sayOfFile(`${samplesFile.known.file} cannot be used: ${error.message}.`);
    }
    sayOfFile(`Zooming in shows single samples, from ${samplesFile.known.file}.`);
    for (const { panels } of shown) for (const panel of panels) panel.lookClosely(panel.plot.scales.x.min, panel.plot.scales.x.max);
  }

  const pick = (file) => file && lookInto((from, to) => file.slice(from, to).arrayBuffer(), file.size);

  /** A served page fetches pieces of the file by itself. */
  async function fetchPieces() {
    const address = new URL(samplesFile.known.file, location.href);
    const read = async (from, to) => {
      const answer = await fetch(address, { headers: { Range: `bytes=${from}-${to - 1}` } });
      if (answer.status !== 206) {
        answer.body?.cancel();
        throw new Error(`the server answers ${answer.status} where a piece is asked for`);
      }
      return answer.arrayBuffer();
    };
    await lookInto(read, samplesFile.known.bytes);
  }

  /** Where a reader gives the page its file of single samples. */
  function filePicker(panels) {
    const per = Math.max(...panels.flatMap((panel) => panel.series.filter((s) => s.track).map((s) => s.samples.per)));
    const input = element("input", { type: "file", accept: ".bin", onchange: () => pick(input.files[0]) });
    const label = element("label", {}, `Single samples are in ${samplesFile.known.file}, beside this page: `, input);
    label.hidden = /^http/.test(location.protocol);
    const said = element("output", {}, samplesFile.read ? `Zooming in shows single samples, from ${samplesFile.known.file}.` : "");
    return element("div", { class: "samples" }, `Drawn from groups of ${per} samples. `, label, said);
  }

  async function build(figure, holder) {
    const panels = figure.panels.map((known, i) => {
      const below = figure.panels[i + 1];
      return new Panel(known, !below || below.link !== known.link, figure.panels.length);
    });
    await Promise.all(panels.map((panel) => panel.load()));
    const live = element("p", { class: "unseen", "aria-live": "polite" });
    const say = (text) => (live.textContent = text);
    const first = panels[0];
    const button = (text, label, act) => element("button", { type: "button", "aria-label": label, title: label, onclick: act }, text);
    const all = () => new Set(panels.map((panel) => panel.link));
    holder.append(element("div", { class: "tools" },
      button("\u2212", "Zoom out", () => all().forEach((one) => one.zoom(one.panels[0].plot ? one.panels[0] : first, 2))),
      button("+", "Zoom in", () => all().forEach((one) => one.zoom(one.panels[0].plot ? one.panels[0] : first, 0.5))),
      button("\u25c2", "Back", () => first.link.pan(first, -0.5)),
      button("\u25b8", "On", () => first.link.pan(first, 0.5)),
      button("All", "Show all", () => all().forEach((one) => one.show(...one.whole()))),
      button("Start", "Start: show what was shown at first", () => all().forEach((one) => one.reset())),
      button("CSV", "Save what is in sight as CSV", () => save(figure, panels)),
      element("span", { class: "hint" }, "Drag to zoom, double-click to go back; after a click the wheel zooms."),
    ), live);
    for (const panel of panels) {
      panel.link.panels.push(panel);
      panel.place(holder, say);
    }
    const long = panels.findLast((panel) => panel.y.title && Strip.seriesOf(panel));
    if (long) {
      const strip = new Strip(long, Strip.seriesOf(long));
      long.link.strips.push(strip);
      holder.append(strip.canvas);
    }
    if (panels.some((panel) => panel.series.some((s) => s.track))) holder.append(filePicker(panels));
    holder.style.minHeight = "";
    shown.push({ number: figure.number, panels });
    holder.dataset.ready = "true";
    document.dispatchEvent(new CustomEvent("figure-ready", { detail: figure.number }));
  }

  /** The samples in sight, series by series. */
  function save(figure, panels) {
    const lines = ["panel,series,x,low,high"];
    const cell = (text) => `"${text.replace(/"/g, '""')}"`;
    for (const panel of panels) {
      const { min, max } = panel.plot.scales.x;
      for (const series of panel.series.filter((s) => s.samples && !s.hidden)) {
        const { x, low, high } = samplesIn(series, min, max);
        const names = `${cell(panel.y.title)},${cell(series.label)}`;
        for (let i = 0; i < x.length; i++) if (x[i] >= min && x[i] <= max) lines.push(`${names},${x[i]},${low[i]},${high[i]}`);
      }
    }
    const address = URL.createObjectURL(new Blob([lines.join("\n") + "\n"], { type: "text/csv" }));
    element("a", { href: address, download: `figure-${figure.number}.csv` }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  }

  document.documentElement.classList.add("scripted");
  for (const picture of document.querySelectorAll("figure .picture")) {
    // A picture without a plot stays.
    if (!picture.parentElement.querySelector(".live")) picture.style.display = "block";
  }
  const numbered = new Map(page.figures.map((figure) => [String(figure.number), figure]));
  const begun = new Set();
  const begin = (holder) => {
    if (begun.has(holder)) return;
    begun.add(holder);
    build(numbered.get(holder.dataset.figure), holder).catch((error) => {
      // The picture says what the plot cannot.
      holder.style.display = "none";
      holder.parentElement.querySelector(".picture").style.display = "block";
      console.error(error);
    });
  };
  if (samplesFile.known) {
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      pick(event.dataTransfer.files[0]);
    });
    if (/^http/.test(location.protocol)) fetchPieces();
  }
  const holders = [...document.querySelectorAll(".live")];
  for (const holder of holders) {
    const figure = numbered.get(holder.dataset.figure);
    const heights = figure.panels.length === 1 ? 320 : figure.panels.length === 2 ? 220 : 180;
    // Room for what comes, so that nothing jumps.
    holder.style.minHeight = `${figure.panels.length * (heights + 45) + 60}px`;
  }
  const watch = new IntersectionObserver((entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => begin(entry.target)), { rootMargin: "800px" });
  holders.forEach((holder) => watch.observe(holder));
  dark.addEventListener("change", () => {
    for (const { panels } of shown) {
      for (const panel of panels) {
        for (const series of panel.series) if (series.swatch) series.swatch.style.background = colourOf(series);
        panel.plot.redraw(false, true);
        panel.link.strips.forEach((strip) => strip.draw());
      }
    }
  });
  // A link to a part unfolds it and shows its tab, and paper has all parts.
  const parts = [...document.querySelectorAll("details.part")];
  const unfold = () => {
    const target = location.hash ? document.getElementById(location.hash.slice(1)) : null;
    const tab = target?.closest(".tab")?.previousElementSibling;
    if (tab) document.getElementById(tab.htmlFor).checked = true;
    parts.filter((part) => target && (target.contains(part) || part.contains(target))).forEach((part) => { part.open = true; });
  };
  addEventListener("hashchange", unfold);
  unfold();
  let folded = [];
  addEventListener("beforeprint", () => {
    folded = parts.filter((part) => !part.open);
    folded.forEach((part) => { part.open = true; });
  });
  addEventListener("afterprint", () => folded.forEach((part) => { part.open = false; }));
  // For those who look into a page by program.
  window.figures = { shown, all: () => holders.forEach(begin) };
})();
