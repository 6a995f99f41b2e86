// Parses every formula of the Markdown files that are named, as KaTeX takes them, and fails where one is none.
"use strict";
const fs = require("fs");
const katex = require("katex");

let count = 0;
const wrong = [];
for (const file of process.argv.slice(2)) {
    const text = fs.readFileSync(file, "utf8");
    const blocks = [...text.matchAll(/^ *```math\n([\s\S]*?)^ *```/gm)].map((found) => [found[1], true]);
    const outside = text.replace(/^ *```[\s\S]*?^ *```/gm, "");
    const inline = [...outside.matchAll(/\$`([^`]*)`\$/g)].map((found) => [found[1], false]);
    for (const [formula, displayMode] of [...blocks, ...inline]) {
        count += 1;
        try {
            katex.renderToString(formula, { displayMode, throwOnError: true, strict: "error" });
        } catch (error) {
            wrong.push(`${file}: ${error.message}`);
        }
    }
}
wrong.forEach((line) => console.error(line));
console.log(`${count} formulas`);
process.exit(wrong.length === 0 ? 0 : 1);
