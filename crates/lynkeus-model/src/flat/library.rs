//! What is known here of the Modelica library: physical types and constants.

/// A type of `Modelica.Units.SI`.
#[derive(Debug, PartialEq)]
pub(crate) struct LibraryType {
    name: &'static str,
    pub unit: &'static str,
    pub min: Option<f64>,
}

/// The type of this full name.
pub(crate) fn type_named(full: &str) -> Option<&'static LibraryType> {
    let name = ["Modelica.Units.SI.", "Modelica.SIunits."]
        .iter()
        .find_map(|package| full.strip_prefix(package))?;
    TYPES.iter().find(|known| known.name == name)
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

const fn of(name: &'static str, unit: &'static str, min: Option<f64>) -> LibraryType {
    LibraryType { name, unit, min }
}

const TYPES: [LibraryType; 93] = [
    of("AbsolutePressure", "Pa", Some(0.0)),
    of("Acceleration", "m/s2", None),
    of("AmountOfSubstance", "mol", Some(0.0)),
    of("Angle", "rad", None),
    of("AngularAcceleration", "rad/s2", None),
    of("AngularFrequency", "rad/s", None),
    of("AngularVelocity", "rad/s", None),
    of("Area", "m2", None),
    of("Breadth", "m", Some(0.0)),
    of("Capacitance", "F", Some(0.0)),
    of("CoefficientOfHeatTransfer", "W/(m2.K)", None),
    of("Concentration", "mol/m3", None),
    of("Conductance", "S", None),
    of("Current", "A", None),
    of("Density", "kg/m3", Some(0.0)),
    of("Diameter", "m", Some(0.0)),
    of("DimensionlessRatio", "1", None),
    of("Distance", "m", Some(0.0)),
    of("Duration", "s", None),
    of("DynamicViscosity", "Pa.s", Some(0.0)),
    of("Efficiency", "1", Some(0.0)),
    of("ElectricCharge", "C", None),
    of("ElectricCurrent", "A", None),
    of("ElectricFieldStrength", "V/m", None),
    of("ElectricPotential", "V", None),
    of("Energy", "J", None),
    of("Enthalpy", "J", None),
    of("EnthalpyFlowRate", "W", None),
    of("Entropy", "J/K", None),
    of("Force", "N", None),
    of("Frequency", "Hz", None),
    of("Heat", "J", None),
    of("HeatCapacity", "J/K", None),
    of("HeatFlowRate", "W", None),
    of("HeatFlux", "W/m2", None),
    of("Height", "m", Some(0.0)),
    of("Inductance", "H", Some(0.0)),
    of("Inertia", "kg.m2", None),
    of("InternalEnergy", "J", None),
    of("Irradiance", "W/m2", None),
    of("KinematicViscosity", "m2/s", Some(0.0)),
    of("Length", "m", None),
    of("LinearTemperatureCoefficient", "1/K", None),
    of("MagneticFieldStrength", "A/m", None),
    of("MagneticFlux", "Wb", None),
    of("MagneticFluxDensity", "T", None),
    of("Mass", "kg", Some(0.0)),
    of("MassFlowRate", "kg/s", None),
    of("MassFraction", "1", Some(0.0)),
    of("MolarFlowRate", "mol/s", None),
    of("MolarMass", "kg/mol", Some(0.0)),
    of("MolarVolume", "m3/mol", Some(0.0)),
    of("MoleFraction", "1", Some(0.0)),
    of("MomentOfInertia", "kg.m2", None),
    of("Momentum", "kg.m/s", None),
    of("Period", "s", None),
    of("Position", "m", None),
    of("PotentialDifference", "V", None),
    of("Power", "W", None),
    of("Pressure", "Pa", None),
    of("PressureDifference", "Pa", None),
    of("Radius", "m", Some(0.0)),
    of("Resistance", "Ohm", None),
    of("Resistivity", "Ohm.m", None),
    of("ReynoldsNumber", "1", None),
    of("RotationalDampingConstant", "N.m.s/rad", Some(0.0)),
    of("RotationalSpringConstant", "N.m/rad", Some(0.0)),
    of("SpecificEnergy", "J/kg", None),
    of("SpecificEnthalpy", "J/kg", None),
    of("SpecificEntropy", "J/(kg.K)", None),
    of("SpecificHeatCapacity", "J/(kg.K)", None),
    of("SpecificHeatCapacityAtConstantPressure", "J/(kg.K)", None),
    of("SpecificHeatCapacityAtConstantVolume", "J/(kg.K)", None),
    of("SpecificInternalEnergy", "J/kg", None),
    of("SpecificVolume", "m3/kg", Some(0.0)),
    of("Speed", "m/s", None),
    of("Temperature", "K", Some(0.0)),
    of("TemperatureDifference", "K", None),
    of("TemperatureSlope", "K/s", None),
    of("ThermalConductance", "W/K", None),
    of("ThermalConductivity", "W/(m.K)", None),
    of("ThermalResistance", "K/W", None),
    of("ThermodynamicTemperature", "K", Some(0.0)),
    of("Thickness", "m", Some(0.0)),
    of("Time", "s", None),
    of("Torque", "N.m", None),
    of("TranslationalDampingConstant", "N.s/m", Some(0.0)),
    of("TranslationalSpringConstant", "N/m", Some(0.0)),
    of("Velocity", "m/s", None),
    of("Voltage", "V", None),
    of("Volume", "m3", None),
    of("VolumeFlowRate", "m3/s", None),
    of("Work", "J", None),
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
