package Electrical "Circuits of parts with pins"
  connector Pin
    Real v(unit = "V") "Potential";
    flow Real i(unit = "A") "Current into the part";
  end Pin;

  partial model TwoPin
    Pin p;
    Pin n;
    Real v(unit = "V");
    Real i(unit = "A");
  equation
    v = p.v - n.v;
    0 = p.i + n.i;
    i = p.i;
  end TwoPin;

  model Resistor
    extends TwoPin;
    parameter Real R(unit = "Ohm", min = 0) = 1;
  equation
    v = R*i;
  end Resistor;

  model Diode "A junction with a resistance in parallel"
    extends TwoPin;
    parameter Real Is(unit = "A") = 1e-6;
    parameter Real Vt(unit = "V") = 0.04;
    parameter Real R(unit = "Ohm") = 1e4;
  equation
    i = Is*(exp(v/Vt) - 1) + v/R;
  end Diode;

  model Capacitor
    extends TwoPin;
    parameter Real C(unit = "F") = 1;
  equation
    C*der(v) = i;
  end Capacitor;

  model Inductor
    extends TwoPin;
    parameter Real L(unit = "H") = 1;
  equation
    L*der(i) = v;
  end Inductor;

  model Source
    extends TwoPin;
    input Real u(unit = "V");
  equation
    v = u;
  end Source;

  model Ground
    Pin p;
  equation
    p.v = 0;
  end Ground;

  model Filter "A ladder of two sections with a load"
    input Real u(min = 0, max = 10, unit = "V", start = 5);
    Source s(u = u);
    Resistor r(R = 2);
    Inductor l1(L = 0.5, i(start = 0.1, fixed = true, min = -10, max = 10));
    Capacitor c1(C = 0.1, v(start = 0.5, fixed = true, min = -20, max = 20));
    Inductor l2(L = 0.3, i(start = 0, fixed = true, min = -10, max = 10));
    Capacitor c2(C = 0.2, v(start = 0, fixed = true, min = -20, max = 20));
    Resistor load(R = 5);
    Ground g;
    output Real y(unit = "V") = load.v;
  equation
    connect(s.p, r.p);
    connect(r.n, l1.p);
    connect(l1.n, c1.p);
    connect(c1.p, l2.p);
    connect(l2.n, c2.p);
    connect(c2.p, load.p);
    connect(load.n, c2.n);
    connect(c2.n, c1.n);
    connect(c1.n, s.n);
    connect(s.n, g.p);
  end Filter;

  model Bridge "A Wheatstone bridge of resistors, with a capacitor across: a linear loop"
    input Real u(min = 0, max = 10, unit = "V", start = 5);
    Source s(u = u);
    Resistor r1(R = 1);
    Resistor r2(R = 2);
    Resistor r3(R = 3);
    Resistor r4(R = 4);
    Resistor wire(R = 0.5);
    Capacitor c(C = 0.4, v(start = 1, fixed = true, min = -10, max = 10));
    Ground g;
    output Real y(unit = "A") = s.i;
  equation
    connect(s.p, wire.p);
    connect(wire.n, r1.p);
    connect(wire.n, r3.p);
    connect(r1.n, r2.p);
    connect(r3.n, r4.p);
    connect(r1.n, c.p);
    connect(r3.n, c.n);
    connect(r2.n, s.n);
    connect(r4.n, s.n);
    connect(s.n, g.p);
  end Bridge;

  model Rectifier "A diode charges a capacitor that a load empties"
    input Real u(min = -1, max = 1, unit = "V", start = 0.3);
    Source s(u = u);
    Capacitor input_side(C = 0.05, v(start = 0, fixed = true, min = -1, max = 1));
    Resistor r(R = 2);
    Diode d;
    Capacitor c(C = 0.5, v(start = 0.1, fixed = true, min = -1, max = 1));
    Resistor load(R = 50);
    Ground g;
    output Real y(unit = "V") = c.v;
  equation
    connect(s.p, r.p);
    connect(r.n, input_side.p);
    connect(input_side.p, d.p);
    connect(d.n, c.p);
    connect(c.p, load.p);
    connect(load.n, c.n);
    connect(c.n, input_side.n);
    connect(input_side.n, s.n);
    connect(s.n, g.p);
  end Rectifier;
end Electrical;
