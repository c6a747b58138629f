// A headless browser without any other tool than Node: the browser's own protocol over pipes.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { writeFileSync } from "node:fs";

export const seen = { requests: [], complaints: [] };
const waiting = new Map();
let child;
let session;
let count = 0;
let rest = "";

const options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--hide-scrollbars", "--disable-dev-shm-usage"];
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

export async function call(method, params = {}) {
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

export async function value(expression) {
    const answer = await call("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
    if (answer.exceptionDetails) {
        throw new Error(answer.exceptionDetails.exception.description);
    }
    return answer.result.value;
}

// A picture of the page as a file.
export async function shot(file, width, scheme, height = 900) {
    await call("Emulation.setEmulatedMedia", { features: [{ name: "prefers-color-scheme", value: scheme }] });
    await call("Emulation.setDeviceMetricsOverride", { width, height, deviceScaleFactor: 1, mobile: width < 600 });
    await new Promise((done) => setTimeout(done, 400));
    const { cssContentSize } = await call("Page.getLayoutMetrics");
    const clip = { x: 0, y: 0, width, height: Math.min(cssContentSize.height, 6000), scale: 1 };
    const { data } = await call("Page.captureScreenshot", { clip, captureBeyondViewport: true });
    writeFileSync(file, Buffer.from(data, "base64"));
}

// Begins a browser (a program), with a folder for its own files, and looks at a page.
export async function open(browser, profile, url) {
    child = spawn(browser, [...options, "--remote-debugging-pipe", `--user-data-dir=${profile}`, "about:blank"], {
        stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"],
    });
    child.stdio[4].setEncoding("utf8");
    child.stdio[4].on("data", (text) => {
        const messages = (rest + text).split("\0");
        rest = messages.pop();
        messages.forEach((message) => heard(JSON.parse(message)));
    });
    const { targetInfos } = await call("Target.getTargets");
    const { targetId } = targetInfos.find((target) => target.type === "page");
    ({ sessionId: session } = await call("Target.attachToTarget", { targetId, flatten: true }));
    for (const domain of ["Page", "Runtime", "Network", "Log"]) {
        await call(`${domain}.enable`);
    }
    await call("Emulation.setDeviceMetricsOverride", { width: 1280, height: 900, deviceScaleFactor: 1, mobile: false });
    await call("Page.navigate", { url });
}

// Ends it.
export async function close() {
    const gone = once(child, "exit");
    child.stdio[3].write(`${JSON.stringify({ id: 0, method: "Browser.close" })}\0`);
    await gone;
}
