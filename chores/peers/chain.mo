model Chain "Cells in a row, each emptied into the next by a flow that saturates"
  parameter Integer N = 4;
  input Real u(start = 0.7, min = 0, max = 10);
  Real x[N](each start = 0.5, each min = 0, each max = 10);
  output Real y = x[N];
equation
  der(x[1]) = u - 2.5*x[1]/(1 + 1.5*x[1]);
  for i in 2:N loop
    der(x[i]) = 2.5*x[i - 1]/(1 + 1.5*x[i - 1]) - 2.5*x[i]/(1 + 1.5*x[i]);
  end for;
end Chain;
