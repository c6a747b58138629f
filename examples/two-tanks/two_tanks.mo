model TwoTanks "Two tanks in cascade: a pump fills the upper one, which drains into the lower one"
  parameter Real k1 = 0.03951 "Outflow of the upper tank";
  parameter Real k2 = 0.07283 "Inflow of the lower tank";
  parameter Real k3 = 0.06651 "Outflow of the lower tank";
  parameter Real k4 = 0.03037 "Gain of the pump";
  input Real pump(start = 2, unit = "V", min = 0, max = 10) "Pump voltage";
  Real upper(start = 3.99, unit = "V", min = 0.05, max = 10) "Level of the upper tank, in volts of its sensor";
  Real lower(start = 5.2, unit = "V", min = 0.05, max = 10) "Level of the lower tank, in volts of its sensor";
  output Real level(unit = "V") = lower "The level sensor";
equation
  der(upper) = -k1*sqrt(upper) + k4*pump;
  der(lower) = k2*sqrt(upper) - k3*sqrt(lower);
  annotation(experiment(StopTime = 4000));
end TwoTanks;
