//! −log L of random plants as a study makes it, beside an extended filter that is written anew: its derivatives by
//! complex steps, its second ones by complex steps of dual numbers.
//!
//! `cargo test --release -p lynkeus --test likelihood -- --ignored --nocapture` tells how far they are apart.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod filter;
#[path = "../normal/mod.rs"]
mod normal;
mod number;
mod plant;

use lynkeus::{LikelihoodFunction, Study, Table};

use number::{Complex, Dual, STEP};
use plant::Plant;

/// What the engine makes of it.
fn function(plant: &Plant) -> LikelihoodFunction {
    let mut study = Study::parse(&plant.study(), "study.toml").unwrap();
    study.plant = Some("plant.mo".into());
    study.plant_text = Some(plant.modelica().into());
    let table = Table::parse(&plant.csv(), "log.csv").unwrap();
    lynkeus::likelihood(&study, &[table])
        .unwrap_or_else(|e| panic!("{e}\n{}\n{}", plant.study(), plant.modelica()))
}

/// The largest differences.
#[derive(Debug, Default)]
struct Apart {
    value: f64,
    gradient: f64,
    hessian: f64,
    /// readings at an end, and missing ones
    at_end: usize,
    missing: usize,
}

impl Apart {
    fn count(&mut self, seed: u64) {
        let plant = Plant::new(seed);
        let mut function = function(&plant);
        let theta = &plant.values;
        let point = function.at(theta).unwrap();
        let hessian = function.hessian(theta).unwrap();
        let n = theta.len();
        assert_eq!(function.names().len(), n, "seed {seed}");
        let value = filter::nll(&plant, theta);
        let off = (point.nll - value).abs() / (1.0 + value.abs());
        self.value = self.value.max(off);
        // what a standard deviation changes, or all of the value
        let size = |i: usize| point.information[i * n + i].sqrt().max(1.0 / theta[i]);
        for p in 0..n {
            let stepped = |i: usize| Complex(theta[i], if i == p { STEP } else { 0.0 });
            let stepped: Vec<Complex> = (0..n).map(stepped).collect();
            let exact = filter::nll(&plant, &stepped).1 / STEP;
            let off = (point.gradient[p] - exact).abs() / exact.abs().max(size(p));
            self.gradient = self.gradient.max(off);
            for q in 0..n {
                let along = |(i, at): (usize, &Complex)| {
                    Dual(*at, Complex(f64::from(u8::from(i == q)), 0.0))
                };
                let along: Vec<Dual<Complex>> = stepped.iter().enumerate().map(along).collect();
                let exact = filter::nll(&plant, &along).1.1 / STEP;
                let off = (hessian[p * n + q] - exact).abs();
                let off = off / exact.abs().max(size(p) * size(q));
                self.hessian = self.hessian.max(off);
            }
        }
        for (i, sensor) in plant.sensors.iter().enumerate() {
            let readings = plant.log.iter().map(|record| record.readings[i]);
            let is_end = |y: Option<f64>| y.is_some_and(|y| sensor.limit.is_some_and(|l| y >= l));
            self.at_end += readings.clone().filter(|y| is_end(*y)).count();
            self.missing += readings.filter(Option::is_none).count();
        }
    }
}

fn compare(seeds: std::ops::Range<u64>) {
    let mut apart = Apart::default();
    let plants = seeds.end - seeds.start;
    seeds.for_each(|seed| apart.count(seed));
    println!("{plants} plants: {apart:?}");
    assert!(apart.value < 1e-11 && apart.gradient < 1e-8 && apart.hessian < 1e-5);
    assert!(apart.at_end as u64 > plants && apart.missing as u64 > 10 * plants);
}

#[test]
fn derivatives_are_exact() {
    compare(0..20);
}

#[test]
#[ignore = "a minute"]
fn derivatives_of_two_hundred_plants_are_exact() {
    compare(0..200);
}
