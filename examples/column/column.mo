model Column "Binary methanol-ethanol distillation column; time in minutes"
  parameter Integer N = 12 "Trays, from the condenser (1) down to the boiler (N)";
  parameter Integer f = 8 "Feed tray";
  parameter Real alpha = 1.65 "Relative volatility of methanol to ethanol";
  parameter Real F(unit = "mol/min") = 1.65 "Feed rate";
  parameter Real H[N](each unit = "mol") = {if i == 1 or i == N then 5.5 else 0.55 for i in 1:N} "Liquid holdup of each tray";
  input Real L(start = 4.69, unit = "mol/min", min = 3, max = 6) "Reflux rate";
  input Real V(start = 5.94, unit = "mol/min", min = 4, max = 8) "Vapour rate";
  input Real Zf(start = 0.75, unit = "1", min = 0, max = 1) "Methanol fraction of the feed";
  Real x[N](
    start = {0.93000585, 0.88953536, 0.84223977, 0.78925097, 0.73261728, 0.67505746,
             0.61947090, 0.56837712, 0.47000139, 0.36710020, 0.27017424, 0.18748224},
    each unit = "1", each min = 0, each max = 1) "Methanol fraction of the liquid on each tray";
  Real y[N](each unit = "1") "Methanol fraction of the vapour above each tray";
  output Real top(unit = "1") = x[1] "Product of the condenser";
  output Real bottom(unit = "1") = x[N] "Product of the boiler";
equation
  for i in 1:N loop
    y[i] = alpha*x[i]/(1 + (alpha - 1)*x[i]) "Equilibrium of vapour and liquid";
  end for;
  H[1]*der(x[1]) = V*(y[2] - x[1]) "Total condenser";
  for i in 2:f - 1 loop
    H[i]*der(x[i]) = L*(x[i - 1] - x[i]) + V*(y[i + 1] - y[i]) "Rectifying section";
  end for;
  H[f]*der(x[f]) = F*(Zf - x[f]) + L*(x[f - 1] - x[f]) + V*(y[f + 1] - y[f]) "Feed tray";
  for i in f + 1:N - 1 loop
    H[i]*der(x[i]) = (F + L)*(x[i - 1] - x[i]) + V*(y[i + 1] - y[i]) "Stripping section";
  end for;
  H[N]*der(x[N]) = (F + L)*(x[N - 1] - x[N]) + V*(x[N] - y[N]) "Boiler";
  annotation(experiment(StopTime = 120));
end Column;
