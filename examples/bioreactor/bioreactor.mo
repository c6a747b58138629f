model Bioreactor "Continuous culture behind a feed tank; nobody knows how fast the cells grow; time in hours"
  parameter Real Y(unit = "g/g") = 0.5 "Yield: cells per substrate";
  parameter Real k(unit = "1/h") = 0.1 "Renewal rate of the feed tank";
  parameter Real F0(unit = "g/L") = 12 "Substrate in the supply of the feed tank";
  input Real mu(start = 0.2, unit = "1/h", min = 0, max = 0.45) "Specific growth rate";
  input Real D(start = 0.2, unit = "1/h", min = 0.05, max = 0.4) "Dilution rate, set by the feed pump";
  Real X(start = 3, unit = "g/L", min = 0.5, max = 10) "Cells";
  Real S(start = 5, unit = "g/L", min = 0, max = 20) "Substrate";
  Real F(start = 8, unit = "g/L", min = 0, max = 20) "Substrate in the feed tank";
  output Real cells(unit = "g/L") = X "Optical density probe";
  output Real substrate(unit = "g/L") = S "Substrate analyser";
equation
  der(X) = (mu - D)*X;
  der(S) = D*(F - S) - mu*X/Y;
  der(F) = k*(F0 - F);
  annotation(experiment(StopTime = 60));
end Bioreactor;
