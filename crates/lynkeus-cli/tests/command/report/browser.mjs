// Opens a page in a headless browser. Prints what was seen as JSON. Arguments: the browser, a folder for its own files, the page, and a folder
// for screenshots, if wanted.
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

import { call, close, open, seen, shot, value } from "./driver.mjs";

const [browser, profile, page, shots] = process.argv.slice(2);

async function ready() {
    for (let tries = 0; tries < 600; tries += 1) {
        if ((await value("document.body?.dataset.state")) === "ready") {
            return;
        }
        await new Promise((done) => setTimeout(done, 50));
    }
    throw new Error("the page is not ready after half a minute");
}

async function move(id, position) {
    await value(`(() => {
        const slider = document.getElementById("${id}");
        slider.value = ${position};
        slider.dispatchEvent(new Event("input"));
    })()`);
    await ready();
}

async function picture(name, width, scheme, height) {
    if (shots) {
        await shot(join(shots, `${name}.png`), width, scheme, height);
    }
}

// The last series of every chart is the estimate.
const CURVES = "charts.map(({ plot }) => Array.from(plot.data[plot.data.length - 1]))";
// Whether the canvas of every chart has points of the estimate's colour.
const paintedOf = (plots) => `${plots}.map((plot) => {
    const { width, height } = plot.ctx.canvas;
    const pixels = plot.ctx.getImageData(0, 0, width, height).data;
    const wanted = [1, 3, 5].map((k) => parseInt(color("estimate").slice(k, k + 2), 16));
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) {
        count += pixels[i + 3] > 128 && wanted.every((v, k) => Math.abs(pixels[i + k] - v) < 8);
    }
    return count;
})`;
// Rows of the trade-off's table that are the slider's.
const ROW = `[...document.querySelectorAll("#tradeoff .wide tbody tr")].flatMap((row, k) => (row.classList.contains("present") ? [k] : []))`;
const PICTURE = "compromises[0]?.ctx.canvas.toDataURL()";

try {
    await open(browser, profile, pathToFileURL(resolve(page)).href);
    await ready();
    seen.title = await value("document.title");
    seen.painted = await value(paintedOf("charts.map(({ plot }) => plot)"));
    seen.compromise = await value(paintedOf("compromises"));
    seen.row = { first: await value(ROW), picture: await value(PICTURE) };
    seen.names = await value("charts.map(({ quantity }) => quantity.name)");
    seen.first = await value(CURVES);
    seen.last = await value("charts.map(({ plot }) => plot.series.findLast((series) => series.show).label)");
    seen.status = await value(`document.getElementById("status")?.textContent`);
    await picture("light", 1280, "light");
    seen.all = await value("charts.every(({ plot }) => plot.scales.x.min === data.time[0] && plot.scales.x.max === data.time[data.time.length - 1])");
    if (await value(`document.getElementById("knob") !== null`)) {
        await move("knob", 0);
        seen.slow = await value(CURVES);
        Object.assign(seen.row, { slow: await value(ROW), slow_picture: await value(PICTURE) });
        await picture("moved", 1280, "dark");
        await move("knob", await value("data.knob.own"));
    }
    if (await value(`document.getElementById("noise") !== null`)) {
        await move("noise", 20);
        seen.noisy = await value(CURVES);
        await picture("noisy", 1280, "light");
        await move("noise", 0);
        seen.back = await value(CURVES);
    }
    await value(`charts[0].plot.setScale("x", { min: data.time[2], max: data.time[10] })`);
    await new Promise((done) => setTimeout(done, 100));
    seen.zoomed = await value("charts.every(({ plot }) => plot.scales.x.min === data.time[2] && plot.scales.x.max === data.time[10])");
    await call("Emulation.setDeviceMetricsOverride", { width: 390, height: 844, deviceScaleFactor: 1, mobile: true });
    await new Promise((done) => setTimeout(done, 300));
    seen.width = await value("document.documentElement.scrollWidth");
    await value("whole()");
    await picture("phone", 390, "dark", 844);
} catch (error) {
    seen.failed = error.stack;
} finally {
    await close();
}
process.stdout.write(JSON.stringify(seen), () => process.exit(0));
