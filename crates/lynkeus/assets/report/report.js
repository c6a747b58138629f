// The pictures of a report, and the sliders that run its observer anew.
// `observers` is a list of functions, one per position of the first slider; the samples and the
// curves of the study itself are in the element "data".
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const charts = [];
const chosen = { position: data.knob ? data.knob.own : 0, noise: 0 };
let ticket = 0;

/* ---- samples and noise ---- */

const rows = data.time.length;
const samples = data.signals.map((signal) => Float64Array.from(signal.values, (v) => v ?? NaN));

// A seeded generator (mulberry32), so that a position of the slider is always the same noise.
function uniform(seed) {
    let s = seed >>> 0;
    return () => {
        s = (s + 0x6d2b79f5) >>> 0;
        let z = Math.imul(s ^ (s >>> 15), 1 | s);
        z = (z + Math.imul(z ^ (z >>> 7), 61 | z)) ^ z;
        return ((z ^ (z >>> 14)) >>> 0) / 4294967296;
    };
}

// Normal numbers of deviation 1 (Box and Muller).
function normals(count, seed) {
    const next = uniform(seed);
    return Float64Array.from({ length: count }, () => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next()));
}

function range(values) {
    let [low, high] = [Infinity, -Infinity];
    for (const v of values) {
        if (Number.isFinite(v)) {
            low = Math.min(low, v);
            high = Math.max(high, v);
        }
    }
    return high > low ? high - low : 0;
}

const ranges = samples.map(range);
const noises = data.signals.map((signal, k) => (signal.measured ? normals(rows, 1 + k) : null));

// The signals with noise added whose deviation is this share of each reading's range.
function noisy(share) {
    return samples.map((values, k) => {
        const noise = noises[k];
        return share === 0 || !noise ? values : values.map((v, row) => v + share * ranges[k] * noise[row]);
    });
}

/* ---- the observer over the samples ---- */

const WORDS = ["", "times do not increase", "an input has no value", "an interval is not finite", "the estimate diverged", "the estimate is not finite"];

// Columns of the estimates by header; gives way to the page now and then, and ends where another run began.
async function run(position, signals, mine) {
    const observer = observers[position]();
    const places = observer.signals.map((name) => data.signals.findIndex((signal) => signal.name === name));
    const state = observer.init();
    const input = new Float64Array(places.length);
    const found = new Float64Array(observer.estimates.length);
    const columns = Object.fromEntries(observer.estimates.map((name) => [name, new Array(rows).fill(null)]));
    let until = performance.now() + 30;
    for (let row = 0; row < rows; row += 1) {
        places.forEach((place, k) => {
            input[k] = signals[place][row];
        });
        const code = observer.push(state, data.time[row], input, found);
        if (code !== 0) {
            return { columns, ended: `${WORDS[code]} at t = ${data.time[row]}` };
        }
        observer.estimates.forEach((name, k) => {
            columns[name][row] = Number.isFinite(found[k]) ? found[k] : null;
        });
        if (performance.now() > until) {
            await new Promise((resume) => setTimeout(resume));
            if (mine !== ticket) {
                return null;
            }
            until = performance.now() + 30;
        }
    }
    return { columns, ended: null };
}

/* ---- the curves of a chart ---- */

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const shownValue = (plot, value) => rounded(value, 5);
const line = (label, name, more) => ({ label, stroke: () => color(name), width: 1.5, points: { show: rows === 1 }, value: shownValue, ...more });

// Root of the mean square error over the last half, where the truth is known.
function settledError(truth, estimate) {
    let [sum, count] = [0, 0];
    for (let row = Math.floor(rows / 2); row < rows; row += 1) {
        if (truth[row] !== null && estimate[row] !== null) {
            sum += (estimate[row] - truth[row]) ** 2;
            count += 1;
        }
    }
    return count > 0 ? Math.sqrt(sum / count) : null;
}

// Whether the observer in the page estimates it.
const moves = (quantity) => data.knob !== null && quantity.header !== null;

const edge = (estimate, deviation, side) => estimate.map((x, row) => (x === null || deviation[row] === null ? null : x + 2 * side * deviation[row]));

