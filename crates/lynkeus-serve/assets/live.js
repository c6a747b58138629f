// The page of a service: what it told last, and each line as it comes.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const KEPT = 600;
const token = new URLSearchParams(location.search).get("token");
const byId = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// by time, the last line of each row, in the order of time
let rows = [];
let charts = [];
let source = null;
let due = false;

function seconds(t) {
    return typeof t === "number" ? t : Date.parse(t.endsWith("Z") ? t : t + "Z") / 1000;
}

// A row, or the correction of one.
function take(line) {
    const t = seconds(line[data.time]);
    let place = rows.length;
    while (place > 0 && rows[place - 1].t > t) place--;
    if (place > 0 && rows[place - 1].t === t) rows[place - 1].line = line;
    else rows.splice(place, 0, { t, line });
    if (rows.length > KEPT) rows.shift();
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

function chart(told) {
    const unit = told.unit ? ` [${told.unit}]` : "";
    const band = told.deviation
        ? [
              { label: "− 2 sd", stroke: "transparent", points: { show: false } },
              { label: "+ 2 sd", stroke: "transparent", points: { show: false } },
          ]
        : [];
    const heading = document.createElement("h3");
    heading.textContent = told.name + unit + (told.description ? ": " + told.description : "");
    const room = document.createElement("div");
    byId("charts").append(heading, room);
    const isDate = rows.length > 0 && typeof rows[0].line[data.time] !== "number";
    const axis = { stroke: css("--faint"), grid: { stroke: css("--grid"), width: 1 } };
    return new uPlot(
        {
            width: Math.max(280, room.clientWidth),
            height: 220,
            scales: { x: { time: isDate } },
            series: [{ label: "t" }, ...band, { label: "estimate", stroke: css("--estimate"), width: 2, points: { show: false } }],
            bands: told.deviation ? [{ series: [2, 1], fill: css("--band") }] : [],
            axes: [axis, { ...axis, size: 70 }],
        },
        columns(told),
        room,
    );
}

function draw() {
    due = false;
    if (rows.length === 0) return;
    if (charts.length === 0) charts = data.told.map(chart);
    else charts.forEach((plot, i) => plot.setData(columns(data.told[i])));
    const { line } = rows[rows.length - 1];
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

function follow(asset) {
    source?.close();
    rows = [];
    charts.forEach((plot) => plot.destroy());
    charts = [];
    byId("charts").replaceChildren();
    const query = new URLSearchParams({ asset });
    if (token) query.set("token", token);
    source = new EventSource("events?" + query);
    source.onmessage = (event) => take(JSON.parse(event.data));
    source.onerror = () => (byId("status").textContent = "no connection; trying again");
}

const choice = byId("asset");
choice.append(...data.assets.map((name) => new Option(name || "the plant", name)));
choice.hidden = data.assets.length < 2;
choice.onchange = () => follow(choice.value);
addEventListener("resize", () => charts.forEach((plot) => plot.setSize({ width: Math.max(280, plot.root.parentElement.clientWidth), height: 220 })));
follow(choice.value);
