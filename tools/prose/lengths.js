// The mean length of the sentences of pages, in words, and their words: `lengths.js [--table] PAGE …`. The mean over all pages must not exceed
// `mean_sentence` of terms.json. A page of the book must not name a test of the project, but for the report, which names what made each row.
"use strict";
const fs = require("fs");
const path = require("path");
const { mean_sentence } = require("./terms.json");

/** The sentences of a page: those of paragraphs and lists, with code, formulas and links' targets as one word each. */
function sentences(page) {
    const plain = page.replace(/^```[\s\S]*?^```/gm, "").replace(/<!--[\s\S]*?-->/g, "");
    const found = [];
    for (const block of plain.split(/\n\s*\n/)) {
        const lines = block.split("\n").filter((line) => !/^(\||#| {4}|!\[|>)/.test(line));
        for (const item of lines.join("\n").split(/^\s*(?:[-*]|\d+\.)\s+/m)) {
            const text = item.replace(/\n/g, " ").replace(/\$`.*?`\$|`[^`]*`/g, "X").replace(/\]\([^)]*\)/g, "]");
            for (const sentence of text.split(/(?<=[.!?])\s+/)) {
                const words = sentence.split(/\s+/).filter((word) => /[A-Za-z0-9]/.test(word)).length;
                if (words > 0) found.push(words);
            }
        }
    }
    return found;
}

const pages = process.argv.slice(2).filter((argument) => argument !== "--table");
const faults = [];
const all = [];
let total = 0;
for (const page of pages) {
    const text = fs.readFileSync(page, "utf8");
    const words = text.split(/\s+/).filter(Boolean).length;
    const lengths = sentences(text);
    const mean = lengths.reduce((sum, one) => sum + one, 0) / Math.max(lengths.length, 1);
    if (process.argv.includes("--table")) console.log(`${path.basename(page).padEnd(40)} ${String(words).padStart(6)} words, ${mean.toFixed(1).padStart(5)} a sentence`);
    total += words;
    all.push(...lengths);
    if (/\bcargo test\b/.test(text)) faults.push(`${page} names a test: its results go into a file below book/validation, and the page links to the row`);
}
const mean = all.reduce((sum, one) => sum + one, 0) / Math.max(all.length, 1);
console.log(`${total} words, ${mean.toFixed(1)} a sentence`);
if (mean > mean_sentence) faults.push(`sentences have ${mean.toFixed(1)} words on average; at most ${mean_sentence}`);
faults.forEach((fault) => console.error(fault));
process.exit(faults.length === 0 ? 0 : 1);