// What a chart draws, each with a curve over the rows; `found` is the last run of the page.
function curves(quantity, found, readings) {
    const estimate = found?.[quantity.header] ?? quantity.estimate;
    const deviation = found?.[quantity.deviation_header] ?? quantity.deviation;
    const list = [];
    if (Number.isInteger(quantity.sensor)) {
        const values = Array.from(readings[quantity.sensor], (v) => (Number.isFinite(v) ? v : null));
        const points = { show: true, size: 3, width: 0, fill: () => color("reading") };
        list.push([line("reading", "reading", { paths: () => null, points }), values]);
    }
    if (deviation) {
        list.push([{ label: "+2 sd", class: "edge", stroke: "transparent", points: { show: false } }, edge(estimate, deviation, 1)]);
        list.push([{ label: "−2 sd", class: "edge", stroke: "transparent", points: { show: false } }, edge(estimate, deviation, -1)]);
    }
    if (quantity.truth) {
        list.push([line("true", "truth", { width: 2 }), quantity.truth]);
    }
    if (moves(quantity)) {
        list.push([line("as in the study", "study", { class: "study", dash: [5, 4], show: false }), quantity.estimate]);
    }
    list.push([line("estimate", "estimate"), estimate]);
    return list;
}

// Almost all of what is seen, so that a peak at the start does not flatten the rest.
function fit(plot) {
    let [low, high] = [Infinity, -Infinity];
    const [from, to] = plot.series[0].idxs ?? [0, rows - 1];
    plot.series.slice(1).forEach((series, k) => {
        const seen = series.show ? plot.data[k + 1].slice(from, to + 1).filter((v) => v !== null) : [];
        seen.sort((a, b) => a - b);
        if (seen.length > 0) {
            const cut = Math.floor(seen.length / 100);
            low = Math.min(low, seen[cut]);
            high = Math.max(high, seen[seen.length - 1 - cut]);
        }
    });
    if (!(high >= low)) {
        return [0, 1];
    }
    const margin = 0.1 * (high - low || Math.abs(high) || 1);
    return [low - margin, high + margin];
}

/* ---- charts ---- */

// A number with so many digits and no more; small ones stay numbers.
const rounded = (x, digits) => (x === null || x === undefined ? "–" : String(Number(x.toPrecision(digits))).replace("-", "−"));

const withUnit = (name, unit) => (unit ? `${name} (${unit})` : name);

// The time that a chart shows, if it was drawn.
const seen = (plot) => (Number.isFinite(plot.scales.x.min) ? plot.scales.x : {});

// All charts show the same time.
function zoomed(plot, key) {
    const { min, max } = plot.scales.x;
    for (const { plot: other } of key === "x" ? charts : []) {
        if (other !== plot && (other.scales.x.min !== min || other.scales.x.max !== max)) {
            other.setScale("x", { min, max });
        }
    }
}

function whole() {
    charts.forEach(({ plot }) => plot.setScale("x", { min: data.time[0], max: data.time[rows - 1] }));
}

// Two fingers zoom the time.
function pinch(plot) {
    let before = null;
    const spread = (event) => {
        const [a, b] = [event.touches[0].clientX, event.touches[1].clientX];
        const left = plot.over.getBoundingClientRect().left;
        return { width: Math.max(Math.abs(a - b), 20), at: plot.posToVal((a + b) / 2 - left, "x") };
    };
    plot.over.addEventListener("touchstart", (event) => {
        before = event.touches.length === 2 ? { ...spread(event), ...plot.scales.x } : null;
    });
    plot.over.addEventListener("touchmove", (event) => {
        if (before && event.touches.length === 2) {
            event.preventDefault();
            const share = before.width / spread(event).width;
            const min = Math.max(data.time[0], before.at + (before.min - before.at) * share);
            const max = Math.min(data.time[rows - 1], before.at + (before.max - before.at) * share);
            plot.setScale("x", { min, max });
        }
    }, { passive: false });
}

// A place for a picture, with a line above it.
function panel(host, title, words) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const name = document.createElement("b");
    name.textContent = title;
    const more = document.createElement("span");
    more.textContent = words;
    caption.append(name, more);
    figure.append(caption);
    document.getElementById(host).append(figure);
    return figure;
}

// How an axis looks: the one below with its label, the one at the left without.
function axis(label) {
    const [stroke, line] = [() => color("text"), { stroke: () => color("grid"), width: 1 }];
    const place = label === undefined ? { size: 64 } : { label, labelSize: 20, size: 36 };
    return { stroke, grid: line, ticks: line, values: (plot, splits) => splits.map((v) => (v === null ? "" : rounded(v, 6))), ...place };
}

// A picture as wide as its place, which readers of the screen know by its caption.
function drawn(figure, options, values) {
    const size = () => ({ width: figure.clientWidth, height: 260 });
    const plot = new uPlot({ ...size(), ...options }, values, figure);
    plot.ctx.canvas.setAttribute("role", "img");
    plot.ctx.canvas.setAttribute("aria-label", figure.firstChild.textContent);
    new ResizeObserver(() => plot.setSize(size())).observe(figure);
    return plot;
}

