class Thermofluid_Tanks

  function flow_through
    input Real dp;
    input Real k;
    output Real m;
  protected
    Real soft;
  algorithm
    soft := 100;
    m := ((k * dp) / sqrt(sqrt(((dp ^ 2) + (soft ^ 2)))));
  end flow_through;


  input Real m(start = 2, min = 0, max = 6, unit = "kg/s");

  Real pump.port.p(start = 0.0, unit = "Pa") "Pressure";

  Real pump.port.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  Real pump.m(start = 0.0, unit = "kg/s");

  Real t1.port.p(start = 0.0, unit = "Pa") "Pressure";

  Real t1.port.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  parameter Real t1.A(start = 0.05, unit = "m2") = 0.05;

  parameter Real t1.rho(start = 1000, unit = "kg/m3") = 1000;

  parameter Real t1.g(start = 9.81, unit = "m/s2") = 9.81;

  Real t1.h(start = 1.5, min = 0.05, max = 5, fixed = true, unit = "m");

  Real t2.port.p(start = 0.0, unit = "Pa") "Pressure";

  Real t2.port.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  parameter Real t2.A(start = 0.05, unit = "m2") = 0.05;

  parameter Real t2.rho(start = 1000, unit = "kg/m3") = 1000;

  parameter Real t2.g(start = 9.81, unit = "m/s2") = 9.81;

  Real t2.h(start = 1, min = 0.05, max = 5, fixed = true, unit = "m");

  Real t3.port.p(start = 0.0, unit = "Pa") "Pressure";

  Real t3.port.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  parameter Real t3.A(start = 0.05, unit = "m2") = 0.05;

  parameter Real t3.rho(start = 1000, unit = "kg/m3") = 1000;

  parameter Real t3.g(start = 9.81, unit = "m/s2") = 9.81;

  Real t3.h(start = 0.5, min = 0.05, max = 5, fixed = true, unit = "m");

  Real p12.a.p(start = 0.0, unit = "Pa") "Pressure";

  Real p12.a.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  Real p12.b.p(start = 0.0, unit = "Pa") "Pressure";

  Real p12.b.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  parameter Real p12.k(start = 0.02) = 0.02;

  Real p23.a.p(start = 0.0, unit = "Pa") "Pressure";

  Real p23.a.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  Real p23.b.p(start = 0.0, unit = "Pa") "Pressure";

  Real p23.b.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  parameter Real p23.k(start = 0.02) = 0.02;

  Real drain.a.p(start = 0.0, unit = "Pa") "Pressure";

  Real drain.a.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  Real drain.b.p(start = 0.0, unit = "Pa") "Pressure";

  Real drain.b.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  parameter Real drain.k(start = 0.0) = 0.03;

  Real outlet.port.p(start = 0.0, unit = "Pa") "Pressure";

  Real outlet.port.m(start = 0.0, unit = "kg/s") "Mass flow into the part";

  output Real y(start = 0.0, unit = "m");


equation

  0.0 = (pump.m - m);

  0.0 = (y - t3.h);

  0.0 = (pump.port.m - (-pump.m));

  0.0 = (((t1.A * t1.rho) * der(t1.h)) - t1.port.m);

  0.0 = (t1.port.p - ((t1.rho * t1.g) * t1.h));

  0.0 = (((t2.A * t2.rho) * der(t2.h)) - t2.port.m);

  0.0 = (t2.port.p - ((t2.rho * t2.g) * t2.h));

  0.0 = (((t3.A * t3.rho) * der(t3.h)) - t3.port.m);

  0.0 = (t3.port.p - ((t3.rho * t3.g) * t3.h));

  0.0 = (p12.a.m - flow_through((p12.a.p - p12.b.p), p12.k));

  0.0 = ((p12.a.m + p12.b.m) - 0);

  0.0 = (p23.a.m - flow_through((p23.a.p - p23.b.p), p23.k));

  0.0 = ((p23.a.m + p23.b.m) - 0);

  0.0 = (drain.a.m - flow_through((drain.a.p - drain.b.p), drain.k));

  0.0 = ((drain.a.m + drain.b.m) - 0);

  0.0 = (outlet.port.p - 0);

  0.0 = ((pump.port.m + t1.port.m) + p12.a.m);

  0.0 = ((p12.b.m + t2.port.m) + p23.a.m);

  0.0 = ((p23.b.m + t3.port.m) + drain.a.m);

  0.0 = (drain.b.m + outlet.port.m);

  0.0 = (pump.port.p - t1.port.p);

  0.0 = (t1.port.p - p12.a.p);

  0.0 = (p12.b.p - t2.port.p);

  0.0 = (t2.port.p - p23.a.p);

  0.0 = (p23.b.p - t3.port.p);

  0.0 = (t3.port.p - drain.a.p);

  0.0 = (drain.b.p - outlet.port.p);



end Thermofluid_Tanks;
