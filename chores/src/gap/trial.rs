//! Plant and estimate from several starts in the box: does the error vanish?

use super::rows::Row;
use super::study::Text;
use super::tool::{self, Certificate};

/// Starts per row.
const STARTS: usize = 6;
/// Starts drawn before giving up on a plant that leaves its box.
const DRAWS: usize = 300;
/// The error has vanished below this share of the first.
const VANISHED: f64 = 0.01;
/// The simulation goes on beyond the time limit by this factor.
const LONGER: f64 = 1.25;

/// Where plant and estimate start, with what inputs, and how wide the box is.
pub struct Start {
    plant: Vec<(String, f64)>,
    estimate: Vec<(String, f64)>,
    inputs: Vec<(String, String)>,
    widths: Vec<(String, f64)>,
}

/// Starts from which the plant itself stays in the box.
pub fn starts(row: &Row, text: &Text, box_: &Certificate) -> Result<Vec<Start>, String> {
    let shipped = tool::simulate(&text.scaled(1.0)).ok_or("the study cannot be simulated")?;
    let truth = |name: &str| shipped.iter().find(|(n, _)| n == name).map(|(_, x)| x[0]);
    let hats = shipped.iter().filter_map(|(n, _)| n.strip_suffix("_hat"));
    let sides: Option<Vec<Side>> = hats
        .map(|name| {
            let (low, high) = box_.range(name)?;
            let centre = truth(name)?.clamp(low, high);
            let name = name.to_owned();
            Some(Side {
                name,
                low,
                high,
                centre,
            })
        })
        .collect();
    let sides = sides.ok_or("a range of the box is missing")?;
    let mut random = Random(20_020_514);
    let mut found = vec![];
    for _ in 0..DRAWS {
        let start = drawn(row, text, &sides, &mut random);
        if stays(row, text, &sides, &start) {
            found.push(start);
        }
        if found.len() == STARTS {
            return Ok(found);
        }
    }
    Err(format!(
        "{}: only {} starts stay in the box",
        row.study,
        found.len()
    ))
}

struct Side {
    name: String,
    low: f64,
    high: f64,
    centre: f64,
}

fn drawn(row: &Row, text: &Text, sides: &[Side], random: &mut Random) -> Start {
    let mut draw = |spread: f64| -> Vec<(String, f64)> {
        let value = |side: &Side| {
            let anywhere = side.low + random.next() * (side.high - side.low);
            let unknown = row.unknown.contains(&side.name.as_str());
            let spread = if unknown { 1.0 } else { spread };
            (
                side.name.clone(),
                side.centre + spread * (anywhere - side.centre),
            )
        };
        sides.iter().map(value).collect()
    };
    let (plant, estimate) = (draw(row.spread), draw(row.spread));
    let is_unknown = |(name, _): &(String, f64)| row.unknown.contains(&name.as_str());
    let (constant, plant) = plant.into_iter().partition::<Vec<_>, _>(is_unknown);
    Start {
        inputs: text.inputs_with(&constant),
        plant,
        estimate,
        widths: sides
            .iter()
            .map(|s| (s.name.clone(), s.high - s.low))
            .collect(),
    }
}

/// Whether the plant stays in the box, its estimate being right from the start.
fn stays(row: &Row, text: &Text, sides: &[Side], start: &Start) -> bool {
    let study = Text::simulation(
        &text.scaled(1.0),
        &start.inputs,
        LONGER * row.by,
        (&start.plant, &start.plant),
    );
    let Some(columns) = tool::simulate(&study) else {
        return false;
    };
    let inside = |side: &Side| {
        let values = columns.iter().find(|(name, _)| *name == side.name);
        let slack = 1e-9 * (side.high - side.low);
        let fits = |x: &f64| *x >= side.low - slack && *x <= side.high + slack;
        values.is_some_and(|(_, values)| values.iter().all(fits))
    };
    sides.iter().all(inside)
}

/// Whether the error, scaled by the box, falls and stays below a hundredth from every
/// start.
pub fn converges(row: &Row, study: &str, starts: &[Start]) -> bool {
    starts.iter().all(|start| {
        let until = LONGER * row.by;
        let starts = (&start.plant[..], &start.estimate[..]);
        let study = Text::simulation(study, &start.inputs, until, starts);
        tool::simulate(&study).is_some_and(|columns| vanishes(row, &columns, &start.widths))
    })
}

fn vanishes(row: &Row, columns: &[(String, Vec<f64>)], widths: &[(String, f64)]) -> bool {
    let column = |name: &str| columns.iter().find(|(n, _)| n == name).map(|(_, x)| &x[..]);
    let (Some(times), true) = (column("t"), !widths.is_empty()) else {
        return false;
    };
    let error = |at: usize| {
        let share = |(name, width): &(String, f64)| {
            let (truth, hat) = (column(name)?, column(&format!("{name}_hat"))?);
            Some((truth[at] - hat[at]).abs() / width)
        };
        widths.iter().filter_map(share).fold(0.0, f64::max)
    };
    let late = (0..times.len()).filter(|&at| times[at] >= row.by);
    late.map(error).all(|e| e <= VANISHED * error(0))
}

/// Numbers in [0, 1) from a seed (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
