// BaseModelica — Mechanics_DoublePendulum "Two rods: forces and accelerations are one linear loop"

model Mechanics_DoublePendulum "Two rods: forces and accelerations are one linear loop"

  // --- variable declarations ---
  Real anchor.b.ax(unit = "m/s2", start = 0.0) "Acceleration";
  Real anchor.b.ay(unit = "m/s2", start = 0.0);
  Real anchor.b.fx(unit = "N", start = 0.0) "Force on the part";
  Real anchor.b.fy(unit = "N", start = 0.0);
  Real upper.a.ax(unit = "m/s2", start = 0.0) "Acceleration";
  Real upper.a.ay(unit = "m/s2", start = 0.0);
  Real upper.a.fx(unit = "N", start = 0.0) "Force on the part";
  Real upper.a.fy(unit = "N", start = 0.0);
  Real upper.b.ax(unit = "m/s2", start = 0.0) "Acceleration";
  Real upper.b.ay(unit = "m/s2", start = 0.0);
  Real upper.b.fx(unit = "N", start = 0.0) "Force on the part";
  Real upper.b.fy(unit = "N", start = 0.0);
  parameter Real upper.m(unit = "kg", start = 1) = 1;
  parameter Real upper.l(unit = "m", start = 1) = 1;
  parameter Real upper.g(unit = "m/s2", start = 9.81) = 9.81;
  parameter Real upper.d(unit = "N.m.s/rad", start = 0.2) = 0.2;
  Real upper.phi(unit = "rad", min = (-3), max = 3, start = 0.4, fixed = true) "From the vertical";
  Real upper.w(unit = "rad/s", min = (-20), max = 20, start = 0, fixed = true);
  Real upper.z(unit = "rad/s2", start = 0.0);
  Real upper.cx(unit = "m/s2", start = 0.0);
  Real upper.cy(unit = "m/s2", start = 0.0);
  Real lower.a.ax(unit = "m/s2", start = 0.0) "Acceleration";
  Real lower.a.ay(unit = "m/s2", start = 0.0);
  Real lower.a.fx(unit = "N", start = 0.0) "Force on the part";
  Real lower.a.fy(unit = "N", start = 0.0);
  Real lower.b.ax(unit = "m/s2", start = 0.0) "Acceleration";
  Real lower.b.ay(unit = "m/s2", start = 0.0);
  Real lower.b.fx(unit = "N", start = 0.0) "Force on the part";
  Real lower.b.fy(unit = "N", start = 0.0);
  parameter Real lower.m(unit = "kg", start = 0.0) = 0.5;
  parameter Real lower.l(unit = "m", start = 0.0) = 0.7;
  parameter Real lower.g(unit = "m/s2", start = 9.81) = 9.81;
  parameter Real lower.d(unit = "N.m.s/rad", start = 0.2) = 0.2;
  Real lower.phi(unit = "rad", min = (-3), max = 3, start = (-0.2), fixed = true) "From the vertical";
  Real lower.w(unit = "rad/s", min = (-20), max = 20, start = 0, fixed = true);
  Real lower.z(unit = "rad/s2", start = 0.0);
  Real lower.cx(unit = "m/s2", start = 0.0);
  Real lower.cy(unit = "m/s2", start = 0.0);
  Real free.a.ax(unit = "m/s2", start = 0.0) "Acceleration";
  Real free.a.ay(unit = "m/s2", start = 0.0);
  Real free.a.fx(unit = "N", start = 0.0) "Force on the part";
  Real free.a.fy(unit = "N", start = 0.0);
  output Real y(unit = "rad", start = 0.0) = upper.phi;

equation
  // --- continuous equations ---
  anchor.b.ax = 0;
  anchor.b.ay = 0;
  upper.w = der(upper.phi);
  upper.z = der(upper.w);
  upper.b.ax = (upper.a.ax + (upper.l * ((upper.z * cos(upper.phi)) - ((upper.w ^ 2) * sin(upper.phi)))));
  upper.b.ay = (upper.a.ay + (upper.l * ((upper.z * sin(upper.phi)) + ((upper.w ^ 2) * cos(upper.phi)))));
  upper.cx = ((upper.a.ax + upper.b.ax) / 2);
  upper.cy = ((upper.a.ay + upper.b.ay) / 2);
  (upper.m * upper.cx) = (upper.a.fx + upper.b.fx);
  (upper.m * upper.cy) = ((upper.a.fy + upper.b.fy) - (upper.m * upper.g));
  (((upper.m * (upper.l ^ 2)) / 12) * upper.z) = (((upper.l / 2) * (((upper.b.fx - upper.a.fx) * cos(upper.phi)) + ((upper.b.fy - upper.a.fy) * sin(upper.phi)))) - (upper.d * upper.w));
  lower.w = der(lower.phi);
  lower.z = der(lower.w);
  lower.b.ax = (lower.a.ax + (lower.l * ((lower.z * cos(lower.phi)) - ((lower.w ^ 2) * sin(lower.phi)))));
  lower.b.ay = (lower.a.ay + (lower.l * ((lower.z * sin(lower.phi)) + ((lower.w ^ 2) * cos(lower.phi)))));
  lower.cx = ((lower.a.ax + lower.b.ax) / 2);
  lower.cy = ((lower.a.ay + lower.b.ay) / 2);
  (lower.m * lower.cx) = (lower.a.fx + lower.b.fx);
  (lower.m * lower.cy) = ((lower.a.fy + lower.b.fy) - (lower.m * lower.g));
  (((lower.m * (lower.l ^ 2)) / 12) * lower.z) = (((lower.l / 2) * (((lower.b.fx - lower.a.fx) * cos(lower.phi)) + ((lower.b.fy - lower.a.fy) * sin(lower.phi)))) - (lower.d * lower.w));
  free.a.fx = 0;
  free.a.fy = 0;
  0 = (anchor.b.fx + upper.a.fx);
  0 = (anchor.b.fy + upper.a.fy);
  0 = (upper.b.fx + lower.a.fx);
  0 = (upper.b.fy + lower.a.fy);
  0 = (lower.b.fx + free.a.fx);
  0 = (lower.b.fy + free.a.fy);
  anchor.b.ax = upper.a.ax;
  anchor.b.ay = upper.a.ay;
  upper.b.ax = lower.a.ax;
  upper.b.ay = lower.a.ay;
  lower.b.ax = free.a.ax;
  lower.b.ay = free.a.ay;

end Mechanics_DoublePendulum;
