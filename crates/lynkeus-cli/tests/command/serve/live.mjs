// Looks at pages of a service as it is asked on standard input, a JSON object for each line, and answers each on a
// line: { open: url }, { value: expression }, { until: expression }, { shot: file, width, scheme }, { seen: true }.
// Arguments: the browser, and a folder for its own files.
import { createInterface } from "node:readline";

import { call, close, open, seen, shot, value } from "./driver.mjs";

const [browser, profile] = process.argv.slice(2);
let isOpen = false;

// The first value of an expression that is no falsehood.
async function until(expression) {
    for (let tries = 0; tries < 600; tries += 1) {
        const found = await value(expression);
        if (found) {
            return found;
        }
        await new Promise((done) => setTimeout(done, 50));
    }
    throw new Error(`never: ${expression}`);
}

async function answer(asked) {
    if (asked.open) {
        if (isOpen) {
            await call("Page.navigate", { url: asked.open });
        } else {
            await open(browser, profile, asked.open);
        }
        isOpen = true;
        return until(`document.readyState === "complete" && location.href === ${JSON.stringify(asked.open)}`);
    }
    if (asked.value) {
        return value(asked.value);
    }
    if (asked.until) {
        return until(asked.until);
    }
    if (asked.shot) {
        return shot(asked.shot, asked.width, asked.scheme);
    }
    return seen;
}

for await (const line of createInterface({ input: process.stdin })) {
    try {
        console.log(JSON.stringify({ found: (await answer(JSON.parse(line))) ?? null }));
    } catch (error) {
        console.log(JSON.stringify({ failed: error.stack }));
    }
}
if (isOpen) {
    await close();
}
process.exit(0);
