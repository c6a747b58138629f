//! The distillation column in numbers: from text to tape, one evaluation of its right-hand side,
//! one Runge–Kutta step of plant and observer. `BENCHMARKS.md` says what they mean.

use std::collections::{BTreeMap, HashMap};

use divan::Bencher;
use divan::counter::ItemsCount;
use lynkeus_expr::Tape;
use lynkeus_model::{LoadOptions, Plant};
use lynkeus_observers::{Observer, Tuning, find};
use lynkeus_run::{Rk4, System};
use lynkeus_structure::{AugmentedPlant, Sensors};

fn main() {
    divan::main();
}

const TRAYS: [usize; 3] = [12, 100, 1000];

/// The shipped model with one start for every tray, so that it takes any number of them.
fn source() -> String {
    let shipped = include_str!("../../../examples/column/column.mo");
    let (before, rest) = shipped.split_once("start = {").expect("a list of starts");
    let (_, after) = rest.split_once('}').expect("the end of the list");
    format!("{before}each start = 0.5{after}")
}

/// The column with that many trays, the feed two thirds down as in the shipped model.
fn column(source: &str, trays: usize) -> Plant {
    let parameters = BTreeMap::from([
        ("N".to_owned(), trays as f64),
        ("f".to_owned(), (trays * 2 / 3) as f64),
    ]);
    let options = LoadOptions {
        parameters,
        ..LoadOptions::default()
    };
    Plant::from_modelica(source, "column.mo", &options).expect("the shipped model")
}

fn tape(plant: &Plant) -> Tape {
    let states = plant.states.iter().map(|state| state.node);
    let inputs = plant.inputs.iter().map(|input| input.node);
    let symbols: Vec<_> = states.chain(inputs).collect();
    Tape::new(&plant.graph, &symbols, &plant.derivatives).expect("known symbols")
}

#[divan::bench(args = TRAYS)]
fn parse_to_tape(bencher: Bencher<'_, '_>, trays: usize) {
    let text = source();
    bencher
        .counter(ItemsCount::new(trays))
        .bench(|| tape(&column(divan::black_box(&text), trays)));
}

#[divan::bench(args = TRAYS)]
fn right_hand_side(bencher: Bencher<'_, '_>, trays: usize) {
    let plant = column(&source(), trays);
    let mut evaluator = tape(&plant).evaluator();
    let mut inputs = vec![0.5; trays];
    inputs.extend([4.69, 5.94, 0.75]);
    let mut slopes = vec![0.0; trays];
    bencher
        .counter(ItemsCount::new(trays))
        .bench_local(|| evaluator.eval(divan::black_box(&inputs), divan::black_box(&mut slopes)));
}

/// The observer of the shipped study: both products measured, the feed composition unknown.
fn observer(plant: &Plant) -> Observer {
    let sensors = Sensors {
        unknown: vec!["Zf".to_owned()],
        ..Sensors::default()
    };
    let augmented = AugmentedPlant::new(plant, &sensors).expect("an input of the column");
    let family = find("triangular").expect("a family in the list");
    let design = family.design(&augmented, &Tuning::from([("theta", 3.5)]));
    design.expect("two triangular chains").observer
}

/// Plant and observer as one system, the measured outputs taken from the plant.
fn coupled(plant: &Plant) -> System {
    let observer = observer(plant);
    let outputs = plant.outputs.iter().zip(&observer.measured);
    let wires = outputs.map(|(output, measured)| (measured.symbol, output.node));
    let wires: HashMap<_, _> = wires.collect();
    let mut derivatives = plant.derivatives.clone();
    derivatives.extend(plant.graph.substitute(&observer.derivatives, &wires));
    let true_states = plant.states.iter().map(|x| (x.name.clone(), x.node, 0.5));
    let estimates = observer.states.iter();
    let estimates = estimates.map(|(x, start)| (format!("{}_hat", x.name), x.symbol, *start));
    let states: Vec<_> = true_states.chain(estimates).collect();
    let inputs = plant.inputs.iter().map(|u| (u.name.clone(), u.node));
    let inputs: Vec<_> = inputs.collect();
    System::new(
        &plant.graph,
        plant.time,
        &states,
        &inputs,
        &derivatives,
        &[],
    )
    .expect("every symbol is wired")
}

#[divan::bench]
fn rk4_step_of_plant_and_observer(bencher: Bencher<'_, '_>) {
    let system = coupled(&column(&source(), 12));
    let mut evaluation = system.evaluation();
    evaluation
        .signals_mut()
        .copy_from_slice(&[4.69, 5.94, 0.75]);
    let mut rk4 = Rk4::new(system.states().len());
    let mut x = system.start().to_vec();
    bencher.bench_local(|| {
        x.copy_from_slice(system.start());
        rk4.step(&mut evaluation, 0.0, 1e-3, divan::black_box(&mut x))
            .expect("a finite step");
    });
}
