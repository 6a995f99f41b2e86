// The text of each page of a PDF that Chromium printed.
import { inflateSync } from "node:zlib";

/** The body of an object, and its stream if it has one. */
function objectsOf(pdf) {
  const objects = new Map();
  for (const [, number, body] of pdf.matchAll(/(?:^|\n)(\d+) 0 obj\s([\s\S]*?)\nendobj/g)) {
    const [, head, stream] = body.match(/^([\s\S]*?)\bstream\r?\n([\s\S]*)\r?\nendstream/) ?? [null, body, null];
    const bytes = stream === null ? null : Buffer.from(stream, "latin1");
    objects.set(number, { head, text: bytes && (head.includes("/FlateDecode") ? inflateSync(bytes) : bytes).toString("latin1") });
  }
  return objects;
}

/** The characters of the glyphs of a font, from its table `ToUnicode`. */
function charactersOf(table) {
  const characters = new Map();
  const text = (code) => String.fromCodePoint(parseInt(code, 16));
  for (const [, lines] of table.matchAll(/beginbfchar([\s\S]*?)endbfchar/g))
    for (const [, glyph, code] of lines.matchAll(/<(\w+)>\s*<(\w{4})\w*>/g)) characters.set(parseInt(glyph, 16), text(code));
  for (const [, lines] of table.matchAll(/beginbfrange([\s\S]*?)endbfrange/g))
    for (const [, first, last, code] of lines.matchAll(/<(\w+)>\s*<(\w+)>\s*<(\w{4})\w*>/g))
      for (let glyph = parseInt(first, 16); glyph <= parseInt(last, 16); glyph += 1)
        characters.set(glyph, String.fromCodePoint(parseInt(code, 16) + glyph - parseInt(first, 16)));
  return characters;
}

/** One text for each page, in the order of the pages, with all glyphs in the order in which they are drawn. */
export function printedPages(bytes) {
  const objects = objectsOf(bytes.toString("latin1"));
  const referred = (head, key) => objects.get(head.match(new RegExp(`/${key} (\\d+) 0 R`))?.[1]);
  const pages = [...objects.values()].filter(({ head }) => /\/Type \/Page\b/.test(head));
  return pages.map((page) => {
    const fonts = new Map();
    for (const [, name, number] of page.head.matchAll(/\/(F\d+) (\d+) 0 R/g)) {
      const table = referred(objects.get(number).head, "ToUnicode");
      fonts.set(name, table ? charactersOf(table.text) : new Map());
    }
    let font = new Map();
    let text = "";
    for (const [, name, glyphs] of referred(page.head, "Contents").text.matchAll(/\/(F\d+) [\d.]+ Tf|<([0-9A-Fa-f]+)>/g)) {
      if (name) font = fonts.get(name) ?? new Map();
      else for (const glyph of glyphs.match(/\w{4}/g) ?? []) text += font.get(parseInt(glyph, 16)) ?? "";
    }
    return text;
  });
}
