//! Plants read from a Modelica subset or from `@ODEmodel` texts; every diagnostic points at the
//! source line.
//!
//! A [`Plant`] is a system x′ = f(t, x, u), y = h(t, x, u) over one expression graph. It is
//! written in Modelica, or in Rust as functions over expressions; both give the same plant. A
//! third way is the notation of StructuralIdentifiability.jl: [`Plant::from_ode_model`].
//!
//! ```
//! use lynkeus_expr::Tape;
//! use lynkeus_model::{LoadOptions, Model, Plant, Variable};
//!
//! let text = r#"
//! model Tank "A tank that a pump fills"
//!   parameter Real k = 0.04;
//!   input Real pump(unit = "V", min = 0, max = 10);
//!   Real h(start = 4, min = 0.05, max = 10) "Level";
//!   output Real y = h;
//! equation
//!   der(h) = pump - k*sqrt(h);
//! end Tank;
//! "#;
//! let from_text = Plant::from_modelica(text, "tank.mo", &LoadOptions::default())?;
//!
//! let model = Model::new("Tank");
//! let within = |min, max| move |of: &mut Variable| (of.min, of.max) = (min, max);
//! let pump = model.input("pump", within(0.0, 10.0));
//! let h = model.state("h", |h| {
//!     within(0.05, 10.0)(h);
//!     h.start = Some(4.0);
//! });
//! model.der(h, pump - 0.04 * h.sqrt());
//! model.output("y", h, |y| y.unit = Some("m".into()));
//! let from_rust = model.finish()?;
//!
//! for plant in [from_text, from_rust] {
//!     let tape = Tape::new(
//!         &plant.graph,
//!         &[plant.states[0].node, plant.inputs[0].node],
//!         &plant.derivatives,
//!     )?;
//!     let mut slope = [0.0];
//!     tape.evaluator().eval(&[4.0, 1.0], &mut slope);
//!     assert_eq!(slope, [1.0 - 0.04 * 2.0]);
//!     assert_eq!((plant.states[0].min, plant.inputs[0].max), (0.05, 10.0));
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The subset
//!
//! One or more `model`s in a file, alone or in `package`s, flat as a compiler writes them or
//! with functions, records, types and base classes of the same file; with `Real` and `Integer` declarations (`parameter`,
//! `constant`, `input`, `output`, arrays of any rank, the attributes `start`, `fixed`, `min`,
//! `max`, `nominal` and `unit`), declaration equations, and an `equation` section of scalar and array
//! equations, `for` loops, and `if` equations with the same number of equations in every
//! branch. Expressions have the operators of Modelica, `if` expressions, array constructors,
//! comprehensions, slices, `time`, and the functions of [`parse_expression`].
//!
//! Derivatives may carry a factor (`H[i]*der(x[i]) = …`) or be coupled linearly (a mass
//! matrix). Algebraic variables are sorted, linear loops solved, and states that follow from
//! others given up; every other variable than states and inputs becomes
//! an expression over these. What is refused is refused by a [`Diagnostic`] with the line, a
//! caret and a hint; hostile text ends in one as well, within bounded time and memory.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod balance;
mod builder;
mod diagnostic;
mod elaborate;
mod flat;
mod limits;
mod load;
mod names;
mod ode_model;
mod plant;
mod syntax;
mod units;

pub use builder::{Model, ModelError};
pub use diagnostic::{Diagnostic, LoadError, Span};
pub use elaborate::{DELAY_STATES, MAX_DELAY_STATES};
pub use load::{model_names, parse_expression};
pub use plant::{
    Assertion, Clause, Delay, Home, LoadOptions, Parameter, Plant, Tables, Timer, Variable, Whens,
};
pub use units::BaseUnit;
