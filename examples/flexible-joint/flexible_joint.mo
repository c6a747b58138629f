model FlexibleJoint "A robot arm on an elastic gear, in a vertical plane"
  parameter Real I(unit = "kg.m2") = 0.5 "Inertia of the arm";
  parameter Real J(unit = "kg.m2") = 0.1 "Inertia of the motor, on the side of the arm";
  parameter Real mgl(unit = "N.m") = 5 "Largest torque of the arm's weight";
  parameter Real k(unit = "N.m/rad") = 50 "Stiffness of the gear";
  parameter Real d(unit = "N.m.s/rad") = 0.3 "Friction of the motor";
  input Real torque(start = 0, unit = "N.m", min = -10, max = 10) "Torque of the motor";
  Real arm(start = 0.5, unit = "rad", min = -3, max = 3) "Angle of the arm";
  Real arm_rate(start = 0, unit = "rad/s", min = -5, max = 5) "Rate of the arm";
  Real motor(start = 0.5, unit = "rad", min = -3, max = 3) "Angle of the motor";
  Real motor_rate(start = 0, unit = "rad/s", min = -10, max = 10) "Rate of the motor";
  output Real angle(unit = "rad") = arm "Encoder on the arm";
equation
  der(arm) = arm_rate;
  I*der(arm_rate) = -mgl*sin(arm) - k*(arm - motor);
  der(motor) = motor_rate;
  J*der(motor_rate) = torque + k*(arm - motor) - d*motor_rate;
  annotation(experiment(StopTime = 4));
end FlexibleJoint;
