class Mechanics_Train


  input Real f(start = 2, min = (-10), max = 10, unit = "N");

  Real wall.a.s(start = 0.0, unit = "m") "Position";

  Real wall.a.f(start = 0.0, unit = "N") "Force into the part";

  Real b1.a.s(start = 0.0, unit = "m") "Position";

  Real b1.a.f(start = 0.0, unit = "N") "Force into the part";

  Real b1.b.s(start = 0.0, unit = "m") "Position";

  Real b1.b.f(start = 0.0, unit = "N") "Force into the part";

  parameter Real b1.c(start = 20) = 20;

  parameter Real b1.c3(start = 5) = 5;

  parameter Real b1.d(start = 0.5) = 0.5;

  Real b1.x(start = 0.0, unit = "m");

  Real b2.a.s(start = 0.0, unit = "m") "Position";

  Real b2.a.f(start = 0.0, unit = "N") "Force into the part";

  Real b2.b.s(start = 0.0, unit = "m") "Position";

  Real b2.b.f(start = 0.0, unit = "N") "Force into the part";

  parameter Real b2.c(start = 20) = 20;

  parameter Real b2.c3(start = 5) = 5;

  parameter Real b2.d(start = 0.5) = 0.5;

  Real b2.x(start = 0.0, unit = "m");

  Real b3.a.s(start = 0.0, unit = "m") "Position";

  Real b3.a.f(start = 0.0, unit = "N") "Force into the part";

  Real b3.b.s(start = 0.0, unit = "m") "Position";

  Real b3.b.f(start = 0.0, unit = "N") "Force into the part";

  parameter Real b3.c(start = 20) = 20;

  parameter Real b3.c3(start = 5) = 5;

  parameter Real b3.d(start = 0.5) = 0.5;

  Real b3.x(start = 0.0, unit = "m");

  Real w1.a.s(start = 0.0, unit = "m") "Position";

  Real w1.a.f(start = 0.0, unit = "N") "Force into the part";

  parameter Real w1.m(start = 0.0, unit = "kg") = 1;

  Real w1.s(start = 0, min = (-10), max = 10, fixed = true, unit = "m");

  Real w1.v(start = 0, min = (-20), max = 20, fixed = true, unit = "m/s");

  Real w2.a.s(start = 0.0, unit = "m") "Position";

  Real w2.a.f(start = 0.0, unit = "N") "Force into the part";

  parameter Real w2.m(start = 0.0, unit = "kg") = 2;

  Real w2.s(start = 0.2, min = (-10), max = 10, fixed = true, unit = "m");

  Real w2.v(start = 0, min = (-20), max = 20, fixed = true, unit = "m/s");

  Real w3.a.s(start = 0.0, unit = "m") "Position";

  Real w3.a.f(start = 0.0, unit = "N") "Force into the part";

  parameter Real w3.m(start = 0.0, unit = "kg") = 1.5;

  Real w3.s(start = 0, min = (-10), max = 10, fixed = true, unit = "m");

  Real w3.v(start = 0, min = (-20), max = 20, fixed = true, unit = "m/s");

  Real push.b.s(start = 0.0, unit = "m") "Position";

  Real push.b.f(start = 0.0, unit = "N") "Force into the part";

  Real push.f(start = 0.0, unit = "N");

  output Real y(start = 0.0, unit = "m");


equation

  0.0 = (push.f - f);

  0.0 = (y - w3.s);

  0.0 = (wall.a.s - 0);

  0.0 = (b1.x - (b1.b.s - b1.a.s));

  0.0 = (b1.b.f - (((b1.c * b1.x) + (b1.c3 * (b1.x ^ 3))) + (b1.d * der(b1.x))));

  0.0 = ((b1.a.f + b1.b.f) - 0);

  0.0 = (b2.x - (b2.b.s - b2.a.s));

  0.0 = (b2.b.f - (((b2.c * b2.x) + (b2.c3 * (b2.x ^ 3))) + (b2.d * der(b2.x))));

  0.0 = ((b2.a.f + b2.b.f) - 0);

  0.0 = (b3.x - (b3.b.s - b3.a.s));

  0.0 = (b3.b.f - (((b3.c * b3.x) + (b3.c3 * (b3.x ^ 3))) + (b3.d * der(b3.x))));

  0.0 = ((b3.a.f + b3.b.f) - 0);

  0.0 = (w1.s - w1.a.s);

  0.0 = (w1.v - der(w1.s));

  0.0 = ((w1.m * der(w1.v)) - w1.a.f);

  0.0 = (w2.s - w2.a.s);

  0.0 = (w2.v - der(w2.s));

  0.0 = ((w2.m * der(w2.v)) - w2.a.f);

  0.0 = (w3.s - w3.a.s);

  0.0 = (w3.v - der(w3.s));

  0.0 = ((w3.m * der(w3.v)) - w3.a.f);

  0.0 = (push.b.f - (-push.f));

  0.0 = (wall.a.f + b1.a.f);

  0.0 = ((b1.b.f + w1.a.f) + b2.a.f);

  0.0 = ((b2.b.f + w2.a.f) + b3.a.f);

  0.0 = ((b3.b.f + w3.a.f) + push.b.f);

  0.0 = (wall.a.s - b1.a.s);

  0.0 = (b1.b.s - w1.a.s);

  0.0 = (w1.a.s - b2.a.s);

  0.0 = (b2.b.s - w2.a.s);

  0.0 = (w2.a.s - b3.a.s);

  0.0 = (b3.b.s - w3.a.s);

  0.0 = (w3.a.s - push.b.s);



end Mechanics_Train;