function chart(quantity) {
    const alarm = quantity.alarm_below == null ? quantity.meaning : `below ${quantity.alarm_below}: ${quantity.meaning}`;
    const words = quantity.description ?? (quantity.meaning ? alarm : "");
    const figure = panel("charts", withUnit(quantity.name, quantity.unit), words);
    const error = document.createElement("span");
    error.className = "error";
    figure.firstChild.append(error);
    const list = curves(quantity, null, samples);
    const labels = list.map(([series]) => series.label);
    const high = labels.indexOf("+2 sd") + 1;
    const plot = drawn(figure, {
        scales: { x: { time: false }, y: { range: fit } },
        axes: [axis(withUnit("time", data.time_unit)), axis()],
        series: [{ label: "time", value: shownValue }, ...list.map(([series]) => series)],
        bands: high > 0 ? [{ series: [high, high + 1], fill: () => color("band") }] : [],
        cursor: { sync: { key: "time", filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } }, drag: { x: true, y: false } },
        hooks: { setScale: [zoomed], ready: [pinch] },
    }, [data.time, ...list.map(([, values]) => values)]);
    charts.push({ quantity, plot, error });
}

function show(found, readings) {
    const own = !data.knob || (chosen.position === data.knob.own && chosen.noise === 0);
    for (const { quantity, plot, error } of charts) {
        const list = curves(quantity, found, readings);
        const before = list.findIndex(([series]) => series.label === "as in the study") + 1;
        // what is seen stays; at first that is all
        const { min = data.time[0], max = data.time[rows - 1] } = seen(plot);
        plot.batch(() => {
            plot.setData([data.time, ...list.map(([, values]) => values)], false);
            plot.setScale("x", { min, max });
            if (before > 0 && plot.series[before].show === own) {
                plot.setSeries(before, { show: !own });
            }
        });
        const now = quantity.truth && settledError(quantity.truth, list[list.length - 1][1]);
        const then = quantity.truth && settledError(quantity.truth, quantity.estimate);
        const digits = (x) => (x === null ? "none" : x.toPrecision(3));
        error.textContent = quantity.truth ? `RMS error of the last half: ${digits(now)}${own ? "" : ` (study: ${digits(then)})`}` : "";
    }
}

/* ---- the trade-off ---- */

const compromise = data.tradeoff;
const compromises = [];
const NAMES = {
    mean_error: "with noise",
    mean_error_exact: "without noise",
    mean_error_noise: "made by the noise",
    held_out_error: "on held-out samples",
    innovation: "innovation",
};
const COLORS = { mean_error: "estimate", mean_error_exact: "truth", mean_error_noise: "reading", held_out_error: "estimate", innovation: "reading" };

// Whether other positions than the knee are nearly as good.
const isWide = Boolean(compromise?.good) && compromise.good[0] < compromise.good[1];

// The row of the trade-off that the slider stands at; -1 where there is no slider.
const present = () => data.knob?.positions[chosen.position].place ?? -1;

// Numbers over decades are drawn on a scale of decades.
function scale(values) {
    const known = values.filter((v) => v !== null);
    const [least, most] = [Math.min(...known), Math.max(...known)];
    const ends = (plot, low, high) => {
        const air = (high / low) ** 0.04;
        return [low / air, high * air];
    };
    return least > 0 && most > 4 * least ? { distr: 3, time: false, range: ends } : { time: false };
}

// 1, 2 and 5 of every decade, or the decades alone where they are many.
function decades(plot, place, low, high) {
    const digits = high > 300 * low ? [1] : [1, 2, 5];
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
        found.push(...digits.map((digit) => Number(`${digit}e${power}`)).filter((v) => low <= v && v <= high));
    }
    return found;
}

// An axis of such a scale.
const along = ({ distr }, label) => ({ ...axis(label), ...(distr === 3 ? { splits: decades, filter: (plot, splits) => splits } : {}) });

const dots = (name) => ({ show: true, size: 5, width: 0, fill: () => color(name) });

// A mark of the canvas at a value of either axis: of the study's position, or of the slider's.
function mark(plot, name, draw) {
    const { ctx } = plot;
    ctx.save();
    ctx.strokeStyle = color(name);
    ctx.lineWidth = 2 * devicePixelRatio;
    ctx.beginPath();
    draw(ctx, plot.bbox);
    ctx.stroke();
    ctx.restore();
}

