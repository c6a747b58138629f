// BaseModelica — Electrical_Rectifier "A diode charges a capacitor that a load empties"

model Electrical_Rectifier "A diode charges a capacitor that a load empties"

  // --- variable declarations ---
  input Real u(unit = "V", min = (-1), max = 1, start = 0.3);
  Real s.p.v(unit = "V", start = 0.0) "Potential";
  Real s.p.i(unit = "A", start = 0.0) "Current into the part";
  Real s.n.v(unit = "V", start = 0.0) "Potential";
  Real s.n.i(unit = "A", start = 0.0) "Current into the part";
  Real s.v(unit = "V", start = 0.0);
  Real s.i(unit = "A", start = 0.0);
  input Real s.u(unit = "V", start = 0.0) = u;
  Real input_side.p.v(unit = "V", start = 0.0) "Potential";
  Real input_side.p.i(unit = "A", start = 0.0) "Current into the part";
  Real input_side.n.v(unit = "V", start = 0.0) "Potential";
  Real input_side.n.i(unit = "A", start = 0.0) "Current into the part";
  Real input_side.v(unit = "V", min = (-1), max = 1, start = 0, fixed = true);
  Real input_side.i(unit = "A", start = 0.0);
  parameter Real input_side.C(unit = "F", start = 0.0) = 0.05;
  Real r.p.v(unit = "V", start = 0.0) "Potential";
  Real r.p.i(unit = "A", start = 0.0) "Current into the part";
  Real r.n.v(unit = "V", start = 0.0) "Potential";
  Real r.n.i(unit = "A", start = 0.0) "Current into the part";
  Real r.v(unit = "V", start = 0.0);
  Real r.i(unit = "A", start = 0.0);
  parameter Real r.R(unit = "Ohm", min = 0, start = 0.0) = 2;
  Real d.p.v(unit = "V", start = 0.0) "Potential";
  Real d.p.i(unit = "A", start = 0.0) "Current into the part";
  Real d.n.v(unit = "V", start = 0.0) "Potential";
  Real d.n.i(unit = "A", start = 0.0) "Current into the part";
  Real d.v(unit = "V", start = 0.0);
  Real d.i(unit = "A", start = 0.0);
  parameter Real d.Is(unit = "A", start = 0.000001) = 0.000001;
  parameter Real d.Vt(unit = "V", start = 0.04) = 0.04;
  parameter Real d.R(unit = "Ohm", start = 10000.0) = 10000.0;
  Real c.p.v(unit = "V", start = 0.0) "Potential";
  Real c.p.i(unit = "A", start = 0.0) "Current into the part";
  Real c.n.v(unit = "V", start = 0.0) "Potential";
  Real c.n.i(unit = "A", start = 0.0) "Current into the part";
  Real c.v(unit = "V", min = (-1), max = 1, start = 0.1, fixed = true);
  Real c.i(unit = "A", start = 0.0);
  parameter Real c.C(unit = "F", start = 0.0) = 0.5;
  Real load.p.v(unit = "V", start = 0.0) "Potential";
  Real load.p.i(unit = "A", start = 0.0) "Current into the part";
  Real load.n.v(unit = "V", start = 0.0) "Potential";
  Real load.n.i(unit = "A", start = 0.0) "Current into the part";
  Real load.v(unit = "V", start = 0.0);
  Real load.i(unit = "A", start = 0.0);
  parameter Real load.R(unit = "Ohm", min = 0, start = 0.0) = 50;
  Real g.p.v(unit = "V", start = 0.0) "Potential";
  Real g.p.i(unit = "A", start = 0.0) "Current into the part";
  output Real y(unit = "V", start = 0.0) = c.v;

equation
  // --- continuous equations ---
  s.v = (s.p.v - s.n.v);
  0 = (s.p.i + s.n.i);
  s.i = s.p.i;
  s.v = s.u;
  input_side.v = (input_side.p.v - input_side.n.v);
  0 = (input_side.p.i + input_side.n.i);
  input_side.i = input_side.p.i;
  (input_side.C * der(input_side.v)) = input_side.i;
  r.v = (r.p.v - r.n.v);
  0 = (r.p.i + r.n.i);
  r.i = r.p.i;
  r.v = (r.R * r.i);
  d.v = (d.p.v - d.n.v);
  0 = (d.p.i + d.n.i);
  d.i = d.p.i;
  d.i = ((d.Is * (exp((d.v / d.Vt)) - 1)) + (d.v / d.R));
  c.v = (c.p.v - c.n.v);
  0 = (c.p.i + c.n.i);
  c.i = c.p.i;
  (c.C * der(c.v)) = c.i;
  load.v = (load.p.v - load.n.v);
  0 = (load.p.i + load.n.i);
  load.i = load.p.i;
  load.v = (load.R * load.i);
  g.p.v = 0;
  0 = (s.p.i + r.p.i);
  0 = ((r.n.i + input_side.p.i) + d.p.i);
  0 = ((d.n.i + c.p.i) + load.p.i);
  0 = ((((load.n.i + c.n.i) + input_side.n.i) + s.n.i) + g.p.i);
  s.p.v = r.p.v;
  r.n.v = input_side.p.v;
  input_side.p.v = d.p.v;
  d.n.v = c.p.v;
  c.p.v = load.p.v;
  load.n.v = c.n.v;
  c.n.v = input_side.n.v;
  input_side.n.v = s.n.v;
  s.n.v = g.p.v;

end Electrical_Rectifier;
