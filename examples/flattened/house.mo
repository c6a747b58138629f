class Thermofluid_House


  input Real P(start = 1000, min = 0, max = 2000, unit = "W");

  Real heater.port.T(start = 0.0, unit = "K") "Temperature";

  Real heater.port.Q(start = 0.0, unit = "W") "Heat into the part";

  Real heater.P(start = 0.0, unit = "W");

  Real air.port.T(start = 0.0, unit = "K") "Temperature";

  Real air.port.Q(start = 0.0, unit = "W") "Heat into the part";

  parameter Real air.C(start = 0.0, unit = "J/K") = 40;

  Real air.T(start = 293.15, min = 200, max = 500, fixed = true, unit = "K");

  Real wall.port.T(start = 0.0, unit = "K") "Temperature";

  Real wall.port.Q(start = 0.0, unit = "W") "Heat into the part";

  parameter Real wall.C(start = 0.0, unit = "J/K") = 400;

  Real wall.T(start = 288.15, min = 200, max = 500, fixed = true, unit = "K");

  Real inside.a.T(start = 0.0, unit = "K") "Temperature";

  Real inside.a.Q(start = 0.0, unit = "W") "Heat into the part";

  Real inside.b.T(start = 0.0, unit = "K") "Temperature";

  Real inside.b.Q(start = 0.0, unit = "W") "Heat into the part";

  parameter Real inside.G(start = 0.0, unit = "W/K") = 20;

  Real outside.a.T(start = 0.0, unit = "K") "Temperature";

  Real outside.a.Q(start = 0.0, unit = "W") "Heat into the part";

  Real outside.b.T(start = 0.0, unit = "K") "Temperature";

  Real outside.b.Q(start = 0.0, unit = "W") "Heat into the part";

  parameter Real outside.G(start = 0.0, unit = "W/K") = 5;

  Real sky.a.T(start = 0.0, unit = "K") "Temperature";

  Real sky.a.Q(start = 0.0, unit = "W") "Heat into the part";

  Real sky.b.T(start = 0.0, unit = "K") "Temperature";

  Real sky.b.Q(start = 0.0, unit = "W") "Heat into the part";

  parameter Real sky.k(start = 0.0, unit = "W/K4") = 0.00000002;

  Real ambient.port.T(start = 0.0, unit = "K") "Temperature";

  Real ambient.port.Q(start = 0.0, unit = "W") "Heat into the part";

  parameter Real ambient.T(start = 283.15, unit = "K") = 283.15;

  output Real y(start = 0.0, unit = "K");


equation

  0.0 = (heater.P - P);

  0.0 = (y - air.T);

  0.0 = (heater.port.Q - (-heater.P));

  0.0 = (air.T - air.port.T);

  0.0 = ((air.C * der(air.T)) - air.port.Q);

  0.0 = (wall.T - wall.port.T);

  0.0 = ((wall.C * der(wall.T)) - wall.port.Q);

  0.0 = (inside.a.Q - (inside.G * (inside.a.T - inside.b.T)));

  0.0 = ((inside.a.Q + inside.b.Q) - 0);

  0.0 = (outside.a.Q - (outside.G * (outside.a.T - outside.b.T)));

  0.0 = ((outside.a.Q + outside.b.Q) - 0);

  0.0 = (sky.a.Q - (sky.k * ((sky.a.T ^ 4) - (sky.b.T ^ 4))));

  0.0 = ((sky.a.Q + sky.b.Q) - 0);

  0.0 = (ambient.port.T - ambient.T);

  0.0 = ((heater.port.Q + air.port.Q) + inside.a.Q);

  0.0 = (((inside.b.Q + wall.port.Q) + outside.a.Q) + sky.a.Q);

  0.0 = ((outside.b.Q + ambient.port.Q) + sky.b.Q);

  0.0 = (heater.port.T - air.port.T);

  0.0 = (air.port.T - inside.a.T);

  0.0 = (inside.b.T - wall.port.T);

  0.0 = (wall.port.T - outside.a.T);

  0.0 = (outside.a.T - sky.a.T);

  0.0 = (outside.b.T - ambient.port.T);

  0.0 = (ambient.port.T - sky.b.T);



end Thermofluid_House;
