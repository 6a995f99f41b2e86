// Looks into reports as a reader does, and says what is not as it should be.
// Usage: node look.mjs FOLDER BROWSER, where FOLDER has node_modules and pages (see .ci/report).
import { readFileSync, readdirSync, statSync, existsSync } from "node:fs";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { begin } from "../look.mjs";

const [folder, executablePath] = process.argv.slice(2).map((path) => resolve(path));
const { browser, shots, check, accessible, end } = await begin(folder, executablePath);

const pages = {};
for (const name of readdirSync(join(folder, "pages"))) {
  const path = join(folder, "pages", name);
  const file = name.endsWith(".html") ? path : join(path, "report.html");
  if (existsSync(file)) pages[name.replace(/\.html$/, "")] = file;
}

/** A page with all of its figures there; what it asked for and what it complained of is checked. */
async function open(name, { width = 1200, height = 900, scheme = "light", script = true, touch = false } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: scheme, javaScriptEnabled: script, hasTouch: touch });
  const page = await context.newPage();
  const asked = [];
  page.on("request", (request) => /^(data|blob):/.test(request.url()) || asked.push(request.url()));
  page.on("pageerror", (error) => check(`${name}: the script runs`, false, error.message));
  page.on("console", (message) => message.type() === "error" && check(`${name}: the script is content`, false, message.text()));
  await page.goto(pathToFileURL(pages[name]).href);
  if (script) {
    await page.evaluate(() => window.figures?.all());
    await page.waitForFunction(() => [...document.querySelectorAll(".live")].every((one) => one.dataset.ready || one.style.display === "none"));
    // Sizes are observed once more before anything is looked at.
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  }
  check(`${name}: nothing is asked for but the page`, asked.length === 1, asked.join(" "));
  return page;
}

/** A panel's place on the screen, scrolled into sight. */
async function plot(page, figure, panel) {
  const holder = page.locator(`.live[data-figure="${figure}"] .plot`).nth(panel);
  await holder.scrollIntoViewIfNeeded();
  const box = await holder.locator(".u-over").boundingBox();
  return { holder, box };
}

const view = (page, number, panel) =>
  page.evaluate(
    ([number, panel]) => {
      const { x, y } = window.figures.shown.find((figure) => figure.number === number).panels[panel].plot.scales;
      return [x.min, x.max, y.min, y.max];
    },
    [number, panel],
  );

function rows(file) {
  const [head, ...lines] = readFileSync(file, "utf8").trim().split("\n");
  const columns = head.split(",");
  const cells = lines.map((line) => line.split(",").map((cell) => (cell === "" ? NaN : Number(cell))));
  return (name) => cells.map((row) => row[columns.indexOf(name)]);
}

// ---- All pages, at all widths ----------------------------------------------------------------------------------------
for (const name of Object.keys(pages)) {
  for (const width of [373, 400, 800, 1200, 1920]) {
    for (const scheme of width === 400 || width === 1200 ? ["light", "dark"] : ["light"]) {
      const page = await open(name, { width, scheme });
      const where = `${name} at ${width} px, ${scheme}`;
      const { wide, tables, hidden, ticks, twice } = await page.evaluate(() => ({
        wide: document.documentElement.scrollWidth - innerWidth,
        tables: [...document.querySelectorAll(".scroll")].filter((one) => one.offsetParent && one.scrollWidth > one.clientWidth + 1).length,
        ticks: [...document.querySelectorAll("p, li, td, th, dt, dd, caption, figcaption, h1, h2")].filter((one) => one.textContent.includes("`")).length,
        twice: (notices => notices.length - new Set(notices).size)([...document.querySelectorAll(":is(.warning, .failure):not(td)")].map((one) => one.textContent)),
        hidden: [...document.querySelectorAll(".grade")].filter((one) => one.offsetParent && one.getBoundingClientRect().right > innerWidth).length,
      }));
      check(`${where}: is no wider than the screen`, wide <= 0, wide);
      check(`${where}: no table hides its verdict`, hidden === 0, hidden);
      check(`${where}: names are set as code and not in backticks`, ticks === 0, ticks);
      check(`${where}: no warning stands twice`, twice === 0, twice);
      check(`${where}: all tables are seen whole`, width < 1200 || tables === 0, tables);
      if (width === 400 || width === 1200) {
        await accessible(page, where);
        await page.screenshot({ path: join(shots, `${name}-${width}-${scheme}.png`), fullPage: true });
      }
      await page.context().close();
    }
  }
}

