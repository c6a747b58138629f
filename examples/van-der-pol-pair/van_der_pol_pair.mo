model VanDerPolPair "Two self-excited oscillators joined by a spring; only the first one is seen"
  parameter Real m1 = 1 "Self-excitation of the first oscillator";
  parameter Real m2 = 0.5 "Self-excitation of the second oscillator";
  parameter Real k(unit = "1/s2") = 0.5 "Stiffness of the spring, per mass";
  Real q1(start = 1, unit = "m", min = -3, max = 3) "Position of the first oscillator";
  Real v1(start = 0, unit = "m/s", min = -5, max = 5) "Its velocity";
  Real q2(start = -1.5, unit = "m", min = -3, max = 3) "Position of the second oscillator";
  Real v2(start = 1, unit = "m/s", min = -5, max = 5) "Its velocity";
  output Real position(unit = "m") = q1 "The only sensor";
equation
  der(q1) = v1;
  der(v1) = m1*(1 - q1^2)*v1 - q1 + k*(q2 - q1);
  der(q2) = v2;
  der(v2) = m2*(1 - q2^2)*v2 - 1.5*q2 + k*(q1 - q2);
  annotation(experiment(StopTime = 30));
end VanDerPolPair;
