model Farza "System (15) of Farza, M'Saad, Liu and Targui: an unknown input in every equation"
  parameter Real a = 1 "Not given in the paper, other than a <> 0";
  input Real v(min = -6, max = 6) "The unknown input";
  Real x1(start = 1, min = -12, max = 12);
  Real x2(start = 1, min = -12, max = 12);
  Real x3(start = 1, min = -5, max = 5);
  Real x4(start = 2, min = -4, max = 4);
  Real x5(start = 10, min = -20, max = 20);
  output Real y1 = x1;
  output Real y2 = x2;
  output Real y3 = x3;
equation
  der(x1) = (a - x3)*x4 - x3*v - x1;
  der(x2) = x3*x4 + (a - x3)*v - x2;
  der(x3) = x4*(1 + x4^2) - x3^3 - 10*sin(time)*v;
  der(x4) = x5 - x4^3 - 2*cos(time)*v;
  der(x5) = 5*sin(2*time)*v;
  annotation(experiment(StopTime = 10));
end Farza;