// ---- An estimate, looked into ----------------------------------------------------------------------------------------
{
  const page = await open("estimate");
  check("a page of 24 000 samples has at most 1.5 MB", statSync(pages.estimate).size <= 1.5e6, statSync(pages.estimate).size);

  // What is plotted is what was estimated.
  const trajectory = rows(join(folder, "pages", "estimate", "trajectory_ekf.csv"));
  const time = trajectory("time_s");
  const expected = {
    angle: trajectory("angle_rad").map((angle) => (angle * 180) / Math.PI),
    innovation: trajectory("innovation_V"),
  };
  const plotted = await page.evaluate(() =>
    window.figures.shown.flatMap(({ number, panels }) =>
      panels.flatMap((panel, place) =>
        panel.series.filter((one) => one.samples).map((one) => ({ number, place, panel: panel.label, label: one.label, kind: one.kind, per: one.samples.per, x: [...one.samples.x], low: [...one.samples.low] })),
      ),
    ),
  );
  const motion = plotted.filter((one) => one.number === 1);
  const of = (panel, label) => plotted.find((one) => one.panel === panel && one.label.startsWith(label) && one.kind !== "band");
  for (const [panel, label] of [["angle", "Extended"], ["innovation", "Extended"]]) {
    const found = of(panel, label) ?? of(panel, "EKF");
    check(`${panel} of the filter is there, each sample`, found?.per === 1 && found.x.length === time.length, plotted.map((one) => `${one.panel}/${one.label}`).join(" "));
    if (!found) continue;
    const finite = expected[panel].filter(Number.isFinite);
    const range = Math.max(...finite) - Math.min(...finite);
    const off = Math.max(...found.low.map((value, k) => (Number.isFinite(expected[panel][k]) ? Math.abs(value - expected[panel][k]) / range : 0)));
    const late = Math.max(...found.x.map((value, k) => Math.abs(value - time[k])));
    check(`${panel} is that of the trajectory within 1e-4 of its range`, off <= 1e-4 && late <= 1e-9, `${off} ${late}`);
  }

  // Drag, and all panels over the same time follow.
  const before = await view(page, 1, 0);
  const { holder, box } = await plot(page, 1, 0);
  const middle = box.y + box.height / 2;
  await page.mouse.move(box.x + 0.25 * box.width, middle);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.5 * box.width, middle, { steps: 5 });
  await page.mouse.up();
  const near = await view(page, 1, 0);
  const share = (near[1] - near[0]) / (before[1] - before[0]);
  check("dragging zooms to what was marked", Math.abs(share - 0.25) < 0.02, share);
  const panels = motion.map((one) => one.place);
  const last = Math.max(...panels);
  check("the other panels follow", JSON.stringify((await view(page, 1, last)).slice(0, 2)) === JSON.stringify(near.slice(0, 2)));

  // The wheel, to single samples.
  await page.mouse.move(box.x + 0.5 * box.width, middle);
  for (let turn = 0; turn < 60; turn++) await page.mouse.wheel(0, -100);
  const close = await view(page, 1, 0);
  check("the wheel zooms to single samples", close[1] - close[0] < 10 * (time[1] - time[0]), close[1] - close[0]);

  // The value under the cursor is the sample's, with its unit.
  const angle = page.locator('.live[data-figure="1"] .legend').nth(last);
  const { box: low } = await plot(page, 1, last);
  await page.mouse.move(low.x + 0.5 * low.width, low.y + 0.5 * low.height);
  const said = (await angle.locator("button output").allTextContents()).filter(Boolean);
  check("the values under the cursor have units", said.length > 0 && said.every((text) => /deg/.test(text)), said.join(" | "));
  const at = (close[0] + close[1]) / 2;
  const sample = time.reduce((best, value, k) => (Math.abs(value - at) < Math.abs(time[best] - at) ? k : best), 0);
  const values = said.map((text) => Number(text.split(/[\u00a0 ]/)[0].replace("\u2212", "-")));
  check("one of them is the estimate's", values.some((value) => Math.abs(value - expected.angle[sample]) < 2e-3), `${values} ${expected.angle[sample]}`);

  // Keys.
  await holder.focus();
  await page.keyboard.press("0");
  check("0 shows the beginning's view", Math.abs((await view(page, 1, 0))[0] - before[0]) < 1e-12);
  await page.keyboard.press("a");
  const whole = await view(page, 1, 0);
  check("A shows all", whole[0] <= time[0] && whole[1] >= time.at(-1), whole.slice(0, 2));
  await page.keyboard.press("+");
  check("+ zooms", (await view(page, 1, 0))[1] - (await view(page, 1, 0))[0] < 0.51 * (whole[1] - whole[0]));
  await page.keyboard.press("ArrowRight");
  const spoken = await page.locator('.live[data-figure="1"] [aria-live]').textContent();
  check("an arrow says the values", /time/.test(spoken) && /V|deg/.test(spoken), spoken);
  await page.keyboard.press("0");

  // A series is switched off and on.
  const canvas = () => page.evaluate((last) => document.querySelectorAll('.live[data-figure="1"] canvas')[last].toDataURL(), last);
  const button = angle.locator("button").last();
  const shown = await canvas();
  await button.click();
  check("a series is switched off", (await button.getAttribute("aria-pressed")) === "false" && (await canvas()) !== shown);
  await button.click();
  check("and on again", (await button.getAttribute("aria-pressed")) === "true" && (await canvas()) === shown);

  // On paper there are the pictures.
  await page.emulateMedia({ media: "print" });
  const printed = await page.evaluate(() => [...document.querySelectorAll("figure")].every((one) => {
    const [picture, live] = [one.querySelector(".picture, .raster"), one.querySelector(".live")];
    return picture.offsetHeight > 50 && (!live || live.offsetHeight === 0);
  }));
  check("on paper there are the pictures", printed);
  await page.context().close();
}

