package Thermofluid "Heat and flow between volumes"
  connector HeatPort
    Real T(unit = "K") "Temperature";
    flow Real Q(unit = "W") "Heat into the part";
  end HeatPort;

  model Mass
    HeatPort port;
    parameter Real C(unit = "J/K") = 1;
    Real T(start = 293.15, fixed = true, min = 200, max = 500, unit = "K");
  equation
    T = port.T;
    C*der(T) = port.Q;
  end Mass;

  model Conductor
    HeatPort a;
    HeatPort b;
    parameter Real G(unit = "W/K") = 1;
  equation
    a.Q = G*(a.T - b.T);
    a.Q + b.Q = 0;
  end Conductor;

  model Radiation
    HeatPort a;
    HeatPort b;
    parameter Real k(unit = "W/K4") = 1e-8;
  equation
    a.Q = k*(a.T^4 - b.T^4);
    a.Q + b.Q = 0;
  end Radiation;

  model Heater
    HeatPort port;
    input Real P(unit = "W");
  equation
    port.Q = -P;
  end Heater;

  model Ambient
    HeatPort port;
    parameter Real T(unit = "K") = 283.15;
  equation
    port.T = T;
  end Ambient;

  model House "Air, wall and ground; heat is lost through the wall and by radiation"
    input Real P(min = 0, max = 2000, unit = "W", start = 1000);
    Heater heater(P = P);
    Mass air(C = 40);
    Mass wall(C = 400, T(start = 288.15));
    Conductor inside(G = 20);
    Conductor outside(G = 5);
    Radiation sky(k = 2e-8);
    Ambient ambient;
    output Real y(unit = "K") = air.T;
  equation
    connect(heater.port, air.port);
    connect(air.port, inside.a);
    connect(inside.b, wall.port);
    connect(wall.port, outside.a);
    connect(outside.b, ambient.port);
    connect(wall.port, sky.a);
    connect(sky.b, ambient.port);
  end House;

  connector FluidPort
    Real p(unit = "Pa") "Pressure";
    flow Real m(unit = "kg/s") "Mass flow into the part";
  end FluidPort;

  model Tank
    FluidPort port;
    parameter Real A(unit = "m2") = 0.05;
    parameter Real rho(unit = "kg/m3") = 1000;
    parameter Real g(unit = "m/s2") = 9.81;
    Real h(start = 1, fixed = true, min = 0.05, max = 5, unit = "m");
  equation
    A*rho*der(h) = port.m;
    port.p = rho*g*h;
  end Tank;

  function flow_through "Mass flow for a pressure drop, smooth around zero"
    input Real dp;
    input Real k;
    output Real m;
  protected
    Real soft = 100;
  algorithm
    m := k*dp/sqrt(sqrt(dp^2 + soft^2));
  end flow_through;

  model Pipe
    FluidPort a;
    FluidPort b;
    parameter Real k = 0.02;
  equation
    a.m = flow_through(a.p - b.p, k);
    a.m + b.m = 0;
  end Pipe;

  model Pump
    FluidPort port;
    input Real m(unit = "kg/s");
  equation
    port.m = -m;
  end Pump;

  model Outlet
    FluidPort port;
  equation
    port.p = 0;
  end Outlet;

  model Tanks "Three tanks in a row"
    input Real m(min = 0, max = 6, unit = "kg/s", start = 2);
    Pump pump(m = m);
    Tank t1(h(start = 1.5));
    Tank t2;
    Tank t3(h(start = 0.5));
    Pipe p12;
    Pipe p23;
    Pipe drain(k = 0.03);
    Outlet outlet;
    output Real y(unit = "m") = t3.h;
  equation
    connect(pump.port, t1.port);
    connect(t1.port, p12.a);
    connect(p12.b, t2.port);
    connect(t2.port, p23.a);
    connect(p23.b, t3.port);
    connect(t3.port, drain.a);
    connect(drain.b, outlet.port);
  end Tanks;

  model Exchanger "Hot and cold water in cells, with a wall between"
    parameter Integer n = 3;
    input Real mh(min = 0.1, max = 1, start = 0.5, unit = "kg/s");
    parameter Real mc(unit = "kg/s") = 0.4;
    parameter Real c = 4186;
    parameter Real M(unit = "kg") = 2;
    parameter Real G = 500;
    Real Th[n](each start = 330, each fixed = true, each min = 273, each max = 380, each unit = "K");
    Real Tc[n](each start = 300, each fixed = true, each min = 273, each max = 380, each unit = "K");
    Real hot[n](each unit = "K") "What flows into the cells";
    Real cold[n](each unit = "K");
    Mass wall(C = 5000, T(start = 310));
    Conductor shell(G = 50);
    Ambient ambient;
    output Real y(unit = "K") = Tc[n];
  equation
    connect(wall.port, shell.a);
    connect(shell.b, ambient.port);
    hot[1] = 350;
    cold[1] = 290;
    for i in 2:n loop
      hot[i] = Th[i - 1];
      cold[i] = Tc[i - 1];
    end for;
    for i in 1:n loop
      M*c*der(Th[i]) = mh*c*(hot[i] - Th[i]) - G*(Th[i] - wall.T);
      M*c*der(Tc[i]) = mc*c*(cold[i] - Tc[i]) + G*(wall.T - Tc[i]);
    end for;
  end Exchanger;
end Thermofluid;
