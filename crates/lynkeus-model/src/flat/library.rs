//! What is known here of the Modelica library: physical types and constants.

use crate::syntax::ast::LibraryType;

/// The type of this full name.
pub(crate) fn type_named(full: &str) -> Option<LibraryType> {
    let packages = ["Modelica.Units.SI.", "Modelica.SIunits."];
    let name = packages
        .iter()
        .find_map(|package| full.strip_prefix(package))?;
    let mut types = TYPES.iter();
    types.find_map(|&(unit, min, names)| {
        let known = names.split(' ').any(|known| known == name);
        known.then_some(LibraryType { unit, min })
    })
}

/// The constant of this full name.
pub(crate) fn constant(full: &str) -> Option<f64> {
    use std::f64::consts::{E, PI};
    let value = match full.strip_prefix("Modelica.Constants.")? {
        "pi" => PI,
        "e" => E,
        "D2R" => PI / 180.0,
        "R2D" => 180.0 / PI,
        "gamma" => 0.577_215_664_901_532_9,
        "eps" => f64::EPSILON,
        "small" => 1e-60,
        "inf" => 1e60,
        "Integer_inf" => 2_147_483_647.0,
        "c" => 299_792_458.0,
        "g_n" => 9.80665,
        "G" => 6.674_3e-11,
        "F" => 1.602_176_634e-19 * 6.022_140_76e23,
        "h" => 6.626_070_15e-34,
        "k" => 1.380_649e-23,
        "R" => 1.380_649e-23 * 6.022_140_76e23,
        "sigma" => 5.670_374_419e-8,
        "N_A" => 6.022_140_76e23,
        "q" => 1.602_176_634e-19,
        "mu_0" => 1.256_637_062_12e-6,
        "epsilon_0" => 8.854_187_812_8e-12,
        "T_zero" => -273.15,
        _ => return None,
    };
    Some(value)
}

/// Units and smallest values with the names of the types that have them.
const TYPES: [(&str, Option<f64>, &str); 63] = [
    ("1", None, "DimensionlessRatio ReynoldsNumber"),
    ("1", Some(0.0), "Efficiency MassFraction MoleFraction"),
    ("1/K", None, "LinearTemperatureCoefficient"),
    ("A", None, "Current ElectricCurrent"),
    ("A/m", None, "MagneticFieldStrength"),
    ("C", None, "ElectricCharge"),
    ("F", Some(0.0), "Capacitance"),
    ("H", Some(0.0), "Inductance"),
    ("Hz", None, "Frequency"),
    ("J", None, "Energy Enthalpy Heat InternalEnergy Work"),
    ("J/(kg.K)", None, "SpecificEntropy SpecificHeatCapacity"),
    ("J/(kg.K)", None, "SpecificHeatCapacityAtConstantPressure"),
    ("J/(kg.K)", None, "SpecificHeatCapacityAtConstantVolume"),
    ("J/K", None, "Entropy HeatCapacity"),
    (
        "J/kg",
        None,
        "SpecificEnergy SpecificEnthalpy SpecificInternalEnergy",
    ),
    ("K", None, "TemperatureDifference"),
    ("K", Some(0.0), "Temperature ThermodynamicTemperature"),
    ("K/W", None, "ThermalResistance"),
    ("K/s", None, "TemperatureSlope"),
    ("N", None, "Force"),
    ("N.m", None, "Torque"),
    ("N.m.s/rad", Some(0.0), "RotationalDampingConstant"),
    ("N.m/rad", Some(0.0), "RotationalSpringConstant"),
    ("N.s/m", Some(0.0), "TranslationalDampingConstant"),
    ("N/m", Some(0.0), "TranslationalSpringConstant"),
    ("Ohm", None, "Resistance"),
    ("Ohm.m", None, "Resistivity"),
    ("Pa", None, "Pressure PressureDifference"),
    ("Pa", Some(0.0), "AbsolutePressure"),
    ("Pa.s", Some(0.0), "DynamicViscosity"),
    ("S", None, "Conductance"),
    ("T", None, "MagneticFluxDensity"),
    ("V", None, "ElectricPotential PotentialDifference Voltage"),
    ("V/m", None, "ElectricFieldStrength"),
    ("W", None, "EnthalpyFlowRate HeatFlowRate Power"),
    ("W/(m.K)", None, "ThermalConductivity"),
    ("W/(m2.K)", None, "CoefficientOfHeatTransfer"),
    ("W/K", None, "ThermalConductance"),
    ("W/m2", None, "HeatFlux Irradiance"),
    ("Wb", None, "MagneticFlux"),
    ("kg", Some(0.0), "Mass"),
    ("kg.m/s", None, "Momentum"),
    ("kg.m2", None, "Inertia MomentOfInertia"),
    ("kg/m3", Some(0.0), "Density"),
    ("kg/mol", Some(0.0), "MolarMass"),
    ("kg/s", None, "MassFlowRate"),
    ("m", None, "Length Position"),
    (
        "m",
        Some(0.0),
        "Breadth Diameter Distance Height Radius Thickness",
    ),
    ("m/s", None, "Speed Velocity"),
    ("m/s2", None, "Acceleration"),
    ("m2", None, "Area"),
    ("m2/s", Some(0.0), "KinematicViscosity"),
    ("m3", None, "Volume"),
    ("m3/kg", Some(0.0), "SpecificVolume"),
    ("m3/mol", Some(0.0), "MolarVolume"),
    ("m3/s", None, "VolumeFlowRate"),
    ("mol", Some(0.0), "AmountOfSubstance"),
    ("mol/m3", None, "Concentration"),
    ("mol/s", None, "MolarFlowRate"),
    ("rad", None, "Angle"),
    ("rad/s", None, "AngularFrequency AngularVelocity"),
    ("rad/s2", None, "AngularAcceleration"),
    ("s", None, "Duration Period Time"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_and_constants_by_their_full_names() {
        assert_eq!(type_named("Modelica.Units.SI.Voltage").unwrap().unit, "V");
        assert_eq!(type_named("Modelica.SIunits.Mass").unwrap().min, Some(0.0));
        assert!(type_named("Voltage").is_none());
        // the molar gas constant, 8.31446261815324 J/(mol K), exact since 2019
        let gas = constant("Modelica.Constants.R").unwrap();
        assert!((gas - 8.314_462_618_153_24).abs() < 1e-14);
        assert!(constant("Modelica.Constants.nothing").is_none());
    }
}
