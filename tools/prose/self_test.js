// Whether each pattern of habits.json finds the phrases that it is for, and passes those that it is not for.
"use strict";
const { habits: prose, doc_comments: comments } = require("./habits.json");
const habits = [...prose, { ...comments, matches_case: true }];

const wrong = [];
for (const { find, found, passed, matches_case } of habits) {
    const finds = (phrase) => new RegExp(find, matches_case ? "" : "i").test(phrase);
    found.filter((phrase) => !finds(phrase)).forEach((phrase) => wrong.push(`not found: ${phrase} (${find})`));
    passed.filter(finds).forEach((phrase) => wrong.push(`found and should pass: ${phrase} (${find})`));
}
wrong.forEach((line) => console.error(line));
console.log(`${habits.length} habits`);
process.exit(wrong.length === 0 ? 0 : 1);
