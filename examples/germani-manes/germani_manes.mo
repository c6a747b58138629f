model GermaniManes "Third-order plant (5.1) of Germani and Manes, observable for small and slow inputs only"
  input Real u(start = 5, min = 3, max = 7) "Known input";
  Real x1(start = 0.5, min = -1.5, max = 1.5) "Measured state";
  Real x2(start = 0.5, min = -1.5, max = 1.5);
  Real x3(start = 0.5, min = -1.5, max = 1.5);
  output Real y = x1 "The only sensor";
equation
  der(x1) = x2 + (x3^2 - x1)*u;
  der(x2) = -x3*(1 + x1^2);
  // the paper prints sin(x3) here; its own (5.3) has sin(x2), and only that converges
  der(x3) = sin(x2);
  annotation(experiment(StopTime = 4));
end GermaniManes;
