package Mechanics "Shafts, sliding masses and a chain of pendulums"
  connector Flange
    Real phi(unit = "rad") "Angle";
    flow Real tau(unit = "N.m") "Torque into the part";
  end Flange;

  model Inertia
    Flange a;
    Flange b;
    parameter Real J(unit = "kg.m2") = 1;
    Real phi(start = 0, unit = "rad", min = -100, max = 100);
    Real w(start = 0, unit = "rad/s", min = -100, max = 100);
  equation
    phi = a.phi;
    phi = b.phi;
    w = der(phi);
    J*der(w) = a.tau + b.tau;
  end Inertia;

  model Spring
    Flange a;
    Flange b;
    parameter Real c(unit = "N.m/rad") = 10;
  equation
    b.tau = c*(b.phi - a.phi);
    a.tau + b.tau = 0;
  end Spring;

  model Bearing "Viscous friction to ground"
    Flange a;
    parameter Real d(unit = "N.m.s/rad") = 0.1;
    Real w(unit = "rad/s");
  equation
    w = der(a.phi);
    a.tau = d*w;
  end Bearing;

  model Torque
    Flange b;
    input Real tau(unit = "N.m");
  equation
    b.tau = -tau;
  end Torque;

  model DriveTrain "Motor, soft shaft, load on a bearing"
    input Real tau(min = -5, max = 5, unit = "N.m", start = 1);
    Torque motor(tau = tau);
    Inertia rotor(J = 0.2, phi(fixed = true), w(start = 1, fixed = true));
    Spring shaft(c = 4);
    Inertia load(J = 0.5, phi(start = 0.1, fixed = true), w(fixed = true));
    Bearing bearing(d = 0.3);
    output Real y(unit = "rad") = rotor.phi;
  equation
    connect(motor.b, rotor.a);
    connect(rotor.b, shaft.a);
    connect(shaft.b, load.a);
    connect(load.b, bearing.a);
  end DriveTrain;

  model Coupled "Two rotors joined rigidly: their angles are one state"
    input Real tau(min = -5, max = 5, unit = "N.m", start = 1);
    Torque motor(tau = tau);
    Inertia one(J = 0.2, phi(fixed = true), w(fixed = true));
    Inertia two(J = 0.3);
    Spring shaft(c = 4);
    Inertia load(J = 0.5, phi(start = 0.2, fixed = true), w(fixed = true));
    Bearing bearing(d = 0.3);
    output Real y(unit = "rad") = one.phi;
  equation
    connect(motor.b, one.a);
    connect(one.b, two.a);
    connect(two.b, shaft.a);
    connect(shaft.b, load.a);
    connect(load.b, bearing.a);
  end Coupled;

  connector Slide
    Real s(unit = "m") "Position";
    flow Real f(unit = "N") "Force into the part";
  end Slide;

  model Body
    Slide a;
    parameter Real m(unit = "kg") = 1;
    Real s(start = 0, min = -10, max = 10, unit = "m");
    Real v(start = 0, min = -20, max = 20, unit = "m/s");
  equation
    s = a.s;
    v = der(s);
    m*der(v) = a.f;
  end Body;

  model Buffer "A spring that stiffens, with a damper"
    Slide a;
    Slide b;
    parameter Real c = 20;
    parameter Real c3 = 5;
    parameter Real d = 0.5;
    Real x(unit = "m");
  equation
    x = b.s - a.s;
    b.f = c*x + c3*x^3 + d*der(x);
    a.f + b.f = 0;
  end Buffer;

  model Wall
    Slide a;
  equation
    a.s = 0;
  end Wall;

  model Push
    Slide b;
    input Real f(unit = "N");
  equation
    b.f = -f;
  end Push;

  model Train "Three wagons with buffers, the first tied to a wall"
    input Real f(min = -10, max = 10, unit = "N", start = 2);
    Wall wall;
    Buffer b1;
    Buffer b2;
    Buffer b3;
    Body w1(m = 1, s(fixed = true), v(fixed = true));
    Body w2(m = 2, s(start = 0.2, fixed = true), v(fixed = true));
    Body w3(m = 1.5, s(fixed = true), v(fixed = true));
    Push push(f = f);
    output Real y(unit = "m") = w3.s;
  equation
    connect(wall.a, b1.a);
    connect(b1.b, w1.a);
    connect(w1.a, b2.a);
    connect(b2.b, w2.a);
    connect(w2.a, b3.a);
    connect(b3.b, w3.a);
    connect(w3.a, push.b);
  end Train;

  connector Joint "The end of a rod in the plane"
    Real ax(unit = "m/s2") "Acceleration";
    Real ay(unit = "m/s2");
    flow Real fx(unit = "N") "Force on the part";
    flow Real fy(unit = "N");
  end Joint;

  model Anchor
    Joint b;
  equation
    b.ax = 0;
    b.ay = 0;
  end Anchor;

  model Free
    Joint a;
  equation
    a.fx = 0;
    a.fy = 0;
  end Free;

  model Rod "A thin rod that hangs from one end and carries the next at the other"
    Joint a;
    Joint b;
    parameter Real m(unit = "kg") = 1;
    parameter Real l(unit = "m") = 1;
    parameter Real g(unit = "m/s2") = 9.81;
    parameter Real d(unit = "N.m.s/rad") = 0.2;
    Real phi(start = 0.5, min = -3, max = 3, unit = "rad") "From the vertical";
    Real w(start = 0, min = -20, max = 20, unit = "rad/s");
    Real z(unit = "rad/s2");
    Real cx(unit = "m/s2");
    Real cy(unit = "m/s2");
  equation
    w = der(phi);
    z = der(w);
    b.ax = a.ax + l*(z*cos(phi) - w^2*sin(phi));
    b.ay = a.ay + l*(z*sin(phi) + w^2*cos(phi));
    cx = (a.ax + b.ax)/2;
    cy = (a.ay + b.ay)/2;
    m*cx = a.fx + b.fx;
    m*cy = a.fy + b.fy - m*g;
    m*l^2/12*z = l/2*((b.fx - a.fx)*cos(phi) + (b.fy - a.fy)*sin(phi)) - d*w;
  end Rod;

  model DoublePendulum "Two rods: forces and accelerations are one linear loop"
    Anchor anchor;
    Rod upper(phi(start = 0.4, fixed = true), w(fixed = true));
    Rod lower(m = 0.5, l = 0.7, phi(start = -0.2, fixed = true), w(fixed = true));
    Free free;
    output Real y(unit = "rad") = upper.phi;
  equation
    connect(anchor.b, upper.a);
    connect(upper.b, lower.a);
    connect(lower.b, free.a);
  end DoublePendulum;
end Mechanics;
