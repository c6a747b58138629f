// BaseModelica — Mechanics_DriveTrain "Motor, soft shaft, load on a bearing"

model Mechanics_DriveTrain "Motor, soft shaft, load on a bearing"

  // --- variable declarations ---
  input Real tau(unit = "N.m", min = (-5), max = 5, start = 1);
  Real motor.b.phi(unit = "rad", start = 0.0) "Angle";
  Real motor.b.tau(unit = "N.m", start = 0.0) "Torque into the part";
  input Real motor.tau(unit = "N.m", start = 0.0) = tau;
  Real rotor.a.phi(unit = "rad", start = 0.0) "Angle";
  Real rotor.a.tau(unit = "N.m", start = 0.0) "Torque into the part";
  Real rotor.b.phi(unit = "rad", start = 0.0) "Angle";
  Real rotor.b.tau(unit = "N.m", start = 0.0) "Torque into the part";
  parameter Real rotor.J(unit = "kg.m2", start = 0.0) = 0.2;
  Real rotor.phi(unit = "rad", min = (-100), max = 100, start = 0, fixed = true);
  Real rotor.w(unit = "rad/s", min = (-100), max = 100, start = 1, fixed = true);
  Real shaft.a.phi(unit = "rad", start = 0.0) "Angle";
  Real shaft.a.tau(unit = "N.m", start = 0.0) "Torque into the part";
  Real shaft.b.phi(unit = "rad", start = 0.0) "Angle";
  Real shaft.b.tau(unit = "N.m", start = 0.0) "Torque into the part";
  parameter Real shaft.c(unit = "N.m/rad", start = 0.0) = 4;
  Real load.a.phi(unit = "rad", start = 0.0) "Angle";
  Real load.a.tau(unit = "N.m", start = 0.0) "Torque into the part";
  Real load.b.phi(unit = "rad", start = 0.0) "Angle";
  Real load.b.tau(unit = "N.m", start = 0.0) "Torque into the part";
  parameter Real load.J(unit = "kg.m2", start = 0.0) = 0.5;
  Real load.phi(unit = "rad", min = (-100), max = 100, start = 0.1, fixed = true);
  Real load.w(unit = "rad/s", min = (-100), max = 100, start = 0, fixed = true);
  Real bearing.a.phi(unit = "rad", start = 0.0) "Angle";
  Real bearing.a.tau(unit = "N.m", start = 0.0) "Torque into the part";
  parameter Real bearing.d(unit = "N.m.s/rad", start = 0.0) = 0.3;
  Real bearing.w(unit = "rad/s", start = 0.0);
  output Real y(unit = "rad", start = 0.0) = rotor.phi;

equation
  // --- continuous equations ---
  motor.b.tau = (-motor.tau);
  rotor.phi = rotor.a.phi;
  rotor.phi = rotor.b.phi;
  rotor.w = der(rotor.phi);
  (rotor.J * der(rotor.w)) = (rotor.a.tau + rotor.b.tau);
  shaft.b.tau = (shaft.c * (shaft.b.phi - shaft.a.phi));
  (shaft.a.tau + shaft.b.tau) = 0;
  load.phi = load.a.phi;
  load.phi = load.b.phi;
  load.w = der(load.phi);
  (load.J * der(load.w)) = (load.a.tau + load.b.tau);
  bearing.w = der(bearing.a.phi);
  bearing.a.tau = (bearing.d * bearing.w);
  0 = (motor.b.tau + rotor.a.tau);
  0 = (rotor.b.tau + shaft.a.tau);
  0 = (shaft.b.tau + load.a.tau);
  0 = (load.b.tau + bearing.a.tau);
  motor.b.phi = rotor.a.phi;
  rotor.b.phi = shaft.a.phi;
  shaft.b.phi = load.a.phi;
  load.b.phi = bearing.a.phi;

end Mechanics_DriveTrain;