// Lines across the picture where the study and the slider are, and a band where all is nearly as good as at the knee.
function upright(plot) {
    const at = (value) => plot.valToPos(value, "x", true);
    const { ctx, bbox } = plot;
    if (isWide) {
        const [from, to] = compromise.good.map(at).sort((a, b) => a - b);
        ctx.save();
        ctx.fillStyle = color("band");
        ctx.fillRect(from, bbox.top, to - from, bbox.height);
        ctx.restore();
    }
    const across = (row, dash) => (to) => {
        to.setLineDash(dash.map((x) => x * devicePixelRatio));
        to.moveTo(at(compromise.values[row]), bbox.top);
        to.lineTo(at(compromise.values[row]), bbox.top + bbox.height);
    };
    if (compromise.own !== null) {
        mark(plot, "study", across(compromise.own, [5, 4]));
    }
    if (present() >= 0) {
        mark(plot, "text", across(present(), []));
    }
}

// Every error over what the slider moves.
function overPositions() {
    const places = compromise.values.map((_, k) => k).sort((a, b) => compromise.values[a] - compromise.values[b]);
    const pick = (values) => places.map((k) => values[k]);
    const names = Object.keys(compromise.figures);
    const [x, y] = [scale(compromise.values), scale(Object.values(compromise.figures).flat())];
    const figure = panel("compromise", `error over ${compromise.label}`, "share of the range");
    compromises.push(drawn(figure, {
        scales: { x, y },
        axes: [along(x, compromise.label), along(y)],
        series: [{ label: compromise.label, value: shownValue }, ...names.map((name) => line(NAMES[name], COLORS[name], { width: 2, points: dots(COLORS[name]) }))],
        cursor: { drag: { x: false, y: false } },
        hooks: { drawClear: [upright] },
    }, [pick(compromise.values), ...names.map((name) => pick(compromise.figures[name]))]));
}

// The error without noise over the one that noise makes: one point for every position, joined in their order.
function against() {
    const { mean_error_exact: exact, mean_error_noise: noise } = compromise.figures;
    if (!exact || !noise) {
        return;
    }
    const known = compromise.values.map((_, k) => k).filter((k) => exact[k] !== null && noise[k] !== null);
    const sorted = [...known].sort((a, b) => noise[a] - noise[b]);
    const place = (plot, k) => [plot.valToPos(noise[k], "x", true), plot.valToPos(exact[k], "y", true)];
    const joined = (plot) => {
        const stroke = new Path2D();
        known.forEach((k) => stroke.lineTo(...place(plot, k)));
        return { stroke };
    };
    const circle = (plot, name, k, radius, dash) => {
        if (known.includes(k)) {
            mark(plot, name, (to) => {
                to.setLineDash(dash.map((x) => x * devicePixelRatio));
                to.arc(...place(plot, k), radius * devicePixelRatio, 0, 2 * Math.PI);
            });
        }
    };
    const [x, y] = [scale(noise), scale(exact)];
    const figure = panel("compromise", "error without noise over error made by the noise", "shares of the range");
    compromises.push(drawn(figure, {
        scales: { x, y, position: { auto: true } },
        axes: [along(x, "error made by the noise"), along(y)],
        series: [
            { label: NAMES.mean_error_noise, value: shownValue },
            line(NAMES.mean_error_exact, "estimate", { paths: joined, points: dots("estimate") }),
            line(compromise.label, "text", { scale: "position", paths: () => null }),
        ],
        cursor: { drag: { x: false, y: false } },
        hooks: { draw: [(plot) => {
            circle(plot, "study", compromise.own, 7, [4, 2]);
            circle(plot, "text", present(), 10, []);
        }] },
    }, [sorted.map((k) => noise[k]), sorted.map((k) => exact[k]), sorted.map((k) => compromise.values[k])]));
}

// What the marks mean.
function key() {
    const words = document.createElement("p");
    words.className = "hint key";
    const entries = [["study", "the study"]];
    if (data.knob) {
        entries.push(["present", "the slider"]);
    }
    if (isWide) {
        entries.push(["good", compromise.nearly]);
    }
    for (const [name, text] of entries) {
        const entry = document.createElement("span");
        entry.className = name;
        entry.textContent = text;
        words.append(entry, " ");
    }
    document.getElementById("compromise").after(words);
}

// The slider was moved.
function remarked() {
    if (compromise) {
        compromises.forEach((plot) => plot.redraw(false));
        document.querySelectorAll("#tradeoff .wide tbody tr").forEach((row, k) => row.classList.toggle("present", k === present()));
    }
}

