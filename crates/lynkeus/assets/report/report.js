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
const line = (label, name, more) => ({ label, stroke: () => color(name), width: 1.5, points: { show: false }, ...more });

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
        list.push([{ label: "reading", stroke: () => color("reading"), paths: () => null, points: { show: true, size: 3, width: 0, fill: () => color("reading") } }, values]);
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

function chart(quantity) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const title = document.createElement("b");
    title.textContent = withUnit(quantity.name, quantity.unit);
    const words = document.createElement("span");
    words.textContent = quantity.description ?? (quantity.meaning ? `below ${quantity.alarm_below}: ${quantity.meaning}` : "");
    const error = document.createElement("span");
    error.className = "error";
    caption.append(title, words, error);
    figure.append(caption);
    document.getElementById("charts").append(figure);
    const list = curves(quantity, null, samples);
    const labels = list.map(([series]) => series.label);
    const high = labels.indexOf("+2 sd") + 1;
    const axis = { stroke: () => color("text"), grid: { stroke: () => color("grid"), width: 1 }, ticks: { stroke: () => color("grid"), width: 1 } };
    const plot = new uPlot({
        width: figure.clientWidth,
        height: 260,
        scales: { x: { time: false }, y: { range: fit } },
        axes: [{ ...axis, label: withUnit("time", data.time_unit), labelSize: 20, size: 36 }, { ...axis, size: 64 }],
        series: [{ label: "time" }, ...list.map(([series]) => series)],
        bands: high > 0 ? [{ series: [high, high + 1], fill: () => color("band") }] : [],
        cursor: { sync: { key: "time", filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } }, drag: { x: true, y: false } },
        hooks: { setScale: [zoomed], ready: [pinch] },
    }, [data.time, ...list.map(([, values]) => values)], figure);
    charts.push({ quantity, plot, error });
    new ResizeObserver(() => plot.setSize({ width: figure.clientWidth, height: 260 })).observe(figure);
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

function told() {
    const words = [];
    const { label, positions } = data.knob;
    if (label) {
        const { factor, value } = positions[chosen.position];
        const times = `${Number(factor.toPrecision(3))} × the study's`;
        document.getElementById("knob-value").textContent = value === null ? times : `${Number(value.toPrecision(4))} (${times})`;
    }
    data.signals.forEach((signal, k) => {
        if (signal.measured) {
            const sigma = Number((chosen.noise * ranges[k]).toPrecision(2));
            words.push(`${withUnit(`${signal.shown}: ${sigma}`, null)}${signal.unit ? ` ${signal.unit}` : ""}`);
        }
    });
    const some = words.length > 3 ? [...words.slice(0, 3), "…"] : words;
    document.getElementById("noise-value").textContent = chosen.noise === 0 ? "none" : some.join(", ");
}

async function rerun() {
    ticket += 1;
    const mine = ticket;
    document.body.dataset.state = "running";
    told();
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
        const name = label === "theta" ? "θ" : label;
        controls.append(slider("knob", name, positions.length - 1, own, (k) => {
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
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => charts.forEach(({ plot }) => plot.redraw(false)));
    if (data.knob) {
        sliders();
        rerun();
    } else {
        show(null, samples);
        document.body.dataset.state = "ready";
    }
}

begin();
