// Finds the idioms of terms.json and the habits of habits.json in prose, and sentences that are too long to read once.
"use strict";
const terms = require("../terms.json");
const { habits } = require("../habits.json");
const idioms = [
    ...terms.idioms.map(([pattern, write]) => [new RegExp(pattern, "gi"), write]),
    ...habits.map(({ find, write, matches_case }) => [new RegExp(find, matches_case ? "g" : "gi"), write]),
];

/** A text with code, quotations, links' targets and formulas blanked out, each character in its place. */
function prose(source) {
    const blank = (found) => found.replace(/[^\n]/g, " ");
    return source
        .replace(/\\\\\[[\s\S]*?\\\\\]/g, blank)
        .replace(/\\\\\([\s\S]*?\\\\\)/g, blank)
        .replace(/\$`[\s\S]*?`\$/g, blank)
        .replace(/`[^`]*`/g, blank)
        .replace(/"[^"]*"/g, blank)
        .replace(/\]\([^)]*\)/g, blank)
        .replace(/\{\{[^}]*\}\}/g, blank);
}

module.exports = function (context) {
    const { Syntax, RuleError, report, getSource, locator } = context;
    const check = (node) => {
        // What is quoted is another's, or the example of a fault.
        if (node.parent.type === Syntax.BlockQuote) return;
        const text = prose(getSource(node));
        // A line break is a space to a reader.
        const flat = text.replace(/\n/g, " ");
        for (const [pattern, write] of idioms) {
            pattern.lastIndex = 0;
            for (let found = pattern.exec(flat); found; found = pattern.exec(flat)) {
                const at = { padding: locator.range([found.index, found.index + found[0].length]) };
                report(node, new RuleError(`"${found[0]}": write ${write}`, at));
            }
        }
        let start = 0;
        for (const sentence of flat.split(/(?<=[.:;!?])\s+/)) {
            const words = sentence.split(/\s+/).filter((word) => /[A-Za-z]/.test(word)).length;
            if (words > terms.longest_sentence) {
                const at = { padding: locator.range([start, start + 1]) };
                report(node, new RuleError(`a sentence of ${words} words; at most ${terms.longest_sentence}`, at));
            }
            start += sentence.length + 1;
        }
    };
    return { [Syntax.Paragraph]: check, [Syntax.Header]: check, [Syntax.TableCell]: check };
};
