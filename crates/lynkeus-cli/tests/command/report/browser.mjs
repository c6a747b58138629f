// Opens a page in a headless browser, without any other tool than Node: the browser's own protocol over
// pipes. Prints what was seen as JSON. Arguments: the browser, a folder for its own files, the page, and a folder
// for screenshots, if wanted.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [browser, profile, page, shots] = process.argv.slice(2);
const options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars", "--disable-dev-shm-usage"];
const child = spawn(browser, [...options, "--remote-debugging-pipe", `--user-data-dir=${profile}`, "about:blank"], {
    stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"],
});
const seen = { requests: [], complaints: [] };
const waiting = new Map();
let count = 0;
let rest = "";

function heard(message) {
    if (waiting.has(message.id)) {
        waiting.get(message.id)(message);
        waiting.delete(message.id);
    }
    const { method, params } = message;
    if (method === "Network.requestWillBeSent" || method === "Network.webSocketCreated") {
        seen.requests.push((params.request ?? params).url);
    }
    if (method === "Runtime.exceptionThrown") {
        seen.complaints.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    }
    if (method === "Runtime.consoleAPICalled" && params.type !== "log") {
        seen.complaints.push(params.args.map((a) => a.value ?? a.description).join(" "));
    }
    if (method === "Log.entryAdded" && params.entry.level !== "verbose") {
        seen.complaints.push(params.entry.text);
    }
}

child.stdio[4].setEncoding("utf8");
child.stdio[4].on("data", (text) => {
    const messages = (rest + text).split("\0");
    rest = messages.pop();
    messages.forEach((message) => heard(JSON.parse(message)));
});

let session;
async function call(method, params = {}) {
    count += 1;
    const id = count;
    const answer = new Promise((done) => waiting.set(id, done));
    child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId: session })}\0`);
    const { result, error } = await answer;
    if (error) {
        throw new Error(`${method}: ${error.message}`);
    }
    return result;
}

async function value(expression) {
    const answer = await call("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (answer.exceptionDetails) {
        throw new Error(answer.exceptionDetails.exception.description);
    }
    return answer.result.value;
}

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

async function shot(name, width, scheme, height = 900) {
    if (!shots) {
        return;
    }
    await call("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }] });
    await call("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: width < 600 });
    await new Promise((done) => setTimeout(done, 400));
    const { cssContentSize } = await call("Page.getLayoutMetrics");
    const clip = { x: 0, y: 0, width, height: Math.min(cssContentSize.height, 6000), scale: 1 };
    const { data } = await call("Page.captureScreenshot", { clip, captureBeyondViewport: true });
    writeFileSync(join(shots, `${name}.png`), Buffer.from(data, "base64"));
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
    const { targetInfos } = await call("Target.getTargets");
    const { targetId } = targetInfos.find((target) => target.type === "page");
    ({ sessionId: session } = await call("Target.attachToTarget", { targetId, flatten: true }));
    for (const domain of ["Page", "Runtime", "Network", "Log"]) {
        await call(`${domain}.enable`);
    }
    await call("Emulation.setDeviceMetricsOverride", { width: 1280, height: 900, deviceScaleFactor: 1, mobile: false });
    await call("Page.navigate", { url: pathToFileURL(resolve(page)).href });
    await ready();
    seen.title = await value("document.title");
    seen.painted = await value(paintedOf("charts.map(({ plot }) => plot)"));
    seen.compromise = await value(paintedOf("compromises"));
    seen.row = { first: await value(ROW), picture: await value(PICTURE) };
    seen.names = await value("charts.map(({ quantity }) => quantity.name)");
    seen.first = await value(CURVES);
    seen.last = await value("charts.map(({ plot }) => plot.series.findLast((series) => series.show).label)");
    seen.status = await value(`document.getElementById("status")?.textContent`);
    await shot("light", 1280, "light");
    seen.all = await value("charts.every(({ plot }) => plot.scales.x.min === data.time[0] && plot.scales.x.max === data.time[data.time.length - 1])");
    if (await value(`document.getElementById("knob") !== null`)) {
        await move("knob", 0);
        seen.slow = await value(CURVES);
        Object.assign(seen.row, { slow: await value(ROW), slow_picture: await value(PICTURE) });
        await shot("moved", 1280, "dark");
        await move("knob", await value("data.knob.own"));
    }
    if (await value(`document.getElementById("noise") !== null`)) {
        await move("noise", 20);
        seen.noisy = await value(CURVES);
        await shot("noisy", 1280, "light");
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
    await shot("phone", 390, "dark", 844);
} catch (error) {
    seen.failed = error.stack;
} finally {
    const gone = once(child, "exit");
    child.stdio[3].write(`${JSON.stringify({ id: 0, method: "Browser.close" })}\0`);
    await gone;
}
process.stdout.write(JSON.stringify(seen), () => process.exit(0));
