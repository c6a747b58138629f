//! Numbers that a plant and a filter can be written over: real, complex, dual, and texts of Modelica.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// What a smooth expression is made of.
pub trait Number:
    Clone
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    fn of(value: f64) -> Self;
    /// its value, for decisions
    fn real(&self) -> f64;
    fn exp(self) -> Self;
    fn ln(self) -> Self;
    fn sqrt(self) -> Self;
    fn sin(self) -> Self;
    fn cos(self) -> Self;
    fn tanh(self) -> Self;
}

impl Number for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn real(&self) -> f64 {
        *self
    }
    fn exp(self) -> Self {
        self.exp()
    }
    fn ln(self) -> Self {
        self.ln()
    }
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    fn sin(self) -> Self {
        self.sin()
    }
    fn cos(self) -> Self {
        self.cos()
    }
    fn tanh(self) -> Self {
        self.tanh()
    }
}

/// A complex number: with an imaginary part of 10⁻⁴⁰ it carries a derivative that no difference has rounded (W.
/// Squire, G. Trapp, *SIAM Review* 40 (1998) 110–112).
#[derive(Clone, Copy, Debug)]
pub struct Complex(pub f64, pub f64);

/// The imaginary part of a step.
pub const STEP: f64 = 1e-40;

impl Add for Complex {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self(self.0 + b.0, self.1 + b.1)
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        Self(self.0 - b.0, self.1 - b.1)
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        Self(self.0 * b.0 - self.1 * b.1, self.0 * b.1 + self.1 * b.0)
    }
}

impl Div for Complex {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let square = b.0 * b.0 + b.1 * b.1;
        Self(
            (self.0 * b.0 + self.1 * b.1) / square,
            (self.1 * b.0 - self.0 * b.1) / square,
        )
    }
}

impl Neg for Complex {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl Number for Complex {
    fn of(value: f64) -> Self {
        Self(value, 0.0)
    }
    fn real(&self) -> f64 {
        self.0
    }
    fn exp(self) -> Self {
        let size = self.0.exp();
        Self(size * self.1.cos(), size * self.1.sin())
    }
    fn ln(self) -> Self {
        Self(self.0.hypot(self.1).ln(), self.1.atan2(self.0))
    }
    /// Of one whose real part is above 0.
    fn sqrt(self) -> Self {
        let real = (0.5 * (self.0.hypot(self.1) + self.0)).sqrt();
        Self(real, 0.5 * self.1 / real)
    }
    fn sin(self) -> Self {
        let (a, b) = (self.0, self.1);
        Self(a.sin() * b.cosh(), a.cos() * b.sinh())
    }
    fn cos(self) -> Self {
        let (a, b) = (self.0, self.1);
        Self(a.cos() * b.cosh(), -(a.sin() * b.sinh()))
    }
    fn tanh(self) -> Self {
        let (a, b) = (self.0, self.1);
        let sinh = Self(a.sinh() * b.cos(), a.cosh() * b.sin());
        let cosh = Self(a.cosh() * b.cos(), a.sinh() * b.sin());
        sinh / cosh
    }
}

/// A number with its slope in one direction.
#[derive(Clone, Debug)]
pub struct Dual<N>(pub N, pub N);

impl<N: Number> Add for Dual<N> {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self(self.0 + b.0, self.1 + b.1)
    }
}

impl<N: Number> Sub for Dual<N> {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        Self(self.0 - b.0, self.1 - b.1)
    }
}

impl<N: Number> Mul for Dual<N> {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        let slope = self.0.clone() * b.1 + self.1 * b.0.clone();
        Self(self.0 * b.0, slope)
    }
}

impl<N: Number> Div for Dual<N> {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let value = self.0 / b.0.clone();
        let slope = (self.1 - value.clone() * b.1) / b.0;
        Self(value, slope)
    }
}

impl<N: Number> Neg for Dual<N> {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl<N: Number> Number for Dual<N> {
    fn of(value: f64) -> Self {
        Self(N::of(value), N::of(0.0))
    }
    fn real(&self) -> f64 {
        self.0.real()
    }
    fn exp(self) -> Self {
        let value = self.0.exp();
        Self(value.clone(), value * self.1)
    }
    fn ln(self) -> Self {
        Self(self.0.clone().ln(), self.1 / self.0)
    }
    fn sqrt(self) -> Self {
        let value = self.0.sqrt();
        Self(value.clone(), N::of(0.5) * self.1 / value)
    }
    fn sin(self) -> Self {
        Self(self.0.clone().sin(), self.0.cos() * self.1)
    }
    fn cos(self) -> Self {
        Self(self.0.clone().cos(), -(self.0.sin() * self.1))
    }
    fn tanh(self) -> Self {
        let value = self.0.tanh();
        let slope = (N::of(1.0) - value.clone() * value.clone()) * self.1;
        Self(value, slope)
    }
}

/// An expression of Modelica.
#[derive(Clone, Debug)]
pub struct Text(pub String);

macro_rules! texts {
    ($($trait:ident $name:ident $sign:literal),*) => {$(
        impl $trait for Text {
            type Output = Self;
            fn $name(self, b: Self) -> Self {
                Self(format!("({} {} {})", self.0, $sign, b.0))
            }
        }
    )*};
}

texts!(Add add "+", Sub sub "-", Mul mul "*", Div div "/");

impl Neg for Text {
    type Output = Self;
    fn neg(self) -> Self {
        Self(format!("(-{})", self.0))
    }
}

impl Number for Text {
    fn of(value: f64) -> Self {
        Self(format!("({value:?})"))
    }
    fn real(&self) -> f64 {
        f64::NAN
    }
    fn exp(self) -> Self {
        Self(format!("exp({})", self.0))
    }
    fn ln(self) -> Self {
        Self(format!("log({})", self.0))
    }
    fn sqrt(self) -> Self {
        Self(format!("sqrt({})", self.0))
    }
    fn sin(self) -> Self {
        Self(format!("sin({})", self.0))
    }
    fn cos(self) -> Self {
        Self(format!("cos({})", self.0))
    }
    fn tanh(self) -> Self {
        Self(format!("tanh({})", self.0))
    }
}
