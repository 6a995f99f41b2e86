// Renders the formulas of a built book by KaTeX, whose style and fonts are put beside its pages, so that these and their print need no
// network.
"use strict";
const fs = require("fs");
const path = require("path");
const katex = require("katex");

const unescaped = (html) =>
    html.replace(/&lt;/g, "<").replace(/&gt;/g, ">").replace(/&quot;/g, '"').replace(/&#39;|&#x27;/g, "'").replace(/&amp;/g, "&");
const rendered = (formula, displayMode) =>
    katex.renderToString(unescaped(formula), { displayMode, throwOnError: true, output: "html" });

let count = 0;
const folder = process.argv[2];
const style = path.dirname(require.resolve("katex/dist/katex.min.css"));
fs.mkdirSync(path.join(folder, "katex"), { recursive: true });
fs.copyFileSync(path.join(style, "katex.min.css"), path.join(folder, "katex", "katex.min.css"));
fs.cpSync(path.join(style, "fonts"), path.join(folder, "katex", "fonts"), { recursive: true });
for (const name of fs.readdirSync(folder).filter((name) => name.endsWith(".html"))) {
    const file = path.join(folder, name);
    const page = fs.readFileSync(file, "utf8");
    const one = (displayMode) => (_, formula) => {
        count += 1;
        return rendered(formula, displayMode);
    };
    const changed = page
        .replace(/<pre><code class="language-math">([\s\S]*?)<\/code><\/pre>/g, one(true))
        .replace(/\$<code>([\s\S]*?)<\/code>\$/g, one(false))
        .replace(/\\\[([\s\S]*?)\\\]/g, (whole, formula) => (formula.includes("<") ? whole : one(true)(whole, formula)))
        .replace(/\\\(([\s\S]*?)\\\)/g, (whole, formula) => (formula.includes("<") ? whole : one(false)(whole, formula)))
        .replace(/<script async src="[^"]*MathJax[^"]*"><\/script>/g, "")
        .replace("</head>", '<link rel="stylesheet" href="katex/katex.min.css"></head>');
    fs.writeFileSync(file, changed);
}
console.log(`${count} formulas rendered`);
