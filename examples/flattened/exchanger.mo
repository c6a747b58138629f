// BaseModelica — Thermofluid_Exchanger "Hot and cold water in cells, with a wall between"

model Thermofluid_Exchanger "Hot and cold water in cells, with a wall between"

  // --- variable declarations ---
  parameter Integer n(start = 3) = 3;
  input Real mh(unit = "kg/s", min = 0.1, max = 1, start = 0.5);
  parameter Real mc(unit = "kg/s", start = 0.4) = 0.4;
  parameter Real c(start = 4186) = 4186;
  parameter Real M(unit = "kg", start = 2) = 2;
  parameter Real G(start = 500) = 500;
  Real[3] Th(unit = "K", min = 273, max = 380, start = 330, fixed = true);
  Real[3] Tc(unit = "K", min = 273, max = 380, start = 300, fixed = true);
  Real[3] hot(unit = "K", start = 0.0) "What flows into the cells";
  Real[3] cold(unit = "K", start = 0.0);
  Real wall.port.T(unit = "K", start = 0.0) "Temperature";
  Real wall.port.Q(unit = "W", start = 0.0) "Heat into the part";
  parameter Real wall.C(unit = "J/K", start = 0.0) = 5000;
  Real wall.T(unit = "K", min = 200, max = 500, start = 310, fixed = true);
  Real shell.a.T(unit = "K", start = 0.0) "Temperature";
  Real shell.a.Q(unit = "W", start = 0.0) "Heat into the part";
  Real shell.b.T(unit = "K", start = 0.0) "Temperature";
  Real shell.b.Q(unit = "W", start = 0.0) "Heat into the part";
  parameter Real shell.G(unit = "W/K", start = 0.0) = 50;
  Real ambient.port.T(unit = "K", start = 0.0) "Temperature";
  Real ambient.port.Q(unit = "W", start = 0.0) "Heat into the part";
  parameter Real ambient.T(unit = "K", start = 283.15) = 283.15;
  output Real y(unit = "K", start = 0.0) = Tc[n];

equation
  // --- continuous equations ---
  wall.T = wall.port.T;
  (wall.C * der(wall.T)) = wall.port.Q;
  shell.a.Q = (shell.G * (shell.a.T - shell.b.T));
  (shell.a.Q + shell.b.Q) = 0;
  ambient.port.T = ambient.T;
  hot[1] = 350;
  cold[1] = 290;
  hot[2] = Th[1];
  hot[3] = Th[2];
  cold[2] = Tc[1];
  cold[3] = Tc[2];
  ((M * c) * der(Th[1])) = (((mh * c) * (hot[1] - Th[1])) - (G * (Th[1] - wall.T)));
  ((M * c) * der(Th[2])) = (((mh * c) * (hot[2] - Th[2])) - (G * (Th[2] - wall.T)));
  ((M * c) * der(Th[3])) = (((mh * c) * (hot[3] - Th[3])) - (G * (Th[3] - wall.T)));
  ((M * c) * der(Tc[1])) = (((mc * c) * (cold[1] - Tc[1])) + (G * (wall.T - Tc[1])));
  ((M * c) * der(Tc[2])) = (((mc * c) * (cold[2] - Tc[2])) + (G * (wall.T - Tc[2])));
  ((M * c) * der(Tc[3])) = (((mc * c) * (cold[3] - Tc[3])) + (G * (wall.T - Tc[3])));
  0 = (wall.port.Q + shell.a.Q);
  0 = (shell.b.Q + ambient.port.Q);
  wall.port.T = shell.a.T;
  shell.b.T = ambient.port.T;

end Thermofluid_Exchanger;
