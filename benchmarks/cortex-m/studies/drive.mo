model Drive "A motor turns an arm through an elastic shaft"
  parameter Real J1(unit = "kg.m2") = 0.02 "Inertia of the motor";
  parameter Real J2(unit = "kg.m2") = 0.05 "Inertia of the arm";
  parameter Real k(unit = "N.m/rad") = 8 "Stiffness of the shaft";
  parameter Real d(unit = "N.m.s/rad") = 0.05 "Damping of the shaft";
  parameter Real weight(unit = "N.m") = 1.2 "Torque of the arm's weight, held out level";
  input Real torque(unit = "N.m", min = -3, max = 3) "Torque of the motor";
  Real motor(unit = "rad", min = -10, max = 10) "Angle of the motor";
  Real motor_speed(unit = "rad/s", min = -40, max = 40) "Its speed";
  Real arm(start = 0.3, unit = "rad", min = -10, max = 10) "Angle of the arm";
  Real arm_speed(unit = "rad/s", min = -40, max = 40) "Its speed";
  output Real encoder(unit = "rad") = motor "The encoder on the motor";
protected
  Real twist(unit = "N.m") "Torque in the shaft";
equation
  twist = k*(motor - arm) + d*(motor_speed - arm_speed);
  der(motor) = motor_speed;
  J1*der(motor_speed) = torque - twist;
  der(arm) = arm_speed;
  J2*der(arm_speed) = twist - weight*sin(arm);
  annotation(experiment(StopTime = 2));
end Drive;
