// Counts the habits of habits.json in the doc comments of the crates, and the doc comments of a single word. Neither count may exceed its `at_most`, which
// is lowered when comments are rewritten.
"use strict";
const fs = require("fs");
const path = require("path");
const { habits, doc_comments: rules } = require("./habits.json");

/** All Rust files of the crates, without their tests. */
function* sources(folder) {
    for (const entry of fs.readdirSync(folder, { withFileTypes: true })) {
        const at = path.join(folder, entry.name);
        if (entry.isDirectory()) yield* sources(at);
        else if (entry.name.endsWith(".rs")) yield at;
    }
}

/** The doc comments of a file, each with the number of its first line. */
function comments(text) {
    const found = [];
    text.split("\n").forEach((line, place) => {
        const doc = /^\s*\/\/[/!](?!\/)\s?(.*)$/.exec(line);
        if (!doc) return;
        const last = found[found.length - 1];
        if (last && last.end === place) {
            last.text += ` ${doc[1]}`;
            last.end = place + 1;
        } else found.push({ text: doc[1], begin: place + 1, end: place + 1 });
    });
    return found;
}

const root = path.join(__dirname, "../../crates");
const bare = new RegExp(rules.find);
const patterns = habits.map(({ find, matches_case }) => new RegExp(find, matches_case ? "g" : "gi"));
const counts = { bare: 0, habits: 0 };
const show = process.argv.includes("--show");
for (const crate of fs.readdirSync(root)) {
    const folder = path.join(root, crate, "src");
    if (!fs.existsSync(folder)) continue;
    for (const file of sources(folder)) {
        for (const { text, begin } of comments(fs.readFileSync(file, "utf8"))) {
            const prose = text.replace(/`[^`]*`|"[^"]*"/g, " ");
            const found = patterns.flatMap((pattern) => prose.match(pattern) ?? []);
            counts.habits += found.length;
            if (bare.test(text.trim())) counts.bare += 1;
            if (show && (found.length || bare.test(text.trim()))) console.log(`${file}:${begin}: ${found.join(", ") || text}`);
        }
    }
}
const faults = Object.keys(counts).filter((kind) => counts[kind] > rules.at_most[kind]);
console.log(`doc comments: ${counts.bare} of a word, ${counts.habits} habits`);
faults.forEach((kind) => console.error(`doc comments, ${kind}: ${counts[kind]}, at most ${rules.at_most[kind]}; \`node tools/prose/doc_comments.js --show\` lists them: write ${rules.write}`));
process.exit(faults.length === 0 ? 0 : 1);
