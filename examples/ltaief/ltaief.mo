model Ltaief "Plant (29) of Ltaief et al.: which combination of x2 and x3 is visible depends on the inputs"
  input Real u1(min = -1, max = 1) "Known input";
  input Real u2(min = -1, max = 1) "Known input";
  input Real u3(min = -5, max = 5) "Known input";
  input Real e1(min = -0.1, max = 0.1) "Uncertainty, unknown to the observer";
  Real x1(start = 1, min = 0.2, max = 4) "Measured state";
  Real x2(start = 0.5, min = -2, max = 2);
  Real x3(start = 0.5, min = -2, max = 2);
  output Real y = x1 "The only sensor";
equation
  der(x1) = u1*x1*x2 + u2*x1^2*x3 + x1*u3;
  der(x2) = x3 - 10*x2 + u3 - x2^3 + e1;
  der(x3) = -x3 - 2*x1*x2 - 10*u1*x2;
  annotation(experiment(StopTime = 10));
end Ltaief;
