// The page of a service: what it told last, and each line as it comes.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const KEPT = 600;
const token = new URLSearchParams(location.search).get("token");
const byId = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// by time, the last line of each row and its innovations, in the order of time
let rows = [];
let charts = [];
let innovations = [];
let trials = [];
let source = null;
let due = false;

function seconds(t) {
    return typeof t === "number" ? t : Date.parse(t.endsWith("Z") ? t : t + "Z") / 1000;
}

// The row of a time, which is made where it is new.
function at(t) {
    let place = rows.length;
    while (place > 0 && rows[place - 1].t > t) place--;
    if (place > 0 && rows[place - 1].t === t) return rows[place - 1];
    const row = { t, line: {}, innovations: {} };
    rows.splice(place, 0, row);
    if (rows.length > KEPT) rows.shift();
    return row;
}

// A row, or the correction of one; its innovations.
function take(line) {
    const row = at(seconds(line[data.time]));
    if (line.innovations) row.innovations = line.innovations;
    else row.line = line;
    if (!due) {
        due = true;
        requestAnimationFrame(draw);
    }
}

function columns(told) {
    const values = rows.map(({ line }) => line[told.header] ?? null);
    if (!told.deviation) return [rows.map((row) => row.t), values];
    const side = (sign) => rows.map(({ line }, i) => values[i] + sign * 2 * line[told.deviation]);
    return [rows.map((row) => row.t), side(-1), side(1), values];
}

// Innovations in their deviations, between 2 of them to either side.
function judged(sensor) {
    const each = rows.map((row) => row.innovations[sensor] ?? null);
    const band = (level) => rows.map(() => level);
    return [rows.map((row) => row.t), band(-2), band(2), each.map((own) => own && own[0] / own[1])];
}

function heading(text, room) {
    const head = document.createElement("h3");
    head.textContent = text;
    const place = document.createElement("div");
    const card = document.createElement("section");
    card.append(head, place);
    room.append(card);
    return place;
}

function plot(room, hasBand, label, values, more = []) {
    const band = hasBand
        ? [
              { label: "− 2 sd", stroke: "transparent", points: { show: false } },
              { label: "+ 2 sd", stroke: "transparent", points: { show: false } },
          ]
        : [];
    const isDate = rows.some(({ line }) => typeof line[data.time] === "string");
    const axis = { stroke: css("--faint"), grid: { stroke: css("--grid"), width: 1 } };
    return new uPlot(
        {
            width: Math.max(280, room.clientWidth),
            height: 220,
            scales: { x: { time: isDate } },
            series: [{ label: "t" }, ...band, { label, stroke: css("--estimate"), width: 2, points: { show: false } }, ...more],
            bands: hasBand ? [{ series: [2, 1], fill: css("--band") }] : [],
            axes: [axis, { ...axis, size: 70 }],
        },
        values,
        room,
    );
}

function titled(told) {
    const unit = told.unit ? ` [${told.unit}]` : "";
    return told.name + unit + (told.description ? ": " + told.description : "");
}

function chart(told) {
    return plot(heading(titled(told), byId("charts")), told.deviation, "estimate", columns(told));
}

// Where the plant is, and whether that is in the box for which everything is decided.
function now(line) {
    const cells = (kind, texts) => {
        const row = document.createElement("tr");
        row.append(
            ...texts.map((text) => {
                const cell = document.createElement(kind);
                cell.textContent = text;
                return cell;
            }),
        );
        return row;
    };
    const digits = (x) => Number(x.toPrecision(5)).toString();
    const row = (told) => {
        const [low, high] = told.range;
        const x = line[told.header];
        const sd = told.deviation ? line[told.deviation] : null;
        const far = (sign) => x + sign * 2 * (sd ?? 0);
        const isIn = (y) => y >= (low ?? -Infinity) && y <= (high ?? Infinity);
        const where = isIn(far(-1)) && isIn(far(1)) ? "inside" : isIn(x) ? "perhaps outside" : "outside";
        const unit = told.unit ? ` ${told.unit}` : "";
        const range = `${low ?? "− ∞"} to ${high ?? "∞"}`;
        return cells("td", [told.name, digits(x) + (sd === null ? "" : ` ± ${digits(2 * sd)}`) + unit, range, where]);
    };
    byId("now").replaceChildren(cells("th", ["quantity", "now, ± 2 sd", "declared range", "where it is"]), ...data.told.map(row));
}