/* ---- sliders ---- */

// The largest difference between two runs, in units of each column's largest value.
function difference(found) {
    let worst = 0;
    for (const { header, estimate } of data.quantities.filter((quantity) => found[quantity.header])) {
        const size = estimate.reduce((most, x) => Math.max(most, Math.abs(x ?? 0)), 1e-300);
        estimate.forEach((x, row) => {
            worst = Math.max(worst, Math.abs((found[header][row] ?? 0) - (x ?? 0)) / size);
        });
    }
    return worst;
}

// What a slider stands at, in sight and for readers of the screen.
function inform(id, words) {
    document.getElementById(`${id}-value`).textContent = words;
    document.getElementById(id).setAttribute("aria-valuetext", words);
}

function told() {
    const words = [];
    const { label, positions } = data.knob;
    if (label) {
        const { factor, value } = positions[chosen.position];
        const times = `${Number(factor.toPrecision(3))} × the study's`;
        inform("knob", value === null ? times : `${Number(value.toPrecision(4))} (${times})`);
    }
    data.signals.forEach((signal, k) => {
        if (signal.measured) {
            const sigma = Number((chosen.noise * ranges[k]).toPrecision(2));
            words.push(`${withUnit(`${signal.shown}: ${sigma}`, null)}${signal.unit ? ` ${signal.unit}` : ""}`);
        }
    });
    const some = words.length > 3 ? [...words.slice(0, 3), "…"] : words;
    inform("noise", chosen.noise === 0 ? "none" : some.join(", "));
}

async function rerun() {
    ticket += 1;
    const mine = ticket;
    document.body.dataset.state = "running";
    told();
    remarked();
    const readings = noisy(chosen.noise);
    const done = await run(chosen.position, readings, mine);
    if (done === null) {
        return;
    }
    show(done.columns, readings);
    const { steps } = data.knob.positions[chosen.position];
    const status = [`The observer ran in this page with ${steps}, signals held between samples.`];
    if (chosen.position === data.knob.own && chosen.noise === 0) {
        const off = difference(done.columns);
        status.push(off === 0 ? "It gives what the command gave, to the last bit." : `It gives what the command gave, but for ${off.toExponential(1)} of each curve's largest value.`);
    }
    if (done.ended) {
        status.push(`It stopped: ${done.ended}.`);
    }
    document.getElementById("status").textContent = status.join(" ");
    document.body.dataset.state = "ready";
}

function slider(id, words, most, value, moved) {
    const label = document.createElement("label");
    const name = document.createElement("span");
    name.textContent = words;
    const input = Object.assign(document.createElement("input"), { type: "range", id, min: 0, max: most, step: 1, value });
    // without the value, which is told apart
    input.setAttribute("aria-label", words);
    const output = Object.assign(document.createElement("output"), { id: `${id}-value` });
    input.addEventListener("input", () => {
        moved(Number(input.value));
        rerun();
    });
    label.append(name, output, input);
    return label;
}

// The last position of the second slider, as a share of each reading's range.
const MOST_NOISE = 0.2;

function sliders() {
    const controls = document.getElementById("controls");
    const { label, own, positions } = data.knob;
    if (label) {
        controls.append(slider("knob", label, positions.length - 1, own, (k) => {
            chosen.position = k;
        }));
    }
    controls.append(slider("noise", "noise added to the readings (standard deviation)", 40, 0, (k) => {
        chosen.noise = MOST_NOISE * (k / 40) ** 2;
    }));
    const reset = document.createElement("button");
    reset.textContent = "as in the study";
    reset.addEventListener("click", () => {
        Object.assign(chosen, { position: own, noise: 0 });
        controls.querySelectorAll("input").forEach((input) => {
            input.value = input.id === "knob" ? own : 0;
        });
        rerun();
    });
    controls.append(reset);
}

function begin() {
    const all = document.createElement("button");
    all.textContent = "all of the time";
    all.addEventListener("click", whole);
    const hint = document.createElement("p");
    hint.className = "hint";
    hint.textContent = "Drag across a picture, or spread two fingers on it, to zoom. ";
    hint.append(all);
    document.getElementById("charts").before(hint);
    [...data.quantities, ...data.watches].forEach(chart);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => [...charts.map(({ plot }) => plot), ...compromises].forEach((plot) => plot.redraw(false)));
    if (compromise) {
        overPositions();
        against();
        key();
    }
    if (data.knob) {
        sliders();
        rerun();
    } else {
        remarked();
        show(null, samples);
        document.body.dataset.state = "ready";
    }
}

begin();
