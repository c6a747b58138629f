model Cstr "Stirred tank with an exothermic reaction A -> B; time in minutes"
  parameter Real V(unit = "L") = 100 "Volume";
  parameter Real k0(unit = "1/min") = 7.2e10 "Rate of the reaction at infinite temperature";
  parameter Real E(unit = "K") = 8750 "Activation energy over the gas constant";
  parameter Real H(unit = "K.L/mol") = 110 "Rise of temperature per mole that reacts in a litre";
  parameter Real c(unit = "1/min") = 4 "Heat exchange with the jacket";
  parameter Real Tin(unit = "K") = 340 "Temperature of the inflow";
  input Real q(start = 100, unit = "L/min", min = 50, max = 150) "Flow through the tank";
  input Real Tj(start = 320, unit = "K", min = 300, max = 340) "Temperature of the jacket";
  input Real Cin(start = 1, unit = "mol/L", min = 0.2, max = 1.8) "Concentration of A in the inflow";
  Real C(start = 0.6, unit = "mol/L", min = 0, max = 1.8) "Concentration of A in the tank";
  Real T(start = 335, unit = "K", min = 310, max = 390) "Temperature of the tank";
  Real r(unit = "1/min") "Rate of the reaction per concentration, after Arrhenius";
  output Real temperature(unit = "K") = T "Thermometer";
equation
  r = k0*exp(-E/T);
  der(C) = q/V*(Cin - C) - r*C;
  der(T) = q/V*(Tin - T) + H*r*C + c*(Tj - T);
  annotation(experiment(StopTime = 40));
end Cstr;
