// Formulas are written so that plain Markdown viewers show them too: $`x`$ in a line, and a block of code in the language `math`.
// Here they become what MathJax looks for.
(function () {
    "use strict";
    document.querySelectorAll("pre > code.language-math").forEach((code) => {
        const formula = document.createElement("div");
        formula.textContent = "\\[" + code.textContent + "\\]";
        code.parentElement.replaceWith(formula);
    });
    document.querySelectorAll(":not(pre) > code").forEach((code) => {
        const [before, after] = [code.previousSibling, code.nextSibling];
        const isText = (node) => node && node.nodeType === Node.TEXT_NODE;
        if (isText(before) && isText(after) && before.data.endsWith("$") && after.data.startsWith("$")) {
            before.data = before.data.slice(0, -1);
            after.data = after.data.slice(1);
            const formula = document.createElement("span");
            formula.textContent = "\\(" + code.textContent + "\\)";
            code.replaceWith(formula);
        }
    });
    if (window.MathJax && MathJax.Hub) {
        MathJax.Hub.Queue(["Typeset", MathJax.Hub]);
    }
})();