// ---- What is missing is seen ------------------------------------------------------------------------------------------
{
  const page = await open("gap");
  const shaded = await page.evaluate(() =>
    window.figures.shown.flatMap(({ panels }) =>
      panels.flatMap((panel) => panel.series.filter((one) => one.label === "no samples").map((one) => [panel.label, Math.min(...one.samples.x), Math.max(...one.samples.x)])),
    ),
  );
  check("a gap is shaded in innovations and errors", ["innovation", "angle error"].every((wanted) => shaded.some(([label]) => label === wanted)), JSON.stringify(shaded));
  check("where the samples are missing", shaded.every(([, from, to]) => Math.abs(from - 14.997e-3) < 3e-6 && Math.abs(to - 15.498e-3) < 3e-6), JSON.stringify(shaded));
  await page.locator('.live').filter({ hasText: "no samples" }).first().scrollIntoViewIfNeeded();
  await page.screenshot({ path: join(shots, "gap.png") });
  await page.context().close();
}

// ---- Touch -----------------------------------------------------------------------------------------------------------
{
  const page = await open("estimate", { width: 400, touch: true });
  const { box } = await plot(page, 1, 0);
  const before = await view(page, 1, 0);
  const remote = await page.context().newCDPSession(page);
  const y = box.y + box.height / 2;
  const fingers = (a, b) => [{ x: box.x + a * box.width, y, id: 1 }, { x: box.x + b * box.width, y, id: 2 }];
  await remote.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: fingers(0.4, 0.6) });
  for (let step = 1; step <= 5; step++) await remote.send("Input.dispatchTouchEvent", { type: "touchMove", touchPoints: fingers(0.4 - 0.04 * step, 0.6 + 0.04 * step) });
  await remote.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
  const after = await view(page, 1, 0);
  const share = (after[1] - after[0]) / (before[1] - before[0]);
  check("two fingers zoom", share > 0.2 && share < 0.6, share);
  await page.context().close();
}

// ---- Without script --------------------------------------------------------------------------------------------------
for (const name of Object.keys(pages)) {
  const page = await open(name, { script: false });
  const bad = await page.locator("figure").evaluateAll((all) => all.filter((one) => one.querySelector(".picture, .raster").getBoundingClientRect().height < 50).length);
  check(`${name}: without script there are the pictures`, bad === 0, bad);
  check(`${name}: and no plots`, (await page.locator(".live:visible").count()) === 0);
  if (name === "estimate") await page.screenshot({ path: join(shots, "estimate-without-script.png"), fullPage: true });
  await page.context().close();
}

await end();
