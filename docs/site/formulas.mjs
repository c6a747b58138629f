// Sets formulas: a list of {"tex", "display"} as JSON on standard input gives a list of HTML on standard output.
// A formula that cannot be set ends it with a word, and with it the site's build.
import { readFileSync } from "node:fs";
import katex from "katex";

// letters of the formulas are Unicode's, so that they can be read in Markdown
const strict = (code) => (code === "unicodeTextInMathMode" ? "ignore" : "error");

const set = ({ tex, display }) => {
  try {
    return katex.renderToString(tex, { displayMode: display, throwOnError: true, strict });
  } catch (error) {
    console.error(`${error.message}\n${tex}`);
    process.exit(1);
  }
};

console.log(JSON.stringify(JSON.parse(readFileSync(0, "utf8")).map(set)));
