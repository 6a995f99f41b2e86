// What tests in a browser share: the browser, what is checked, the accessibility run, and how it all ends.
import { createRequire } from "node:module";
import { mkdirSync, readFileSync } from "node:fs";
import { join } from "node:path";

/**
 * Starts the browser of `executablePath` with playwright and axe from FOLDER/node_modules. Pictures of the screen go to FOLDER/shots.
 */
export async function begin(folder, executablePath) {
  const require = createRequire(join(folder, "node_modules", "x.js"));
  const { chromium } = require("playwright-core");
  const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
  const shots = join(folder, "shots");
  mkdirSync(shots, { recursive: true });
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
  });

  let failed = 0;
  function check(what, holds, found = "") {
    if (!holds) failed += 1;
    if (!holds || process.env.VERBOSE) console.log(`${holds ? "ok" : "FAILED"}: ${what}${found === "" ? "" : `: ${found}`}`);
  }

  /** Looks at all of a page but what the options leave out as people do who do not see it. */
  async function accessible(page, where, options = {}) {
    // Where a page refuses the script, the run below fails.
    await page.evaluate(axe).catch(() => {});
    const found = await page.evaluate(
      async (options) => (await window.axe.run(options)).violations.map((one) => [one.impact, one.id, one.nodes[0].html.slice(0, 160)]),
      options,
    );
    const serious = found.filter(([impact]) => impact === "serious" || impact === "critical");
    check(`${where}: axe finds nothing serious`, serious.length === 0, JSON.stringify(serious));
  }

  async function end() {
    await browser.close();
    console.log(failed ? `${failed} checks failed` : `all checks passed; pictures of the screen are in ${shots}`);
    process.exit(failed ? 1 : 0);
  }

  return { browser, shots, check, accessible, end };
}