function draw() {
    due = false;
    const { line } = rows.findLast((row) => row.line[data.time] !== undefined) ?? {};
    if (!line) return;
    if (charts.length === 0) charts = data.told.map(chart);
    else charts.forEach((plot, i) => plot.setData(columns(data.told[i])));
    const isJudged = rows.some((row) => Object.keys(row.innovations).length > 0);
    if (innovations.length > 0) innovations.forEach((plot, i) => plot.setData(judged(data.sensors[i])));
    else if (isJudged) innovations = data.sensors.map((name) => plot(heading(name, byId("innovations")), true, "innovation / sd", judged(name)));
    now(line);
    const verdict = byId("verdict");
    verdict.textContent = line.credible ? "credible" : "not credible";
    verdict.style.color = css(line.credible ? "--yes" : "--no");
    byId("notes").replaceChildren(
        ...(line.notes ?? []).map((note) => {
            const item = document.createElement("li");
            item.textContent = note;
            return item;
        }),
    );
    byId("status").textContent = "row at " + line[data.time];
}

function asking(what) {
    const query = new URLSearchParams(what);
    if (token) query.set("token", token);
    return query;
}

// The same rows with another tuning, by a copy of the estimator.
async function attempt(event) {
    event.preventDefault();
    const [key, value] = [byId("key").value, byId("value").value];
    byId("tried").textContent = "…";
    const asset = choice.value;
    const found = await fetch("try?" + asking({ asset, key, value }), { method: "POST" })
        .then((answer) => answer.json())
        .catch(() => ({ error: "no answer" }));
    if (asset !== choice.value) return;
    trials.forEach((plot) => plot.destroy());
    byId("trials").replaceChildren();
    if (found.error) {
        trials = [];
        byId("tried").textContent = found.error;
        return;
    }
    const { present, tried } = found;
    const count = (own) => `${own.credible} of ${own.time.length} rows`;
    byId("tried").textContent = `credible in ${count(tried)}; as it is, from the same start, in ${count(present)}`;
    trials = data.told.map((told) => {
        const one = tried[told.header];
        const sd = tried[told.deviation];
        const side = (sign) => one.map((x, i) => x + sign * 2 * sd[i]);
        const band = told.deviation ? [side(-1), side(1)] : [];
        const beside = { label: "as it is", stroke: css("--faint"), width: 1, points: { show: false } };
        return plot(heading(titled(told), byId("trials")), told.deviation, "tried", [tried.time.map(seconds), ...band, one, present[told.header]], [beside]);
    });
}

async function prove() {
    const answer = await fetch("proved?" + asking({})).catch(() => null);
    if (answer?.ok) byId("proved").innerHTML = await answer.text();
    else setTimeout(prove, 5000);
}

// A browser tries again by itself where a connection is lost, but not where something else answers: a proxy in front of a
// service that starts again, a service with too many listeners.
function listen(query) {
    const own = new EventSource("events?" + query);
    source = own;
    own.onmessage = (event) => take(JSON.parse(event.data));
    own.addEventListener("innovations", own.onmessage);
    own.onerror = () => {
        byId("status").textContent = "no connection; trying again";
        const again = () => own === source && listen(query);
        if (own.readyState === EventSource.CLOSED) setTimeout(again, 2000);
    };
}

function follow(asset) {
    source?.close();
    rows = [];
    [...charts, ...innovations, ...trials].forEach((plot) => plot.destroy());
    [charts, innovations, trials] = [[], [], []];
    ["charts", "innovations", "trials"].forEach((id) => byId(id).replaceChildren());
    byId("tried").textContent = "";
    listen(asking({ asset, with: "innovations" }));
}

const choice = byId("asset");
choice.append(...data.assets.map((name) => new Option(name || "the plant", name)));
choice.hidden = data.assets.length < 2;
choice.onchange = () => follow(choice.value);
addEventListener("resize", () => [...charts, ...innovations, ...trials].forEach((plot) => plot.setSize({ width: Math.max(280, plot.root.parentElement.clientWidth), height: 220 })));
byId("key").append(...data.keys.map((key) => new Option(key, key)));
byId("trial").hidden = data.keys.length === 0;
byId("trial").onsubmit = (event) => void attempt(event);
follow(choice.value);
void prove();
